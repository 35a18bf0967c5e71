//! Points and triangles of about unit size.

use geom::{Point, Triangle};
use proptest::array::uniform3;
use proptest::collection::{SizeRange, vec};
use proptest::prelude::*;
use proptest::sample::select;
use std::collections::BTreeMap;

/// Vertices, and three vertex indices per triangle.
pub(crate) type IndexedMesh = (Vec<Point>, Vec<[u32; 3]>);

/// Numbers in `-1..1`.
pub(crate) fn unit() -> impl Strategy<Value = f64> + Clone {
    -1.0..1.0
}

/// Points in the cube `-1..1`.
pub(crate) fn point() -> impl Strategy<Value = [f64; 3]> + Clone {
    uniform3(unit())
}

/// Powers of ten with an exponent between `low` and `high`.
pub(crate) fn power([low, high]: [f64; 2]) -> impl Strategy<Value = f64> + Clone {
    (0.0..1.0).prop_map(move |x: f64| libm::pow(10.0, low + (high - low) * x))
}

/// Returns `a + s * b`, rounded once to single precision.
pub(crate) fn along(a: [f64; 3], s: f64, b: [f64; 3]) -> Point {
    std::array::from_fn(|i| (a[i] + s * b[i]) as f32)
}

/// Returns `a + s * b` in single precision.
pub(crate) fn plus(a: Point, s: f32, b: Point) -> Point {
    std::array::from_fn(|i| a[i] + s * b[i])
}

/// Triangles whose first edge is up to `size` long along each axis.
///
/// The second edge is scaled by a power of ten, with an exponent in `thin`.
pub(crate) fn random_triangle(
    size: f64,
    thin: [f64; 2],
) -> impl Strategy<Value = Triangle> + Clone {
    let edges = (uniform3(point()), power(thin));
    edges.prop_map(move |([corner, e, f], thin)| {
        [
            along(corner, 0.0, e),
            along(corner, size, e),
            along(corner, size * thin, f),
        ]
    })
}

/// Lists of separate triangles: see [`random_triangle`].
pub(crate) fn soup(
    count: impl Into<SizeRange>,
    size: f64,
    thin: [f64; 2],
) -> impl Strategy<Value = Vec<Triangle>> + Clone {
    vec(random_triangle(size, thin), count)
}

/// Exponents that leave the second edge about as long as the first.
pub(crate) const UNSHORTENED_EDGE: [f64; 2] = [0.0, 0.0];

/// Returns a mesh of triangles that share no vertex.
pub(crate) fn separate(triangles: &[Triangle]) -> IndexedMesh {
    (triangles.concat(), apart(triangles.len()))
}

/// Returns the vertex indices of `count` triangles that share no vertex.
pub(crate) fn apart(count: usize) -> Vec<[u32; 3]> {
    let all = 0..count as u32;
    all.map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()
}

/// Positions of a point that is moved by `1e3` to `3e38` along one axis or all. A moved coordinate is that distance plus
/// a tenth of the old one.
pub(crate) fn outlying(p: Point) -> impl Strategy<Value = Point> {
    let moves = (power([3.0, 38.5]), 0..4_usize, uniform3(any::<bool>()));
    moves.prop_map(move |(by, axis, signs)| {
        std::array::from_fn(|i| {
            if axis == 3 || axis == i {
                f64::from(p[i]).mul_add(0.1, if signs[i] { by } else { -by }) as f32
            } else {
                p[i]
            }
        })
    })
}

/// Triangles at a great distance, about a thousandth of it in size, and tiny triangles near the origin.
pub(crate) fn outlier() -> impl Strategy<Value = Triangle> {
    let sized = |size, powers| (random_triangle(size, UNSHORTENED_EDGE), power(powers));
    let all = prop_oneof![
        2 => sized(1e-3, [3.0, 38.5]),
        1 => sized(1.0, [-38.0, -3.0]),
    ];
    all.prop_map(|(triangle, by)| scaled(&[triangle], by)[0])
}

/// Multiplies all coordinates, rounding once.
pub(crate) fn scaled(triangles: &[Triangle], by: f64) -> Vec<Triangle> {
    let scale = |x: f32| (f64::from(x) * by) as f32;
    triangles.iter().map(|t| t.map(|p| p.map(scale))).collect()
}

/// Multiples of `1 / n` in `-1..=1`.
pub(crate) fn grid(n: i32) -> impl Strategy<Value = f32> + Clone {
    (-n..=n).prop_map(move |i| i as f32 / n as f32)
}

/// Triangles in a plane perpendicular to `axis`, with their corners on a grid.
pub(crate) fn flat(axis: usize) -> impl Strategy<Value = Triangle> + Clone {
    let numbers = (grid(4), uniform3(uniform3(grid(16))));
    numbers.prop_map(move |(height, mut corners)| {
        corners.iter_mut().for_each(|p| p[axis] = height);
        corners
    })
}

/// Flat and random triangles, each with one copy, one rotation of its vertices and one reversal.
pub(crate) fn stacks() -> impl Strategy<Value = IndexedMesh> {
    let flats: Vec<_> = (0..9).map(|i| flat(i % 3)).collect();
    let bases = (flats, soup(7, 0.8, UNSHORTENED_EDGE))
        .prop_map(|(flats, others)| [flats, others].concat());
    let all = bases.prop_map(|bases| {
        let (points, triangles) = separate(&bases);
        let again = |&[a, b, c]: &[u32; 3]| [[a, b, c], [a, b, c], [b, c, a], [a, c, b]];
        (points, triangles.iter().flat_map(again).collect())
    });
    shuffled(all)
}

/// Triangles of regular shape, and as many with zero or nearly zero area.
pub(crate) fn flakes() -> impl Strategy<Value = Vec<Triangle>> {
    let lines = vec((uniform3(grid(16)), uniform3(grid(16)), 0.0..1.0), 32);
    let all = (soup(32, 0.5, UNSHORTENED_EDGE), lines).prop_map(|(mut all, lines)| {
        for (i, (d, g, s)) in lines.into_iter().enumerate() {
            let [a, b, _] = all[i];
            all.push(match i % 4 {
                0 => [a, b, a],
                1 => [a; 3],
                // Collinear, because sums of multiples of a sixteenth are exact.
                2 => [0.0, 1.0, 3.0].map(|share| plus(g, share, d)),
                // Collinear except for rounding.
                _ => {
                    let step = std::array::from_fn(|k| f64::from(b[k]) - f64::from(a[k]));
                    [a, b, along(a.map(f64::from), s, step)]
                }
            });
        }
        all
    });
    all.prop_shuffle()
}

/// Uneven sheets of `n` by `n` quads. Heights are multiples of `0.25 / steps`.
pub(crate) fn sheet(n: u32, steps: i32) -> impl Strategy<Value = IndexedMesh> {
    let heights = vec(grid(steps), (n as usize + 1).pow(2));
    heights.prop_map(move |heights| {
        let at = |i: u32| 2.0 * i as f32 / n as f32 - 1.0;
        let lattice = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
        let points = lattice.zip(heights);
        let points = points.map(|((i, j), height)| [at(i), height * 0.25, at(j)]);
        let triangles = quads(n, n, |i, j| j * (n + 1) + i).concat();
        (points.collect(), triangles)
    })
}

/// Returns two triangles for each of `n` by `m` cells of a lattice. `at` returns the vertex index of a lattice point.
pub(crate) fn quads(n: u32, m: u32, at: impl Fn(u32, u32) -> u32) -> Vec<[[u32; 3]; 2]> {
    let cells = (0..m).flat_map(|j| (0..n).map(move |i| (i, j)));
    let quad = |(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    cells.map(quad).collect()
}

/// Splits each triangle into four. `middle` computes the vertex between two others.
pub(crate) fn split(
    (mut points, triangles): IndexedMesh,
    middle: fn(Point, Point) -> Point,
) -> IndexedMesh {
    let mut middles = BTreeMap::new();
    let mut smaller = Vec::new();
    for [a, b, c] in triangles {
        let mut between = |p: u32, q: u32| {
            *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                points.push(middle(points[p as usize], points[q as usize]));
                points.len() as u32 - 1
            })
        };
        let (ab, bc, ca) = (between(a, b), between(b, c), between(c, a));
        smaller.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    (points, smaller)
}

/// Lists of `n` triangles with coordinates from `numbers`.
pub(crate) fn of_numbers(
    numbers: &'static [f32],
    n: usize,
) -> impl Strategy<Value = Vec<Triangle>> {
    vec(uniform3(uniform3(select(numbers))), n)
}

/// Grids of quads in one plane, with exact coordinates.
pub(crate) fn plane() -> impl Strategy<Value = IndexedMesh> {
    let numbers = (
        2..17_u32,
        [grid(4), grid(4)],
        0..3_usize,
        vec(any::<bool>(), 16 * 16),
    );
    let all = numbers.prop_map(|(n, tilt, turn, diagonals)| {
        let point = |i: u32, j: u32| {
            let [x, y] = [i, j].map(|k| k as f32 / 8.0 - 1.0);
            let p = [x, y, tilt[0] * x + tilt[1] * y];
            [p[turn], p[(turn + 1) % 3], p[(turn + 2) % 3]]
        };
        let points = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
        let at = |i, j| j * (n + 1) + i;
        let mut triangles = Vec::new();
        let quads = quads(n, n, at).into_iter().zip(diagonals);
        for ([[a, b, c], [_, _, d]], is_first_diagonal) in quads {
            triangles.extend(if is_first_diagonal {
                [[a, b, c], [a, c, d]]
            } else {
                [[b, d, a], [d, b, c]]
            });
        }
        (points.map(|(i, j)| point(i, j)).collect(), triangles)
    });
    shuffled(all)
}

/// Meshes with their triangles in any order.
fn shuffled(meshes: impl Strategy<Value = IndexedMesh>) -> impl Strategy<Value = IndexedMesh> {
    meshes.prop_flat_map(|(points, triangles)| (Just(points), Just(triangles).prop_shuffle()))
}
