//! Every scene and motion that laws are tried on.

use crate::Case;
use crate::places::{Placement, place};
use crate::rays::{self, rays};
use crate::shapes::{Shape, octahedron, sheet};
use geom::{Animation, Point};
use proptest::prelude::*;
use std::sync::Arc;

/// What scenes are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneKind {
    /// Free triangles.
    Soup,
    /// A sheet whose triangles share vertices.
    Sheet,
    /// A closed body.
    Body,
    /// Needles and flakes.
    Slivers,
    /// Equal triangles, and coplanar ones that overlap.
    Stack,
    /// Triangles that are inactive or degenerate, always or at times.
    Broken,
    /// Nothing, one triangle, two triangles.
    Few,
    /// All triangles inactive, always or at times.
    Gone,
    /// Key frames of very different size.
    Grown,
    /// Coordinates that are zeros of either sign or hardly more.
    Zeros,
    /// Each triangle half the size of the one before, so that trees are deep.
    Ladder,
    /// Much or all of it never moves: free triangles, some of them joined to what moves, of no area or inactive.
    Resting,
    /// A body that moves over a large sheet that does not, so that few of many treelets move.
    Hall,
    /// One vertex or one triangle goes far away, or comes near the origin, always or at times.
    Outlying,
}

impl SceneKind {
    /// All there are.
    pub const ALL: [Self; 14] = [
        Self::Soup,
        Self::Sheet,
        Self::Body,
        Self::Slivers,
        Self::Stack,
        Self::Broken,
        Self::Few,
        Self::Gone,
        Self::Grown,
        Self::Zeros,
        Self::Ladder,
        Self::Resting,
        Self::Hall,
        Self::Outlying,
    ];
}

type Mesh = (Vec<Vec<Point>>, Vec<[u32; 3]>);

/// A case of one kind.
pub fn case(kind: SceneKind) -> impl Strategy<Value = Case> {
    let choices = (
        prop::collection::vec(unit(), rays::COUNT),
        prop::collection::vec(any::<u32>(), rays::COUNT),
        prop::collection::vec(0.0..2.0, 3),
        any::<u64>(),
    );
    (mesh(kind), place(), choices).prop_map(
        move |((mut keys, triangles), place, (units, picks, mut times, chance))| {
            for p in keys.iter_mut().flatten() {
                *p = place.put(*p);
            }
            let animation = Animation::new(keys, triangles).expect("strategies make sound scenes");
            times.push(1.0);
            let (families, rays) = rays(&animation, place, &units, &picks).into_iter().unzip();
            let Placement { scale, offset } = place;
            Case {
                about: format!("{kind:?} at scale {scale:e}, offset {offset:e}"),
                rays,
                families,
                camera: place.camera(units[0]),
                light: light(&animation, place, picks[0], units[1]),
                animation: Arc::new(animation),
                times,
                chance,
            }
        },
    )
}

/// Somewhere, or where shadows are hardest: in a triangle's plane beyond it, or at one of its vertices.
fn light(animation: &Animation, place: Placement, pick: u32, unit: Point) -> Point {
    let count = animation.triangle_count() as u32;
    let somewhere = place.at(unit, 3.0);
    if count == 0 || pick.is_multiple_of(2) {
        return somewhere;
    }
    let [a, b, _] = animation.corners(animation.pose(1.0), pick / 4 % count);
    let reach = if pick & 2 == 0 { 0.0 } else { 3.0 };
    let light = std::array::from_fn(|i| a[i] + reach * (b[i] - a[i]));
    if light.iter().all(|x: &f32| x.is_finite()) {
        light
    } else {
        somewhere
    }
}

/// Numbers in `-1..=1`, three at a time, none of them subnormal.
fn unit() -> impl Strategy<Value = Point> {
    let grid = -1000_i32..=1000;
    [grid.clone(), grid.clone(), grid].prop_map(|p| p.map(|x| x as f32 / 1000.0))
}

/// Three key frames of a mesh of about unit size.
fn mesh(kind: SceneKind) -> BoxedStrategy<Mesh> {
    match kind {
        SceneKind::Soup => soup(1.0, 1..150).boxed(),
        SceneKind::Sheet => (2_usize..9, drift())
            .prop_map(|(n, d)| animate(sheet(n), &d))
            .boxed(),
        SceneKind::Body => (1_u32..3, drift())
            .prop_map(|(n, d)| animate(octahedron(n), &d))
            .boxed(),
        SceneKind::Slivers => soup(1e-4, 1..60).boxed(),
        SceneKind::Stack => soup(1.0, 1..8).prop_map(stacked).boxed(),
        SceneKind::Broken => (soup(1.0, 2..40), prop::collection::vec(any::<u32>(), 12))
            .prop_map(|(m, picks)| broken(m, &picks))
            .boxed(),
        SceneKind::Few => (0_usize..3, soup(1.0, 2..3))
            .prop_map(|(n, (keys, mut triangles))| {
                triangles.truncate(n);
                (keys, triangles)
            })
            .boxed(),
        SceneKind::Gone => (soup(1.0, 1..20), 1_usize..8).prop_map(gone).boxed(),
        SceneKind::Grown => (soup(1.0, 1..40), prop::array::uniform3(-35_i32..=20))
            .prop_map(grown)
            .boxed(),
        SceneKind::Outlying => outlying().boxed(),
        SceneKind::Zeros => zeros().boxed(),
        SceneKind::Ladder => soup(1.0, 20..70).prop_map(ladder).boxed(),
        SceneKind::Resting => (
            soup(1.0, 8..200),
            prop::collection::vec(any::<u32>(), 16),
            0_usize..4,
        )
            .prop_map(|(m, picks, share)| resting(m, &picks, share))
            .boxed(),
        SceneKind::Hall => (
            18_usize..34,
            0_u32..3,
            drift(),
            prop::collection::vec(any::<u32>(), 6),
        )
            .prop_map(|(n, level, drift, picks)| hall(n, (octahedron(level), &drift), &picks))
            .boxed(),
    }
}

/// Free triangles whose second edge is `thin` times as long as the first.
fn soup(thin: f32, count: std::ops::Range<usize>) -> impl Strategy<Value = Mesh> {
    prop::collection::vec((unit(), unit(), unit(), drift()), count).prop_map(move |all| {
        let mut keys = vec![Vec::new(); 3];
        for (corner, e, f, drift) in &all {
            let tip = |d: &Point, by: f32| std::array::from_fn(|i| corner[i] + by * d[i]);
            let corners = [*corner, tip(e, 0.4), tip(f, 0.4 * thin)];
            for (key, move_by) in keys.iter_mut().zip(drift) {
                key.extend(
                    corners.map(|p| std::array::from_fn::<f32, 3, _>(|i| p[i] + move_by[i])),
                );
            }
        }
        (keys, separate(all.len()))
    })
}

/// Triangles that share no vertex.
fn separate(count: usize) -> Vec<[u32; 3]> {
    (0..count as u32)
        .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
        .collect()
}

/// Where something stands in each of three key frames.
fn drift() -> impl Strategy<Value = [Point; 3]> {
    [Just([0.0; 3]).boxed(), unit().boxed(), unit().boxed()]
}

/// A body whose vertices drift, each by its own share.
fn animate((points, triangles): Shape, drift: &[Point; 3]) -> Mesh {
    let share = |v: usize| ((v * 2_654_435_761) % 97) as f32 / 97.0;
    let at = |d: &Point| {
        let place = |(v, p): (usize, &Point)| std::array::from_fn(|i| p[i] + d[i] * share(v));
        points.iter().enumerate().map(place).collect()
    };
    (drift.iter().map(at).collect(), triangles)
}

/// Each triangle thrice, and once more turned round.
fn stacked((keys, triangles): Mesh) -> Mesh {
    let again = |t: &[u32; 3]| [*t, *t, [t[1], t[2], t[0]], [t[0], t[2], t[1]]];
    let triangles = triangles.iter().flat_map(again).collect();
    (keys, triangles)
}

/// Some vertices not finite in some keys, some triangles of no area.
fn broken((mut keys, mut triangles): Mesh, picks: &[u32]) -> Mesh {
    let vertices = keys[0].len();
    for (n, &pick) in picks.iter().enumerate() {
        let vertex = pick as usize % vertices;
        match n % 4 {
            0 => keys[pick as usize / 7 % 3][vertex][n % 3] = f32::NAN,
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

/// Nothing finite in those key frames whose bit is set.
fn gone(((mut keys, triangles), which): (Mesh, usize)) -> Mesh {
    for (i, key) in keys.iter_mut().enumerate() {
        if which >> i & 1 == 1 {
            key.iter_mut()
                .for_each(|p| p[i] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i]);
        }
    }
    (keys, triangles)
}

/// Each key frame multiplied by a power of two.
fn grown(((mut keys, triangles), exponents): (Mesh, [i32; 3])) -> Mesh {
    for (key, e) in keys.iter_mut().zip(exponents) {
        for x in key.iter_mut().flatten() {
            *x *= 2.0_f32.powi(e);
        }
    }
    (keys, triangles)
}

/// In some key frames, some vertices multiplied by a power of two between `2^-128` and `2^126`.
fn outlying() -> impl Strategy<Value = Mesh> {
    let shape = prop_oneof![
        (2_usize..6, drift()).prop_map(|(n, d)| animate(sheet(n), &d)),
        (1_u32..3, drift()).prop_map(|(n, d)| animate(octahedron(n), &d)),
        soup(1.0, 8..60),
    ];
    let exponent = prop_oneof![3 => 10_i32..=126, 1 => -128_i32..=-10];
    (shape, exponent, any::<u32>(), 1_u32..8).prop_map(|((mut keys, triangles), e, pick, when)| {
        let corners = triangles[(pick >> 2) as usize % triangles.len()];
        let far = &corners[..[1, 3][pick as usize % 2]];
        let whiles = keys
            .iter_mut()
            .enumerate()
            .filter(|(k, _)| when >> k & 1 == 1);
        for (_, key) in whiles {
            for &vertex in far {
                key[vertex as usize] = key[vertex as usize].map(|x| x * 2.0_f32.powi(e));
            }
        }
        (keys, triangles)
    })
}

/// Only the first few triangles move, `share` of sixteen; the rest stands as in
/// the first key frame. Some of the rest is odd: see the arms.
fn resting((mut keys, mut triangles): Mesh, picks: &[u32], share: usize) -> Mesh {
    let moving = triangles.len() * share / 16;
    let still = 3 * moving..keys[0].len();
    let (first, later) = keys.split_at_mut(1);
    for key in later {
        key[still.clone()].copy_from_slice(&first[0][still.clone()]);
    }
    for (n, &pick) in picks.iter().enumerate() {
        let vertex = still.start + pick as usize % still.len();
        let all = keys.iter_mut().map(|key| &mut key[vertex]);
        match n % 8 {
            // Between key frames, this zero has another sign.
            0 => all.for_each(|p| p[n % 3] = -0.0),
            1 => all.for_each(|p| p[n % 3] = 0.0),
            2 if pick % 3 == 0 => all.for_each(|p| p[n % 3] = f32::NAN),
            3 if pick % 3 == 0 => all.for_each(|p| *p = [f32::INFINITY; 3]),
            4 => triangles.push([vertex as u32; 3]),
            5 => triangles.push([pick % 3, vertex as u32, vertex as u32 / 2]),
            _ => {}
        }
    }
    (keys, triangles)
}

/// A sheet of `2 n^2` triangles that stands still, a small body above it, and triangles of no area on both.
fn hall(n: usize, (body, drift): (Shape, &[Point; 3]), picks: &[u32]) -> Mesh {
    let (floor, mut triangles) = sheet(n);
    let small = |p: &Point| p.map(|x| 0.1 * x + 0.3);
    let body = (body.0.iter().map(small).collect(), body.1);
    let (mut keys, body_triangles) = animate(body, drift);
    let before = floor.len() as u32;
    for key in &mut keys {
        key.splice(0..0, floor.iter().copied());
    }
    triangles.extend(body_triangles.iter().map(|t| t.map(|v| before + v)));
    let vertices = keys[0].len() as u32;
    for &pick in picks {
        let (a, b) = (pick % vertices, pick / 7 % before);
        triangles.push([a, b, a]);
    }
    (keys, triangles)
}

fn zeros() -> impl Strategy<Value = Mesh> {
    let number = || {
        let all: &'static [f32] = &[0.0, -0.0, 0.0, -0.0, 1.0, -1.0, 1e-30, -1e-18, 1e-12];
        prop::sample::select(all)
    };
    let point = move || [number(), number(), number()];
    (1_usize..30).prop_flat_map(move |n| {
        let key = move || prop::collection::vec(point(), 3 * n);
        [key(), key(), key()].prop_map(move |keys| (keys.into(), separate(n)))
    })
}

/// The `i`-th triangle is multiplied by `2^-i`.
fn ladder((mut keys, triangles): Mesh) -> Mesh {
    for key in &mut keys {
        for (v, p) in key.iter_mut().enumerate() {
            *p = p.map(|x| x * 0.5_f32.powi(v as i32 / 3));
        }
    }
    (keys, triangles)
}
