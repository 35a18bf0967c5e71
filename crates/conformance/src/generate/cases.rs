//! Every scene and motion that laws are tried on.

use super::meshes::{self, Mesh, PLUMP, grid, octahedron, sheet, soup};
use super::mixed;
use super::placement::Placement;
use super::rays::{Aims, RayKind, Target};
use crate::Case;
use fastrand::Rng;
use geom::{Animation, Point, Ray, Triangle};
use std::ops::Range;
use std::sync::Arc;

named! {
    /// What scenes are made of. Kinds take turns, so that few cases already see each of them.
    enum SceneKind {
        /// Free triangles.
        Soup = "soup",
        /// A sheet whose triangles share vertices.
        Sheet = "sheet",
        /// A closed body.
        Body = "body",
        /// Needles and flakes.
        Slivers = "slivers",
        /// Equal triangles, and coplanar ones that overlap.
        Stack = "stack",
        /// Triangles that are inactive or degenerate, always or at times.
        Broken = "broken",
        /// Nothing, one triangle, two triangles.
        Few = "few",
        /// All triangles inactive, always or at times.
        Gone = "gone",
        /// Key frames of very different size.
        Grown = "grown",
        /// Coordinates that are zeros of either sign or hardly more.
        Zeros = "zeros",
        /// Each triangle half the size of the one before, so that trees are deep.
        Ladder = "ladder",
        /// Much or all of it never moves: free triangles, some of them joined to what moves, of no area or inactive.
        Resting = "resting",
        /// A body that moves over a large sheet that does not, so that few of many treelets move.
        Hall = "hall",
        /// One vertex or one triangle goes far away, or comes near the origin, always or at times.
        Outlying = "outlying",
    }
}

/// Rays of a case, three of each kind a round: at an inside, an edge and a vertex.
const RAYS: [RayKind; 18] = [
    RayKind::Aimed,
    RayKind::Exactly,
    RayKind::InPlane,
    RayKind::AlongAxis,
    RayKind::AlongEdge,
    RayKind::OnSurface,
    RayKind::Between,
    RayKind::Beyond,
    RayKind::ZeroComponent,
    RayKind::Lopsided,
    RayKind::Interval,
    RayKind::EndsOnTarget,
    RayKind::Behind,
    RayKind::Short,
    RayKind::Long,
    RayKind::Subnormal,
    RayKind::Limited,
    RayKind::Void,
];
const ROUNDS: usize = 2;

/// Key frames of vertices, and three vertices a triangle.
type Moving = (Vec<Vec<Point>>, Vec<[u32; 3]>);

/// The `i`-th case of a seed.
#[must_use]
pub fn nth_case(seed: u64, i: u32) -> Case {
    let rng = &mut Rng::with_seed(mixed(mixed(seed) ^ u64::from(i)));
    let kind = SceneKind::ALL[i as usize % SceneKind::ALL.len()];
    let place = Placement::any(rng);
    let (mut keys, triangles) = scene(kind, rng);
    for p in keys.iter_mut().flatten() {
        *p = place.put(*p);
    }
    let animation = Animation::new(keys, triangles).expect("scenes made here are sound");
    // One of them is often a key frame.
    let mut times = [(); 3].map(|()| 2.0 * rng.f64());
    if rng.bool() {
        times[rng.usize(..3)] = f64::from(rng.u8(..3));
    }
    let (kinds, rays) = rays(&animation, times[1], rng).into_iter().unzip();
    let anywhere = unit(rng);
    let light = place.put(anywhere.map(|x| 3.0 * x));
    Case {
        about: format!("{kind}, {place:?}"),
        rays,
        kinds,
        camera: place.camera(anywhere),
        light: hard_light(&animation, times[1], rng).unwrap_or(light),
        animation: Arc::new(animation),
        times: times.to_vec(),
        chance: rng.u64(..),
    }
}

fn rays(animation: &Animation, time: f64, rng: &mut Rng) -> Vec<(RayKind, Ray)> {
    let [near, all] = &Aims::of(animation, time);
    let targets = Target::ALL.repeat(ROUNDS);
    let kinds = targets.iter().flat_map(|&t| RAYS.map(|kind| (kind, t)));
    kinds
        .map(|(kind, target)| {
            let aims = [near, all][rng.usize(..4).min(1)];
            (kind, aims.ray(kind, target, rng))
        })
        .collect()
}

/// Half the time, a light where shadows are hardest: in a triangle's plane beyond it, or at one of its vertices.
fn hard_light(animation: &Animation, time: f64, rng: &mut Rng) -> Option<Point> {
    let count = animation.triangle_count() as u32;
    let (hard, reach) = (rng.bool(), [0.0, 3.0][rng.usize(..2)]);
    if count == 0 || !hard {
        return None;
    }
    let [a, b, _] = animation.at(time).unwrap().corners(rng.u32(..count));
    let light: Point = std::array::from_fn(|i| a[i] + reach * (b[i] - a[i]));
    light.iter().all(|x| x.is_finite()).then_some(light)
}

/// Numbers in `-1..=1`, three at a time, none of them subnormal.
fn unit(rng: &mut Rng) -> Point {
    [(); 3].map(|()| grid(1000, rng))
}

/// Three key frames of a mesh of about unit size.
fn scene(kind: SceneKind, rng: &mut Rng) -> Moving {
    match kind {
        SceneKind::Soup => free(1..150, 0.0, rng),
        SceneKind::Slivers => free(1..60, -4.0, rng),
        SceneKind::Stack => stacked(free(1..8, 0.0, rng)),
        SceneKind::Broken => broken(free(2..40, 0.0, rng), rng),
        SceneKind::Few => {
            let (keys, mut triangles) = free(2..3, 0.0, rng);
            triangles.truncate(rng.usize(..3));
            (keys, triangles)
        }
        SceneKind::Gone => gone(free(1..20, 0.0, rng), rng),
        SceneKind::Grown => grown(free(1..40, 0.0, rng), rng),
        SceneKind::Ladder => ladder(free(20..70, 0.0, rng)),
        SceneKind::Resting => resting(free(8..200, 0.0, rng), rng),
        SceneKind::Sheet => {
            let n = rng.u32(2..9);
            animate(sheet(n, 8, rng), rng)
        }
        SceneKind::Body => animate(octahedron(rng.u32(1..3)), rng),
        SceneKind::Zeros => zeros(rng),
        SceneKind::Hall => hall(rng),
        SceneKind::Outlying => outlying(rng),
    }
}

/// So many free triangles, whose second edge is `10^thin` times as long as the first.
fn free(count: Range<usize>, thin: f64, rng: &mut Rng) -> Moving {
    let count = rng.usize(count);
    scattered(&soup(count, 0.4, [thin; 2], rng), rng)
}

/// Where something stands in each of three key frames.
fn drift(rng: &mut Rng) -> [Point; 3] {
    [[0.0; 3], unit(rng), unit(rng)]
}

/// Free triangles, each of which goes its own way.
fn scattered(all: &[Triangle], rng: &mut Rng) -> Moving {
    let mut keys = vec![Vec::new(); 3];
    for corners in all {
        for (key, by) in keys.iter_mut().zip(drift(rng)) {
            key.extend(corners.map(|p| plus(p, by, 1.0)));
        }
    }
    (keys, meshes::apart(all.len()))
}

/// A body whose vertices drift, each by its own share.
fn animate((points, triangles): Mesh, rng: &mut Rng) -> Moving {
    let shares: Vec<f32> = points.iter().map(|_| rng.f32()).collect();
    let key = |by: Point| {
        let points = points.iter().zip(&shares);
        points.map(|(&p, &share)| plus(p, by, share)).collect()
    };
    (drift(rng).map(key).to_vec(), triangles)
}

fn plus(p: Point, by: Point, share: f32) -> Point {
    std::array::from_fn(|i| p[i] + share * by[i])
}

/// Each triangle thrice, and once more turned round.
fn stacked((keys, triangles): Moving) -> Moving {
    let again = |&[a, b, c]: &[u32; 3]| [[a, b, c], [a, b, c], [b, c, a], [a, c, b]];
    (keys, triangles.iter().flat_map(again).collect())
}

/// Some vertices not finite in some keys, some triangles of no area.
fn broken((mut keys, mut triangles): Moving, rng: &mut Rng) -> Moving {
    let vertices = keys[0].len();
    for n in 0..12 {
        let vertex = rng.usize(..vertices);
        match n % 4 {
            0 => keys[rng.usize(..3)][vertex][rng.usize(..3)] = f32::NAN,
            1 => keys.iter_mut().for_each(|k| k[vertex] = [f32::INFINITY; 3]),
            2 => triangles.push([vertex as u32; 3]),
            _ => {
                let other = (vertex as u32 + 1) % vertices as u32;
                triangles.push([vertex as u32, other, vertex as u32]);
            }
        }
    }
    (keys, triangles)
}

/// Nothing finite in some key frame, or in several.
fn gone((mut keys, triangles): Moving, rng: &mut Rng) -> Moving {
    let which = rng.usize(1..8);
    for (i, key) in keys.iter_mut().enumerate() {
        if which >> i & 1 == 1 {
            let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i];
            key.iter_mut().for_each(|p| p[i] = odd);
        }
    }
    (keys, triangles)
}

/// Each key frame multiplied by a power of two.
fn grown((mut keys, triangles): Moving, rng: &mut Rng) -> Moving {
    for key in &mut keys {
        let by = 2.0_f32.powi(rng.i32(-35..=20));
        key.iter_mut().flatten().for_each(|x| *x *= by);
    }
    (keys, triangles)
}

/// The `i`-th triangle is multiplied by `2^-i`.
fn ladder((mut keys, triangles): Moving) -> Moving {
    for (v, p) in keys.iter_mut().flat_map(|key| key.iter_mut().enumerate()) {
        *p = p.map(|x| x * 0.5_f32.powi(v as i32 / 3));
    }
    (keys, triangles)
}

/// Only the first few triangles move, up to three of sixteen; the rest stands as in
/// the first key frame. Some of the rest is odd: see the arms.
fn resting((mut keys, mut triangles): Moving, rng: &mut Rng) -> Moving {
    let moving = triangles.len() * rng.usize(..4) / 16;
    let still = 3 * moving..keys[0].len();
    let (first, later) = keys.split_at_mut(1);
    for key in later {
        key[still.clone()].copy_from_slice(&first[0][still.clone()]);
    }
    for n in 0..16 {
        let (vertex, axis, often) = (rng.usize(still.clone()), n % 3, rng.u8(..3) == 0);
        let all = keys.iter_mut().map(|key| &mut key[vertex]);
        match n % 8 {
            // Between key frames, this zero has another sign.
            0 => all.for_each(|p| p[axis] = -0.0),
            1 => all.for_each(|p| p[axis] = 0.0),
            2 if often => all.for_each(|p| p[axis] = f32::NAN),
            3 if often => all.for_each(|p| *p = [f32::INFINITY; 3]),
            4 => triangles.push([vertex as u32; 3]),
            5 => triangles.push([rng.u32(..3), vertex as u32, vertex as u32 / 2]),
            _ => {}
        }
    }
    (keys, triangles)
}

/// A sheet that stands still, a small body that moves above it, and triangles of no area on both.
fn hall(rng: &mut Rng) -> Moving {
    let n = rng.u32(18..34);
    let (floor, mut triangles) = sheet(n, 8, rng);
    let (points, faces) = octahedron(rng.u32(..3));
    let small = points.iter().map(|p| p.map(|x| 0.1 * x + 0.3)).collect();
    let (mut keys, faces) = animate((small, faces), rng);
    let before = floor.len() as u32;
    for key in &mut keys {
        key.splice(0..0, floor.iter().copied());
    }
    triangles.extend(faces.iter().map(|t| t.map(|v| before + v)));
    for _ in 0..6 {
        let (a, b) = (rng.u32(..keys[0].len() as u32), rng.u32(..before));
        triangles.push([a, b, a]);
    }
    (keys, triangles)
}

/// In some key frames, some vertices multiplied by a power of two between `2^-128` and `2^126`.
fn outlying(rng: &mut Rng) -> Moving {
    let (mut keys, triangles) = match rng.usize(..3) {
        0 => animate(sheet(4, 8, rng), rng),
        1 => animate(octahedron(rng.u32(1..3)), rng),
        _ => scattered(&soup(40, 0.4, PLUMP, rng), rng),
    };
    let exponent = match rng.usize(..4) {
        0 => rng.i32(-128..=-10),
        _ => rng.i32(10..=126),
    };
    let corners = triangles[rng.usize(..triangles.len())];
    let far = &corners[..[1, 3][rng.usize(..2)]];
    let when = rng.u32(1..8);
    let keys_then = keys.iter_mut().enumerate();
    for (_, key) in keys_then.filter(|(k, _)| when >> k & 1 == 1) {
        for &vertex in far {
            key[vertex as usize] = key[vertex as usize].map(|x| x * 2.0_f32.powi(exponent));
        }
    }
    (keys, triangles)
}

fn zeros(rng: &mut Rng) -> Moving {
    const NUMBERS: [f32; 9] = [0.0, -0.0, 0.0, -0.0, 1.0, -1.0, 1e-30, -1e-18, 1e-12];
    let n = rng.usize(1..30);
    let mut point = || [(); 3].map(|()| NUMBERS[rng.usize(..NUMBERS.len())]);
    let keys = (0..3).map(|_| (0..3 * n).map(|_| point()).collect());
    (keys.collect(), meshes::apart(n))
}
