//! Scenes and motions of the generated cases.

use super::bodies::{BODIES, icosphere};
use super::meshes::{
    self, IndexedMesh, UNSHORTENED_EDGE, flakes, grid, plane, plus, sheet, soup, stacks,
};
use super::strategies::shrinking_list;
use geom::Point;
use proptest::array::uniform3;
use proptest::collection::{SizeRange, vec};
use proptest::prelude::*;
use proptest::sample::select;
use std::ops::Range;

backend::named! {
    /// Contents of a scene. Consecutive cases cycle through the kinds.
    pub enum SceneKind {
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
        /// Triangles a thousand to ten million times as long as wide.
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
        /// Coordinates that are zeros of either sign, ±1 or tiny numbers.
        Zeros = "zeros",
        /// Separate triangles, most or all of which are static. Some are joined to moving ones, degenerate or inactive.
        Resting = "resting",
        /// A body that moves near a large static sheet, so that few of many treelets move.
        Hall = "hall",
        /// One vertex or one triangle moves far away or close to the origin, in some or all key frames.
        Outlying = "outlying",
    }
}

/// Vertices of each key frame, and three vertex indices per triangle.
pub(crate) type MovingMesh = (Vec<Vec<Point>>, Vec<[u32; 3]>);

/// Number of key frames.
pub(crate) const KEYS: usize = 3;

/// Points with coordinates in `-1..=1` that are multiples of `1 / 1024`.
pub(crate) fn grid_point() -> impl Strategy<Value = Point> + Clone {
    uniform3(grid(1024))
}

/// Three key frames of a mesh of about unit size.
///
/// Shrinking a scene removes special vertices and triangles, and reduces a few numbers, such as the exponents of
/// [`SceneKind::Grown`]. Shrinking a [case](super::cases) also removes other triangles, key frames and digits.
pub(crate) fn scenes(kind: SceneKind) -> BoxedStrategy<MovingMesh> {
    match kind {
        SceneKind::Soup => moving_soup(1..150, UNSHORTENED_EDGE).boxed(),
        SceneKind::Slivers => moving_soup(1..60, [-7.0, -3.0]).boxed(),
        SceneKind::Flakes => scattered(flakes().prop_map(|all| meshes::separate(&all))).boxed(),
        SceneKind::Stack => scattered(stacks()).boxed(),
        SceneKind::Plane => animated(plane()).boxed(),
        SceneKind::Broken => broken().boxed(),
        SceneKind::Few => few().boxed(),
        SceneKind::Gone => gone().boxed(),
        SceneKind::Grown => grown().boxed(),
        SceneKind::Resting => resting().boxed(),
        SceneKind::Sheet => animated(sheets()).boxed(),
        SceneKind::Body => animated(body()).boxed(),
        SceneKind::Zeros => zeros().boxed(),
        SceneKind::Hall => hall().boxed(),
        SceneKind::Outlying => outlying().boxed(),
    }
}

/// Separate triangles, whose second edges are scaled by a power of ten with an exponent in `thin`.
fn moving_soup(count: impl Into<SizeRange>, thin: [f64; 2]) -> impl Strategy<Value = MovingMesh> {
    scattered(soup(count, 0.4, thin).prop_map(|all| meshes::separate(&all)))
}

fn sheets() -> impl Strategy<Value = IndexedMesh> {
    (2..9_u32, select(&[4, 8, 1000][..])).prop_flat_map(|(n, steps)| sheet(n, steps))
}

/// One of [`BODIES`], scaled to unit size.
fn body() -> impl Strategy<Value = IndexedMesh> {
    (0..BODIES.len()).prop_map(|body| {
        let body = BODIES[body];
        let (points, triangles) = (body.shape)();
        let shrunk = |p: Point| p.map(|x| x / body.radius as f32);
        (points.into_iter().map(shrunk).collect(), triangles)
    })
}

/// Offsets in each of three key frames.
fn drift() -> impl Strategy<Value = [Point; KEYS]> + Clone {
    [grid_point(), grid_point()].prop_map(|[second, third]| [[0.0; 3], second, third])
}

/// Maximum number of triangles that move independently.
const DRIFTS: usize = 200;
/// Maximum number of vertices with different shares of the drift.
const SHARES: usize = 300;

/// Animates meshes so that each run of three vertices moves independently.
fn scattered(meshes: impl Strategy<Value = IndexedMesh>) -> impl Strategy<Value = MovingMesh> {
    let all = (meshes, vec(drift(), DRIFTS));
    let moving = all.prop_map(|((points, triangles), drifts)| {
        let key = |k: usize| {
            let vertices = points.iter().enumerate();
            vertices
                .map(|(v, &p)| plus(p, 1.0, drifts[v / 3 % DRIFTS][k]))
                .collect()
        };
        ((0..KEYS).map(key).collect(), triangles)
    });
    moving.no_shrink()
}

/// Animates meshes. In each key frame, all vertices move in one direction, each by its own share of one distance.
fn animated(meshes: impl Strategy<Value = IndexedMesh>) -> impl Strategy<Value = MovingMesh> {
    let all = (meshes, drift(), vec(0.0_f32..1.0, SHARES));
    let moving = all.prop_map(|((points, triangles), drift, shares)| {
        let key = |by: Point| {
            let points = points.iter().zip(shares.iter().cycle());
            points.map(|(&p, &share)| plus(p, share, by)).collect()
        };
        (drift.map(key).to_vec(), triangles)
    });
    moving.no_shrink()
}

/// A special vertex or triangle of a scene. `vertex` and `other` select vertices, modulo their number.
#[derive(Clone, Debug)]
struct Oddity {
    kind: usize,
    vertex: u32,
    other: u32,
    key: usize,
    axis: usize,
    /// Random: true for one oddity in three. [`resting`] makes vertices not finite only where it is true.
    is_rare: bool,
}

/// Lists of `count` oddities, whose kinds rotate. Shrinking removes oddities.
fn oddities(count: usize) -> impl Strategy<Value = Vec<Oddity>> {
    let numbers = || {
        let all = (any::<[u32; 2]>(), 0..KEYS, 0..3_usize, 0..3_u8);
        all.no_shrink()
    };
    let one = move |kind| {
        numbers().prop_map(move |([vertex, other], key, axis, chance)| Oddity {
            kind,
            vertex,
            other,
            key,
            axis,
            is_rare: chance == 0,
        })
    };
    shrinking_list((0..count).map(one))
}

/// Makes some vertices not finite in one or all key frames, and adds triangles of no area.
fn broken() -> impl Strategy<Value = MovingMesh> {
    (moving_soup(2..40, UNSHORTENED_EDGE), oddities(12)).prop_map(
        |((mut keys, mut triangles), oddities)| {
            let vertices = keys[0].len();
            for odd in oddities {
                let vertex = odd.vertex as usize % vertices;
                match odd.kind % 4 {
                    0 => keys[odd.key][vertex][odd.axis] = f32::NAN,
                    1 => keys.iter_mut().for_each(|k| k[vertex] = [f32::INFINITY; 3]),
                    2 => triangles.push([vertex as u32; 3]),
                    _ => {
                        let other = (vertex as u32 + 1) % vertices as u32;
                        triangles.push([vertex as u32, other, vertex as u32]);
                    }
                }
            }
            (keys, triangles)
        },
    )
}

/// At most two separate triangles. There are always six vertices.
fn few() -> impl Strategy<Value = MovingMesh> {
    (moving_soup(2, UNSHORTENED_EDGE), 0..3_usize).prop_map(|((keys, mut triangles), count)| {
        triangles.truncate(count);
        (keys, triangles)
    })
}

/// Makes all vertices not finite in at least one key frame.
fn gone() -> impl Strategy<Value = MovingMesh> {
    (moving_soup(1..20, UNSHORTENED_EDGE), 1..8_u32).prop_map(|((mut keys, triangles), which)| {
        for (i, key) in keys.iter_mut().enumerate() {
            if which >> i & 1 == 1 {
                let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i];
                key.iter_mut().for_each(|p| p[i] = odd);
            }
        }
        (keys, triangles)
    })
}

/// Multiplies each key frame by a power of two.
fn grown() -> impl Strategy<Value = MovingMesh> {
    let exponents = uniform3(-35..=20);
    (moving_soup(1..40, UNSHORTENED_EDGE), exponents).prop_map(
        |((mut keys, triangles), exponents)| {
            for (key, exponent) in keys.iter_mut().zip(exponents) {
                let by = 2.0_f32.powi(exponent);
                key.iter_mut().flatten().for_each(|x| *x *= by);
            }
            (keys, triangles)
        },
    )
}

/// Makes all triangles static except the first ones, at most three sixteenths of all.
///
/// Static triangles keep the positions of the first key frame. Some static vertices get special values, and some
/// triangles are degenerate.
fn resting() -> impl Strategy<Value = MovingMesh> {
    let all = (
        moving_soup(8..200, UNSHORTENED_EDGE),
        0..4_usize,
        oddities(16),
    );
    all.prop_map(|((mut keys, mut triangles), share, oddities)| {
        let moving = triangles.len() * share / 16;
        let still = 3 * moving..keys[0].len();
        let (first, later) = keys.split_at_mut(1);
        for key in later {
            key[still.clone()].copy_from_slice(&first[0][still.clone()]);
        }
        for odd in oddities {
            let vertex = within(&still, odd.vertex);
            let (axis, rare) = (odd.kind % 3, odd.is_rare);
            let all = keys.iter_mut().map(|key| &mut key[vertex]);
            match odd.kind % 8 {
                // Interpolation makes this zero positive.
                0 => all.for_each(|p| p[axis] = -0.0),
                1 => all.for_each(|p| p[axis] = 0.0),
                2 if rare => all.for_each(|p| p[axis] = f32::NAN),
                3 if rare => all.for_each(|p| *p = [f32::INFINITY; 3]),
                4 => triangles.push([vertex as u32; 3]),
                5 => triangles.push([odd.other % 3, vertex as u32, vertex as u32 / 2]),
                _ => {}
            }
        }
        (keys, triangles)
    })
}

/// Returns the index in `range` that `number` selects, modulo its length.
fn within(range: &Range<usize>, number: u32) -> usize {
    range.start + number as usize % range.len()
}

/// A static sheet, a small body that moves near it, and triangles of no area.
fn hall() -> impl Strategy<Value = MovingMesh> {
    let floor = (18..34_u32).prop_flat_map(|n| sheet(n, 8)).no_shrink();
    let small = (0..2_u32).prop_map(|n| {
        let (points, faces) = icosphere(n);
        let small = |p: &Point| p.map(|x| 0.1 * x + 0.3);
        (points.iter().map(small).collect(), faces)
    });
    let all = (floor, animated(small), oddities(6));
    all.prop_map(|((floor, mut triangles), (mut keys, faces), oddities)| {
        let before = floor.len() as u32;
        for key in &mut keys {
            key.splice(0..0, floor.iter().copied());
        }
        triangles.extend(faces.iter().map(|t| t.map(|v| before + v)));
        for odd in oddities {
            let (a, b) = (odd.vertex % keys[0].len() as u32, odd.other % before);
            triangles.push([a, b, a]);
        }
        (keys, triangles)
    })
}

/// In some key frames, multiplies some vertices by a power of two between `2^-128` and `2^126`.
fn outlying() -> impl Strategy<Value = MovingMesh> {
    let scene = prop_oneof![
        moving_soup(40, UNSHORTENED_EDGE),
        animated(Just(icosphere(1))),
        animated(sheet(4, 8)),
    ];
    let exponent = prop_oneof![3 => 10..=126, 1 => -128..=-10];
    let all = (scene, exponent, any::<u32>(), any::<bool>(), 1..8_u32);
    let all = all.no_shrink();
    all.prop_map(
        |((mut keys, triangles), exponent, triangle, is_whole, when)| {
            let corners = triangles[triangle as usize % triangles.len()];
            let far = &corners[..if is_whole { 3 } else { 1 }];
            // In single precision, `2^-128` may become 0 here: `powi` computes it as `1 / 2^128`, which overflows.
            let by = 2.0_f64.powi(exponent);
            let scaled = |x: f32| (f64::from(x) * by) as f32;
            let keys_then = keys.iter_mut().enumerate();
            for (_, key) in keys_then.filter(|(k, _)| when >> k & 1 == 1) {
                for &vertex in far {
                    key[vertex as usize] = key[vertex as usize].map(scaled);
                }
            }
            (keys, triangles)
        },
    )
}

/// Coordinates of [`SceneKind::Zeros`].
const NUMBERS: &[f32] = &[0.0, -0.0, 0.0, -0.0, 1.0, -1.0, 1e-30, -1e-18, 1e-12];

fn zeros() -> impl Strategy<Value = MovingMesh> {
    let all = (1..30_usize).prop_flat_map(|n| vec(meshes::of_numbers(NUMBERS, n), KEYS));
    let all = all.prop_map(|keys| {
        let triangles = meshes::apart(keys[0].len());
        (keys.iter().map(|key| key.concat()).collect(), triangles)
    });
    all.no_shrink()
}
