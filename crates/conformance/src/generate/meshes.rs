//! Points and triangles of about unit size.

use fastrand::Rng;
use geom::{Point, Triangle};
use std::collections::BTreeMap;

/// Vertices, and three vertex indices per triangle.
pub(crate) type Mesh = (Vec<Point>, Vec<[u32; 3]>);

/// Returns a number in `-1..1`.
pub(crate) fn unit(rng: &mut Rng) -> f64 {
    2.0 * rng.f64() - 1.0
}

/// Returns a point in the cube `-1..1`.
pub(crate) fn point(rng: &mut Rng) -> [f64; 3] {
    [(); 3].map(|()| unit(rng))
}

/// Returns a power of ten with a random exponent between `low` and `high`.
pub(crate) fn power([low, high]: [f64; 2], rng: &mut Rng) -> f64 {
    10.0_f64.powf(low + (high - low) * rng.f64())
}

/// Returns `a + s * b`, rounded once to single precision.
pub(crate) fn along(a: [f64; 3], s: f64, b: [f64; 3]) -> Point {
    std::array::from_fn(|i| (a[i] + s * b[i]) as f32)
}

/// Returns `a + s * b` in single precision.
pub(crate) fn plus(a: Point, s: f32, b: Point) -> Point {
    std::array::from_fn(|i| a[i] + s * b[i])
}

/// Returns `n` separate triangles.
///
/// First edges are up to `size` long along each axis. Second edges are scaled by a random power of ten, with an exponent
/// in `thin`.
pub(crate) fn soup(n: usize, size: f64, thin: [f64; 2], rng: &mut Rng) -> Vec<Triangle> {
    let one = |()| {
        let (corner, e, f) = (point(rng), point(rng), point(rng));
        let thin = power(thin, rng);
        [
            along(corner, 0.0, e),
            along(corner, size, e),
            along(corner, size * thin, f),
        ]
    };
    std::iter::repeat_n((), n).map(one).collect()
}

/// Exponents for second edges about as long as the first.
pub(crate) const PLUMP: [f64; 2] = [0.0, 0.0];

/// Returns a mesh of triangles that share no vertex.
pub(crate) fn separate(triangles: &[Triangle]) -> Mesh {
    (triangles.concat(), apart(triangles.len()))
}

/// Returns the indices of `count` triangles with three vertices of their own.
pub(crate) fn apart(count: usize) -> Vec<[u32; 3]> {
    let all = 0..count as u32;
    all.map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()
}

/// Returns a point moved by `1e3` to `3e38`, along one axis or along all.
pub(crate) fn outlying(p: Point, rng: &mut Rng) -> Point {
    let by = power([3.0, 38.5], rng);
    let axis = rng.usize(..4);
    std::array::from_fn(|i| match axis == 3 || axis == i {
        true => f64::from(p[i]).mul_add(0.1, by * [1.0, -1.0][rng.usize(..2)]) as f32,
        false => p[i],
    })
}

/// Returns a small triangle far away, or a much smaller one at the origin.
pub(crate) fn outlier(rng: &mut Rng) -> Triangle {
    let (size, by) = match rng.usize(..3) {
        0 => (1.0, power([-38.0, -3.0], rng)),
        _ => (1e-3, power([3.0, 38.5], rng)),
    };
    scaled(&soup(1, size, PLUMP, rng), by)[0]
}

/// Multiplies all coordinates, rounding once.
pub(crate) fn scaled(triangles: &[Triangle], by: f64) -> Vec<Triangle> {
    let scale = |x: f32| (f64::from(x) * by) as f32;
    triangles.iter().map(|t| t.map(|p| p.map(scale))).collect()
}

/// Returns a random multiple of `1 / n` in `-1..=1`.
pub(crate) fn grid(n: i32, rng: &mut Rng) -> f32 {
    rng.i32(-n..=n) as f32 / n as f32
}

/// Returns a triangle in a plane perpendicular to `axis`, with its corners on a grid.
pub(crate) fn flat(axis: usize, rng: &mut Rng) -> Triangle {
    let height = grid(4, rng);
    [(); 3].map(|()| {
        let mut p = [(); 3].map(|()| grid(16, rng));
        p[axis] = height;
        p
    })
}

/// Returns flat and free triangles, each with one copy, one rotation of its vertices and one reversal.
pub(crate) fn stacks(rng: &mut Rng) -> Mesh {
    let mut bases: Vec<Triangle> = (0..9).map(|i| flat(i % 3, rng)).collect();
    bases.extend(soup(7, 0.8, PLUMP, rng));
    let (points, triangles) = separate(&bases);
    let again = |&[a, b, c]: &[u32; 3]| [[a, b, c], [a, b, c], [b, c, a], [a, c, b]];
    let mut all: Vec<_> = triangles.iter().flat_map(again).collect();
    rng.shuffle(&mut all);
    (points, all)
}

/// Returns triangles of regular shape, and as many with zero or nearly zero area.
pub(crate) fn flakes(rng: &mut Rng) -> Vec<Triangle> {
    let mut all = soup(32, 0.5, PLUMP, rng);
    for i in 0..32 {
        let [a, b, _] = all[i];
        let [d, g] = [(); 2].map(|()| [(); 3].map(|()| grid(16, rng)));
        let s = rng.f64();
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
    rng.shuffle(&mut all);
    all
}

/// Returns a sheet with dents, `n` quads in each direction. Heights are multiples of a quarter of `1 / steps`.
pub(crate) fn sheet(n: u32, steps: i32, rng: &mut Rng) -> Mesh {
    let at = |i: u32| 2.0 * i as f32 / n as f32 - 1.0;
    let mut points = Vec::new();
    for j in 0..=n {
        points.extend((0..=n).map(|i| [at(i), grid(steps, rng) * 0.25, at(j)]));
    }
    (points, quads(n, n, |i, j| j * (n + 1) + i).concat())
}

/// Returns two triangles per cell of a lattice, whose vertex numbers `at` returns.
pub(crate) fn quads(n: u32, m: u32, at: impl Fn(u32, u32) -> u32) -> Vec<[[u32; 3]; 2]> {
    let cells = (0..m).flat_map(|j| (0..n).map(move |i| (i, j)));
    let quad = |(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    cells.map(quad).collect()
}

/// Splits each triangle into four. `middle` computes the vertex between two others.
pub(crate) fn split((mut points, triangles): Mesh, middle: fn(Point, Point) -> Point) -> Mesh {
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

/// Returns `n` triangles with random coordinates from `numbers`.
pub(crate) fn of_numbers(numbers: &[f32], n: usize, rng: &mut Rng) -> Vec<Triangle> {
    let mut number = || numbers[rng.usize(..numbers.len())];
    let one = |()| [(); 3].map(|()| [(); 3].map(|()| number()));
    std::iter::repeat_n((), n).map(one).collect()
}

/// Returns a grid of quads in one plane, with exact coordinates.
pub(crate) fn plane(rng: &mut Rng) -> Mesh {
    let n = rng.u32(2..17);
    let tilt = [(); 2].map(|()| grid(4, rng));
    let turn = rng.usize(..3);
    let point = |i: u32, j: u32| {
        let [x, y] = [i, j].map(|k| k as f32 / 8.0 - 1.0);
        let p = [x, y, tilt[0] * x + tilt[1] * y];
        [p[turn], p[(turn + 1) % 3], p[(turn + 2) % 3]]
    };
    let points = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
    let at = |i, j| j * (n + 1) + i;
    let mut triangles = Vec::new();
    for [[a, b, c], [_, _, d]] in quads(n, n, at) {
        triangles.extend(match rng.bool() {
            true => [[a, b, c], [a, c, d]],
            false => [[b, d, a], [d, b, c]],
        });
    }
    rng.shuffle(&mut triangles);
    (points.map(|(i, j)| point(i, j)).collect(), triangles)
}
