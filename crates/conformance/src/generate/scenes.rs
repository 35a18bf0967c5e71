//! All scenes and motions with which properties and audits test backends.

use super::bodies::{BODIES, icosphere};
use super::meshes::{self, Mesh, PLUMP, flakes, grid, plane, plus, sheet, soup, stacks};
use fastrand::Rng;
use geom::Point;
use std::ops::Range;

backend::named! {
    /// Contents of a scene. Kinds rotate, so that a few cases contain every kind.
    pub(crate) enum SceneKind {
        /// Separate triangles.
        Soup = "soup",
        /// A sheet whose triangles share vertices.
        Sheet = "sheet",
        /// A closed body.
        Body = "body",
        /// Triangles with zero or nearly zero area, among regular ones.
        Flakes = "flakes",
        /// A regular grid in one plane, tilted so that its coordinates stay exact.
        Plane = "plane",
        /// Needles and flakes.
        Slivers = "slivers",
        /// Equal triangles, and coplanar ones that overlap.
        Stack = "stack",
        /// Triangles that are inactive or degenerate, always or in some key frames.
        Broken = "broken",
        /// No triangle, one triangle or two triangles.
        Few = "few",
        /// All triangles inactive, in some or all key frames.
        Gone = "gone",
        /// Key frames that differ greatly in size.
        Grown = "grown",
        /// Coordinates that are zeros of either sign, or small numbers.
        Zeros = "zeros",
        /// Mostly or entirely static separate triangles, some joined to moving ones, of no area or inactive.
        Resting = "resting",
        /// A body that moves over a large static sheet, so that few of many treelets move.
        Hall = "hall",
        /// One vertex or one triangle moves far away or close to the origin, in some or all key frames.
        Outlying = "outlying",
    }
}

/// Vertices of each key frame, and three vertex indices per triangle.
pub(crate) type Moving = (Vec<Vec<Point>>, Vec<[u32; 3]>);

/// Returns three numbers in `-1..=1` that are multiples of a power of two and not subnormal.
pub(crate) fn unit(rng: &mut Rng) -> Point {
    [(); 3].map(|()| grid(1024, rng))
}

/// Returns three key frames of a mesh of about unit size.
pub(crate) fn scene(kind: SceneKind, rng: &mut Rng) -> Moving {
    match kind {
        SceneKind::Soup => free(1..150, PLUMP, rng),
        SceneKind::Slivers => free(1..60, [-7.0, -3.0], rng),
        SceneKind::Flakes => scattered(meshes::separate(&flakes(rng)), rng),
        SceneKind::Stack => scattered(stacks(rng), rng),
        SceneKind::Plane => animate(plane(rng), rng),
        SceneKind::Broken => broken(free(2..40, PLUMP, rng), rng),
        SceneKind::Few => {
            let (keys, mut triangles) = free(2..3, PLUMP, rng);
            triangles.truncate(rng.usize(..3));
            (keys, triangles)
        }
        SceneKind::Gone => gone(free(1..20, PLUMP, rng), rng),
        SceneKind::Grown => grown(free(1..40, PLUMP, rng), rng),
        SceneKind::Resting => resting(free(8..200, PLUMP, rng), rng),
        SceneKind::Sheet => {
            let (n, steps) = (rng.u32(2..9), [4, 8, 1000][rng.usize(..3)]);
            animate(sheet(n, steps, rng), rng)
        }
        SceneKind::Body => animate(body(rng), rng),
        SceneKind::Zeros => zeros(rng),
        SceneKind::Hall => hall(rng),
        SceneKind::Outlying => outlying(rng),
    }
}

/// Returns separate triangles, whose number is in `count`. Second edges are scaled by a power of ten with an exponent in
/// `thin`.
fn free(count: Range<usize>, thin: [f64; 2], rng: &mut Rng) -> Moving {
    let count = rng.usize(count);
    scattered(meshes::separate(&soup(count, 0.4, thin, rng)), rng)
}

/// Returns one of [`BODIES`], scaled to unit size.
fn body(rng: &mut Rng) -> Mesh {
    let body = BODIES[rng.usize(..BODIES.len())];
    let (points, triangles) = (body.shape)();
    let shrunk = |p: Point| p.map(|x| x / body.radius as f32);
    (points.into_iter().map(shrunk).collect(), triangles)
}

/// Returns an offset for each of three key frames.
fn drift(rng: &mut Rng) -> [Point; 3] {
    [[0.0; 3], unit(rng), unit(rng)]
}

/// Animates a mesh so that each run of three vertices moves independently.
fn scattered((points, triangles): Mesh, rng: &mut Rng) -> Moving {
    let mut keys = vec![Vec::new(); 3];
    for three in points.chunks(3) {
        for (key, by) in keys.iter_mut().zip(drift(rng)) {
            key.extend(three.iter().map(|&p| plus(p, 1.0, by)));
        }
    }
    (keys, triangles)
}

/// Animates a body whose vertices drift, each by a random share.
fn animate((points, triangles): Mesh, rng: &mut Rng) -> Moving {
    let shares: Vec<f32> = points.iter().map(|_| rng.f32()).collect();
    let key = |by: Point| {
        let points = points.iter().zip(&shares);
        points.map(|(&p, &share)| plus(p, share, by)).collect()
    };
    (drift(rng).map(key).to_vec(), triangles)
}

/// Makes some vertices not finite in some key frames, and adds triangles of no area.
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

/// Makes all vertices not finite in at least one key frame.
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

/// Multiplies each key frame by a power of two.
fn grown((mut keys, triangles): Moving, rng: &mut Rng) -> Moving {
    for key in &mut keys {
        let by = 2.0_f32.powi(rng.i32(-35..=20));
        key.iter_mut().flatten().for_each(|x| *x *= by);
    }
    (keys, triangles)
}

/// Makes all triangles static except the first few, up to three of sixteen.
///
/// Static triangles stay as in the first key frame. Some static vertices get special values, and some triangles are
/// degenerate.
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
            // Between key frames, this zero is positive.
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

/// Returns a static sheet, a small body that moves above it, and triangles of no area on both.
fn hall(rng: &mut Rng) -> Moving {
    let n = rng.u32(18..34);
    let (floor, mut triangles) = sheet(n, 8, rng);
    let (points, faces) = icosphere(rng.u32(..2));
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

/// In some key frames, multiplies some vertices by a power of two between `2^-128` and `2^126`.
fn outlying(rng: &mut Rng) -> Moving {
    let (mut keys, triangles) = match rng.usize(..3) {
        0 => animate(sheet(4, 8, rng), rng),
        1 => animate(icosphere(1), rng),
        _ => free(40..41, PLUMP, rng),
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
    let key = |()| meshes::of_numbers(&NUMBERS, n, rng).concat();
    ([(); 3].map(key).to_vec(), meshes::apart(n))
}
