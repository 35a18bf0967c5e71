//! Meshes for the demos: sheets, cubes, balls and bodies of revolution.
//!
//! Closed meshes share vertices between triangles and face outward (counter-clockwise seen from outside).

use glam::{DVec2, DVec3};

/// Rest positions, and triangles as vertex indices.
#[derive(Clone, Debug, Default)]
pub(super) struct DemoMesh {
    pub(super) points: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl DemoMesh {
    pub(super) fn map(mut self, at: impl Fn(DVec3) -> DVec3) -> Self {
        for p in &mut self.points {
            *p = at(*p);
        }
        self
    }

    pub(super) fn middle(&self, triangle: [u32; 3]) -> DVec3 {
        let [a, b, c] = triangle.map(|v| self.points[v as usize]);
        (a + b + c) / 3.0
    }

    /// Adds a piece. Its triangles index its own `points`, counted from 0.
    pub(super) fn add(
        &mut self,
        points: impl IntoIterator<Item = DVec3>,
        triangles: impl IntoIterator<Item = [u32; 3]>,
    ) {
        let first = self.points.len() as u32;
        self.points.extend(points);
        let placed = triangles.into_iter().map(|t| t.map(|v| v + first));
        self.triangles.extend(placed);
    }

    fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }
}

/// Creates an open sheet of `2 * columns * rows` triangles over the unit square. If `at` maps (u, v) to (x, z), the
/// sheet faces up.
pub(super) fn sheet([columns, rows]: [u32; 2], at: impl Fn(f64, f64) -> DVec3) -> DemoMesh {
    let mut mesh = DemoMesh::default();
    for j in 0..=rows {
        for i in 0..=columns {
            let share = |i: u32, of: u32| f64::from(i) / f64::from(of);
            mesh.points.push(at(share(i, columns), share(j, rows)));
        }
    }
    let index = |i, j| j * (columns + 1) + i;
    for j in 0..rows {
        for i in 0..columns {
            let corners = [(0, 0), (0, 1), (1, 1), (1, 0)];
            mesh.quad(corners.map(|(a, b)| index(i + a, j + b)));
        }
    }
    mesh
}

/// Returns the columns and rows of a sheet with about `budget` triangles and an aspect ratio of `aspect` to 1.
pub(super) fn sheet_size(budget: usize, aspect: f64) -> [u32; 2] {
    let quads = (budget / 2).max(1) as f64;
    let rows = libm::round((quads / aspect).sqrt()).clamp(1.0, quads);
    let columns = libm::round(quads / rows).max(1.0);
    [columns as u32, rows as u32]
}

/// Creates the closed surface of the cube `[-1, 1]^3` with `cuts` by `cuts` squares per side: `12 * cuts^2` triangles.
pub(super) fn cube(cuts: u32) -> DemoMesh {
    let mut mesh = DemoMesh::default();
    let at = |i: u32| f64::from(i) / f64::from(cuts) * 2.0 - 1.0;
    for k in 0..=cuts {
        for (i, j) in layer(cuts, k) {
            mesh.points.push(DVec3::new(at(i), at(j), at(k)));
        }
    }
    for axis in 0..3 {
        for j in 0..cuts {
            for i in 0..cuts {
                let corner = |side: u32, di: u32, dj: u32| {
                    let mut cell = [0; 3];
                    cell[axis] = side;
                    cell[(axis + 1) % 3] = i + di;
                    cell[(axis + 2) % 3] = j + dj;
                    surface_index(cuts, cell)
                };
                let far = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| corner(cuts, a, b));
                let near = [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(a, b)| corner(0, a, b));
                mesh.quad(far);
                mesh.quad(near);
            }
        }
    }
    mesh
}

/// Returns the points of the cube's surface in layer `k`: a full square in the first and last layer, else its rim.
fn layer(cuts: u32, k: u32) -> Vec<(u32, u32)> {
    if k == 0 || k == cuts {
        let row = |j| (0..=cuts).map(move |i| (i, j));
        return (0..=cuts).flat_map(row).collect();
    }
    let rim = 0..cuts;
    let south = rim.clone().map(|s| (s, 0));
    let east = rim.clone().map(|s| (cuts, s));
    let north = rim.clone().map(|s| (cuts - s, cuts));
    let west = rim.map(|s| (0, cuts - s));
    south.chain(east).chain(north).chain(west).collect()
}

/// Returns the index of a point in the order of [`layer`].
fn surface_index(cuts: u32, [i, j, k]: [u32; 3]) -> u32 {
    let square = (cuts + 1) * (cuts + 1);
    if k == 0 {
        return j * (cuts + 1) + i;
    }
    let below = square + (k - 1) * 4 * cuts;
    if k == cuts {
        return below + j * (cuts + 1) + i;
    }
    below
        + match (i, j) {
            (i, 0) if i < cuts => i,
            (i, j) if i == cuts && j < cuts => cuts + j,
            (i, j) if j == cuts && i > 0 => 2 * cuts + (cuts - i),
            (_, j) => 3 * cuts + (cuts - j),
        }
}

/// Returns the number of squares along a cube's edge for about `budget` triangles.
pub(super) fn cube_cuts(budget: usize) -> u32 {
    (libm::round((budget as f64 / 12.0).sqrt()) as u32).max(1)
}

/// Maps the cube `[-1, 1]^3` to the unit ball and its surface to the sphere.
pub(super) fn onto_ball(p: DVec3) -> DVec3 {
    let length = p.length();
    if length == 0.0 {
        p
    } else {
        p * (p.abs().max_element() / length)
    }
}

/// Creates a closed body of revolution about the y axis with `2 * sides * rings` triangles.
///
/// `profile` maps `0.0..=1.0`, from the upper pole to the lower, to (radius, height). Radii at the poles count as 0.
pub(super) fn revolve([sides, rings]: [u32; 2], profile: impl Fn(f64) -> DVec2) -> DemoMesh {
    let mut mesh = DemoMesh::default();
    mesh.points.push(DVec3::new(0.0, profile(0.0).y, 0.0));
    for ring in 1..=rings {
        let DVec2 { x: radius, y } = profile(f64::from(ring) / f64::from(rings + 1));
        for side in 0..sides {
            let angle = std::f64::consts::TAU * f64::from(side) / f64::from(sides);
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            mesh.points.push(DVec3::new(radius * cos, y, radius * sin));
        }
    }
    let last = mesh.points.len() as u32;
    mesh.points.push(DVec3::new(0.0, profile(1.0).y, 0.0));
    let index = |ring: u32, side: u32| 1 + ring * sides + side % sides;
    for s in 0..sides {
        mesh.triangles.push([0, index(0, s + 1), index(0, s)]);
        for r in 0..rings - 1 {
            let corners = [(0, 0), (0, 1), (1, 1), (1, 0)];
            mesh.quad(corners.map(|(a, b)| index(r + a, s + b)));
        }
        let [a, b] = [s, s + 1].map(|s| index(rings - 1, s));
        mesh.triangles.push([last, a, b]);
    }
    mesh
}

/// Returns the sides and rings of a body of revolution with about `budget` triangles and `aspect` rings per side.
pub(super) fn revolve_size(budget: usize, aspect: f64) -> [u32; 2] {
    let cells = budget as f64 / 2.0;
    let sides = libm::round((cells / aspect).sqrt()).max(3.0);
    let rings = libm::round(cells / sides).max(1.0);
    [sides as u32, rings as u32]
}

/// Creates a capsule along the y axis. Its ends are hemispheres with centres at heights 0 and `-length`, and with
/// separate radii.
pub(super) fn capsule(budget: usize, length: f64, [upper, lower]: [f64; 2]) -> DemoMesh {
    revolve(revolve_size(budget, 1.0), |v| {
        let angle = std::f64::consts::PI * v;
        let (height, reach) = (libm::cos(angle), libm::sin(angle));
        if height >= 0.0 {
            DVec2::new(reach * upper, height * upper)
        } else {
            DVec2::new(reach * lower, height * lower - length)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Returns the signed volume. Asserts that every directed edge occurs once and has one opposite edge.
    fn closed_volume(mesh: &DemoMesh) -> f64 {
        let mut edges = BTreeMap::new();
        for &[a, b, c] in &mesh.triangles {
            for edge in [(a, b), (b, c), (c, a)] {
                *edges.entry(edge).or_insert(0) += 1;
            }
        }
        for (&(a, b), &count) in &edges {
            assert_eq!((count, edges.get(&(b, a))), (1, Some(&1)), "edge {a}-{b}");
        }
        let corner = |v: u32| mesh.points[v as usize];
        let cone = |&[a, b, c]: &[u32; 3]| corner(a).dot(corner(b).cross(corner(c))) / 6.0;
        mesh.triangles.iter().map(cone).sum()
    }

    #[test]
    fn solids_are_closed_and_face_outward() {
        for cuts in [1, 2, 3, 8] {
            let mesh = cube(cuts);
            assert_eq!(mesh.triangles.len(), 12 * (cuts * cuts) as usize);
            assert!((closed_volume(&mesh) - 8.0).abs() < 1e-9);
        }
        let body = capsule(800, 1.0, [0.2, 0.2]);
        assert!((760..=840).contains(&body.triangles.len()));
        let ideal = std::f64::consts::PI * 0.04 * (1.0 + 0.8 / 3.0);
        assert!((closed_volume(&body) / ideal - 1.0).abs() < 0.05);
        assert!(closed_volume(&capsule(6, 1.0, [0.2, 0.2])) > 0.0);
    }
}
