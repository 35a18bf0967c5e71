//! Points and triangles of about unit size.

use geom::Point;
use std::collections::BTreeMap;

/// Vertices, and three of them a triangle.
pub(crate) type Shape = (Vec<Point>, Vec<[u32; 3]>);

/// A sheet with dents, `n` quads each way.
pub(crate) fn sheet(n: usize) -> Shape {
    let at = |i: usize| i as f32 / n as f32 * 2.0 - 1.0;
    let height = |i: usize, j: usize| ((i * 7 + j * 13) % 5) as f32 * 0.05;
    let points = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| [at(i), height(i, j), at(j)]))
        .collect();
    let quad = |i: u32, j: u32| {
        let w = n as u32 + 1;
        let a = j * w + i;
        [[a, a + 1, a + w + 1], [a, a + w + 1, a + w]]
    };
    let triangles = (0..n as u32)
        .flat_map(|j| (0..n as u32).flat_map(move |i| quad(i, j)))
        .collect();
    (points, triangles)
}

/// An octahedron, its faces split `n` times.
pub(crate) fn octahedron(n: u32) -> Shape {
    let axis = |i: usize, x: f32| std::array::from_fn(|k| if k == i { x } else { 0.0 });
    let points = (0..3).flat_map(|i| [axis(i, 1.0), axis(i, -1.0)]).collect();
    let triangles = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    (0..n).fold((points, triangles), |shape, _| {
        split(shape, |a, b| std::array::from_fn(|i| (a[i] + b[i]) * 0.53))
    })
}

/// Splits each triangle in four; `middle` places the vertex between two.
pub(crate) fn split((mut points, triangles): Shape, middle: fn(Point, Point) -> Point) -> Shape {
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
