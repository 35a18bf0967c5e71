//! Contents of a mesh file of any format: vertices, faces and colours. Later key frames must have the faces of the
//! first.

use crate::paging::{check_counts, reserve};
use crate::rounding::Position;
use crate::{Location, Result, Rgb, SceneError};
use std::path::Path;

pub(crate) struct PolygonMesh {
    /// Positions of all vertices in the file, used or not.
    pub(crate) points: Vec<Position>,
    /// Faces, which must be equal in all key frames.
    pub(crate) polygons: Polygons,
    pub(crate) paint: Paint,
    pub(crate) notes: Vec<String>,
}

/// Faces with vertices as numbered in the file. Faces with fewer than three vertices are dropped.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Polygons {
    /// Number of vertices in the file, used or not.
    pub(crate) vertices: usize,
    /// Concatenated vertex indices of all faces, counted from 0.
    corners: Vec<u32>,
    /// Index in `corners` after the last corner of each face.
    ends: Vec<usize>,
}

/// Colours of a mesh file, as the file specifies them.
pub(crate) enum Paint {
    None,
    /// One sRGB colour per vertex of the file.
    Vertices(Vec<Rgb>),
    /// One sRGB colour per face.
    Faces(Vec<Rgb>),
    Materials(Materials),
}

/// Names of the materials of a file, and of the libraries that define them.
#[derive(Default)]
pub(crate) struct Materials {
    pub(crate) libraries: Vec<String>,
    /// One item per change of material.
    pub(crate) uses: Vec<MaterialUse>,
}

/// Material of all faces from `first_face` up to the next use.
#[derive(Debug, PartialEq)]
pub(crate) struct MaterialUse {
    pub(crate) first_face: usize,
    pub(crate) name: String,
}

impl Polygons {
    /// Adds a face of at least three vertices.
    pub(crate) fn push(&mut self, corners: &[u32]) -> Result<(), String> {
        reserve(&mut self.corners, corners.len())?;
        self.corners.extend_from_slice(corners);
        append(&mut self.ends, self.corners.len())
    }

    pub(crate) fn faces(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| &self.corners[start..end])
    }

    /// Expands one value per face to one value per triangle. A face of n vertices has n - 2 triangles.
    pub(crate) fn per_triangle<T: Copy>(&self, of_faces: &[T]) -> Vec<T> {
        let faces = self.faces().zip(of_faces);
        let repeated = faces.map(|(corners, &value)| std::iter::repeat_n(value, corners.len() - 2));
        repeated.flatten().collect()
    }

    pub(crate) fn triangle_count(&self) -> usize {
        self.corners.len() - 2 * self.ends.len()
    }

    /// Checks that there is at least one triangle, and not too many vertices or triangles.
    pub(crate) fn check(&self, path: &Path) -> Result<()> {
        let hint = match self.vertices {
            0 => String::new(),
            n => format!(", though there are {n} vertices"),
        };
        check_counts(path, [self.vertices, self.triangle_count()], &hint)
    }

    /// Checks that a key frame, read from `path`, has the topology `expected` of the first one, read from `first`.
    pub(crate) fn check_same(&self, path: &Path, first: &Path, expected: &Self) -> Result<()> {
        let first = first.display();
        let bad = |cause: String| {
            let cause = format!("{cause}; all key frames must have the same topology");
            Err(SceneError::unusable(path, cause))
        };
        let triangles = [self, expected].map(Self::triangle_count);
        for (what, [found, wanted]) in [
            ("triangles", triangles),
            ("vertices", [self.vertices, expected.vertices]),
        ] {
            if found != wanted {
                return bad(format!("{found} {what}, but {first} has {wanted}"));
            }
        }
        if self == expected {
            return Ok(());
        }
        let same = self.faces().zip(expected.faces());
        let face = same.take_while(|(a, b)| a == b).count();
        bad(format!("face {face} joins other vertices than in {first}"))
    }
}

/// Adds an element to a list. Returns an error if there is too little memory.
pub(crate) fn append<T>(list: &mut Vec<T>, element: T) -> Result<(), String> {
    reserve(list, 1)?;
    list.push(element);
    Ok(())
}

/// Concatenates the triangles of several meshes, and offsets their indices to match concatenated vertices. A mesh is
/// given by its triangles and its number of vertices. Errors name `place`.
pub(crate) fn joined_triangles<'a>(
    place: impl AsRef<Path>,
    meshes: impl Iterator<Item = (&'a [[u32; 3]], usize)>,
) -> Result<Vec<[u32; 3]>> {
    let mut all = Vec::new();
    let mut first = 0;
    for (triangles, vertices) in meshes {
        reserve(&mut all, triangles.len()).map_err(|e| SceneError::unusable(&place, e))?;
        all.extend(triangles.iter().map(|t| t.map(|v| v + first)));
        first += vertices as u32;
    }
    Ok(all)
}

/// Renumbers the triangles to use consecutive vertices, and returns the used vertices in ascending order.
///
/// Unused vertices would distort cameras that are computed from the scene's bounds.
pub(crate) fn renumber_used_vertices(triangles: &mut [[u32; 3]], vertices: usize) -> Vec<u32> {
    let mut used = vec![false; vertices];
    let corners = triangles.as_flattened_mut();
    corners.iter().for_each(|&v| used[v as usize] = true);
    let kept: Vec<u32> = (0..vertices as u32).filter(|&v| used[v as usize]).collect();
    if kept.len() < vertices {
        let mut places = vec![0; vertices];
        for (&v, place) in kept.iter().zip(0..) {
            places[v as usize] = place;
        }
        corners.iter_mut().for_each(|v| *v = places[*v as usize]);
    }
    kept
}

/// Default colour of meshes without colours.
pub(crate) const CLAY: Rgb = [204, 196, 184];

/// Converts sRGB components from floats. Values outside 0 to 1 are clamped; NaN becomes 0.
pub(crate) fn srgb_bytes(colour: [f32; 3]) -> Rgb {
    colour.map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

/// Items that were skipped, such as faces of fewer than three vertices.
#[derive(Clone, Copy, Default)]
pub(crate) struct Skipped {
    pub(crate) count: usize,
    first: Option<Location>,
    pub(crate) last: Option<Location>,
}

impl Skipped {
    pub(crate) fn add(&mut self, location: Location) {
        self.count += 1;
        self.first.get_or_insert(location);
        self.last = Some(location);
    }

    /// Returns a remark, if anything was skipped. `what` names the items.
    pub(crate) fn note(&self, path: &Path, what: &str) -> Option<String> {
        let (file, count) = (path.display(), self.count);
        let (kind, at) = self.first?;
        Some(format!(
            "{file}: skipped {count} {what}, the first in {kind} {at}"
        ))
    }
}

/// Description of faces that are skipped.
pub(crate) const SHORT_FACES: &str = "faces of fewer than 3 vertices";

/// Converts the colours of a file to bytes. The caller has already divided integer components of PLY by 255. All other
/// components are as in the file. If a finite component exceeds `MAX_ONE`, all colours are read as 0 to 255, and a
/// remark is added. Otherwise they are read as 0 to 1.
pub(crate) fn to_srgb(colours: &[[f32; 3]], path: &Path, notes: &mut Vec<String>) -> Vec<Rgb> {
    /// Largest component that counts as 1, because rounding can leave white slightly above 1.
    const MAX_ONE: f32 = 1.01;
    let is_above_one = |c: &f32| *c > MAX_ONE && c.is_finite();
    let mut scale = 1.0;
    if colours.as_flattened().iter().any(is_above_one) {
        scale = 255.0;
        let file = path.display();
        notes.push(format!(
            "{file}: a colour component exceeds 1, so all colours of the file are read as 0 to 255"
        ));
    }
    let scaled = colours.iter().map(|colour| colour.map(|c| c / scale));
    scaled.map(srgb_bytes).collect()
}

/// Converts linear components to sRGB (IEC 61966-2-1).
pub(crate) fn from_linear(colour: [f32; 3]) -> Rgb {
    srgb_bytes(colour.map(|c| {
        let c = f64::from(c.clamp(0.0, 1.0));
        let encoded = if c <= 0.003_130_8 {
            12.92 * c
        } else {
            1.055 * libm::pow(c, 1.0 / 2.4) - 0.055
        };
        encoded as f32
    }))
}

pub(crate) fn mean(colours: [Rgb; 3]) -> Rgb {
    std::array::from_fn(|i| (colours.iter().map(|c| u32::from(c[i])).sum::<u32>() / 3) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_light_is_encoded_as_srgb() {
        assert_eq!(from_linear([0.0, 1.0, 0.214_041_14]), [0, 255, 128]);
        assert_eq!(from_linear([0.003, 0.002, 0.01]), [10, 7, 25]);
        assert_eq!(from_linear([f32::NAN, -1.0, 7.0]), [0, 0, 255]);
    }
}
