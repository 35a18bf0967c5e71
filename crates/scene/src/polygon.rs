//! Triangulation of polygons into n - 2 triangles per polygon of n vertices, in the order of the faces.
//!
//! A polygon becomes the fan from its first vertex if that fan contains no flipped triangle. Convex polygons always
//! become fans. So do polygons without area and polygons with more than [`MAX_CLIPPED`] vertices. All others are
//! triangulated by ear clipping in their plane. Both methods keep the polygon's orientation.

use crate::mesh::Polygons;
use crate::paging::reserve;
use crate::rounding::Position;
use earcut::Earcut;

/// Maximum number of vertices for ear clipping, whose time is up to quadratic.
const MAX_CLIPPED: usize = 1 << 15;

/// Triangles of all faces.
#[derive(Debug, Default)]
pub(crate) struct Triangulation {
    /// Vertex indices of each triangle.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Number of concave polygons that became fans because they have more than [`MAX_CLIPPED`] vertices.
    pub(crate) fanned: usize,
}

/// Triangulates all polygons with vertex positions `points`. Returns an error if there is too little memory.
pub(crate) fn triangulate(
    polygons: &Polygons,
    points: &[Position],
) -> Result<Triangulation, String> {
    let mut clipper = Clipper {
        points,
        earcut: Earcut::new(),
        flat: Vec::new(),
        indices: Vec::new(),
        ears: Vec::new(),
    };
    let mut found = Triangulation::default();
    reserve(&mut found.triangles, polygons.triangle_count())?;
    for corners in polygons.faces() {
        match corners {
            &[a, b, c] => found.triangles.push([a, b, c]),
            _ => clipper.polygon(corners, &mut found)?,
        }
    }
    Ok(found)
}

/// Buffers that are reused for all polygons.
struct Clipper<'a> {
    points: &'a [Position],
    earcut: Earcut<f64>,
    /// The polygon's vertices projected to a plane, counter-clockwise.
    flat: Vec<[f64; 2]>,
    indices: Vec<u32>,
    /// Triangles from ear clipping. Corners are indices into the polygon in ascending order.
    ears: Vec<[u32; 3]>,
}

impl Clipper<'_> {
    fn polygon(&mut self, corners: &[u32], found: &mut Triangulation) -> Result<(), String> {
        self.flat.clear();
        reserve(&mut self.flat, corners.len())?;
        let is_fan = !self.flatten(corners) || self.is_covered_by_fan();
        let is_large = corners.len() > MAX_CLIPPED;
        if is_fan || is_large {
            found.fanned += usize::from(!is_fan);
            let rim = corners[1..].windows(2);
            let fan = rim.map(|edge| [corners[0], edge[0], edge[1]]);
            found.triangles.extend(fan);
            return Ok(());
        }
        self.clip();
        let corner = |place: u32| corners[place as usize];
        complete(&self.ears, corners.len(), |places| {
            found.triangles.push(places.map(corner));
        });
        Ok(())
    }

    /// Projects a polygon along the axis of the largest component of its normal. The normal is the sum of cross
    /// products over the fan, as in Newell's method. The projection is an affine map of the polygon's plane, so it
    /// preserves inside and outside. It drops one coordinate and does not round the others.
    ///
    /// Returns `false` if the normal is not finite or the projected area is 0.
    fn flatten(&mut self, corners: &[u32]) -> bool {
        let point = |&vertex: &u32| self.points[vertex as usize];
        let first = point(&corners[0]);
        let from_first = |p: [f64; 3]| [0, 1, 2].map(|axis| p[axis] - first[axis]);
        let mut normal = [0.0; 3];
        let mut a = [0.0; 3];
        for b in corners[1..].iter().map(point).map(from_first) {
            normal[0] += a[1] * b[2] - a[2] * b[1];
            normal[1] += a[2] * b[0] - a[0] * b[2];
            normal[2] += a[0] * b[1] - a[1] * b[0];
            a = b;
        }
        let size = normal.map(f64::abs);
        let axis = match size {
            [x, y, z] if x >= y && x >= z => 0,
            [_, y, z] if y >= z => 1,
            _ => 2,
        };
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            (u, v) = (v, u);
        }
        let flat = corners.iter().map(point).map(|p| [p[u], p[v]]);
        self.flat.extend(flat);
        normal.iter().all(|n| n.is_finite()) && size[axis] > 0.0
    }

    /// Returns whether no triangle of the fan from the first vertex is flipped.
    fn is_covered_by_fan(&self) -> bool {
        let [x, y] = self.flat[0];
        let from_first = |p: [f64; 2]| [p[0] - x, p[1] - y];
        self.flat[1..].windows(2).all(|edge| {
            let (a, b) = (from_first(edge[0]), from_first(edge[1]));
            a[0] * b[1] >= a[1] * b[0]
        })
    }

    fn clip(&mut self) {
        let flat = self.flat.iter().copied();
        self.earcut.earcut(flat, &[], &mut self.indices);
        let found = self.indices.as_chunks::<3>().0.iter();
        self.ears.clear();
        self.ears.extend(found.map(|&(mut ear)| {
            ear.sort_unstable();
            ear
        }));
        // The order that `complete` expects.
        self.ears.sort_unstable_by_key(|&[a, b, c]| (a, !c, b));
    }
}

/// Emits `vertices - 2` triangles that fill a polygon. Corners are indices into the polygon in ascending order, so each
/// triangle has the polygon's orientation.
///
/// `ears` is sorted by first corner, then by last corner in descending order. Only indices matter here: the vertices
/// count as points on a circle, in order. Of triangles in `ears` that cross on this circle, some are left out.
/// Triangles may also be missing from `ears`: `earcut` omits triangles without area, and a polygon that crosses
/// itself has no triangulation. Fans fill the gaps.
fn complete(ears: &[[u32; 3]], vertices: usize, mut emit: impl FnMut([u32; 3])) {
    let apex = |from: u32, to: u32| {
        let at = ears.partition_point(|&[a, _, c]| (a, !c) < (from, !to));
        let ear = ears.get(at).filter(|ear| (ear[0], ear[2]) == (from, to));
        ear.map(|ear| ear[1])
    };
    // The chord of an ear is its side from the first to the last corner. Returns the end of the longest chord that
    // starts at `from` and ends at `limit` or before, else `from + 1`.
    let reach = |from: u32, limit: u32| {
        let at = ears.partition_point(|&[a, _, c]| (a, !c) < (from, !limit));
        let ear = ears.get(at).filter(|ear| ear[0] == from);
        ear.map_or(from + 1, |ear| ear[2])
    };
    let mut open = vec![[0, vertices as u32 - 1]];
    while let Some([from, to]) = open.pop() {
        if to - from < 2 {
            continue;
        }
        if let Some(apex) = apex(from, to) {
            emit([from, apex, to]);
            open.extend([[apex, to], [from, apex]]);
            continue;
        }
        let mut at = reach(from, to);
        open.push([from, at]);
        while at < to {
            let next = reach(at, to);
            emit([from, at, next]);
            open.push([at, next]);
            at = next;
        }
    }
}

#[cfg(test)]
mod tests;
