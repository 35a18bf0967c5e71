//! One mesh file of any format: vertices, faces and colours, and how it is compared with the next key frame.

use crate::ply::Pattern;
use crate::rounding::Position;
use crate::stream::check_counts;
use crate::{Location, Result, Rgb, SceneError};
use std::path::Path;

pub(crate) struct Mesh {
    /// Positions of the file's vertices, used or not.
    pub(crate) points: Vec<Position>,
    /// The faces, on which key frames must agree.
    pub(crate) topology: Topology,
    pub(crate) paint: Paint,
    pub(crate) notes: Vec<String>,
    /// Bytes that later key frames repeat, if they can be compared without being parsed.
    pub(crate) pattern: Option<Pattern>,
}

/// Vertices and faces as the file numbers them, without faces of fewer than three vertices.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Topology {
    /// Vertices in the file, used or not.
    pub(crate) vertices: usize,
    /// Vertices of all faces, from 0, one face after another.
    corners: Vec<u32>,
    /// Where each face ends in `corners`.
    ends: Vec<usize>,
}

/// What a file says about colours.
pub(crate) enum Paint {
    None,
    /// One sRGB colour for each of the file's vertices.
    Vertices(Vec<Rgb>),
    /// One sRGB colour for each face.
    Faces(Vec<Rgb>),
    /// Materials by name, from libraries beside the file.
    Materials {
        libraries: Vec<String>,
        /// (First face, name) wherever the material changes.
        uses: Vec<(usize, String)>,
    },
}

impl Topology {
    /// Adds a face of three or more vertices.
    pub(crate) fn push(&mut self, corners: impl IntoIterator<Item = u32>) {
        self.corners.extend(corners);
        self.ends.push(self.corners.len());
    }

    pub(crate) fn faces(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| &self.corners[start..end])
    }

    /// Returns one value for each triangle from one for each face, since a face of n vertices has n - 2 triangles.
    pub(crate) fn per_triangle<T: Copy>(&self, of_faces: &[T]) -> Vec<T> {
        let faces = self.faces().zip(of_faces);
        let repeated = faces.map(|(corners, &value)| std::iter::repeat_n(value, corners.len() - 2));
        repeated.flatten().collect()
    }

    pub(crate) fn triangle_count(&self) -> usize {
        self.corners.len() - 2 * self.ends.len()
    }

    /// Checks that everything can be numbered and that there is a triangle.
    pub(crate) fn check(&self, path: &Path) -> Result<()> {
        let hint = match self.vertices {
            0 => String::new(),
            n => format!(", though there are {n} vertices"),
        };
        check_counts(path, [self.vertices, self.triangle_count()], &hint)
    }

    /// Checks that the key frame in `path` has the topology of the `first`.
    pub(crate) fn check_same(&self, path: &Path, first: (&Path, &Self)) -> Result<()> {
        let (first, expected) = (first.0.display(), first.1);
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
        let face = same.take_while(|(a, b)| a == b).count() + 1;
        bad(format!("face {face} joins other vertices than in {first}"))
    }
}

/// The triangles of several meshes, each with the number of its vertices, over the vertices of all.
pub(crate) fn joined_triangles<'a>(
    meshes: impl Iterator<Item = (&'a [[u32; 3]], usize)>,
) -> Vec<[u32; 3]> {
    let mut all = Vec::new();
    let mut first = 0;
    for (triangles, vertices) in meshes {
        all.extend(triangles.iter().map(|t| t.map(|v| v + first)));
        first += vertices as u32;
    }
    all
}

/// Renumbers triangles over the vertices they use, and returns these vertices in their order.
///
/// Unused vertices would spoil every camera that is made from the scene's bounds.
pub(crate) fn compact(triangles: &mut [[u32; 3]], vertices: usize) -> Vec<u32> {
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

/// Of what has no colour.
pub(crate) const CLAY: Rgb = [204, 196, 184];

/// From components that are already meant for display; out of range or not a number is clamped.
pub(crate) fn from_display(colour: [f32; 3]) -> Rgb {
    colour.map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

/// Returns the remark on faces that are not read because they have fewer than three vertices.
pub(crate) fn short_faces_note(path: &Path, count: usize, first: Location) -> Option<String> {
    let (file, (what, at)) = (path.display(), first);
    let note =
        format!("{file}: skipped {count} faces of fewer than 3 vertices, the first in {what} {at}");
    (count > 0).then_some(note)
}

/// Colours as a file has them, one after another.
#[derive(Default)]
pub(crate) struct Colours(Vec<[f32; 3]>);

impl Colours {
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    pub(crate) fn push(&mut self, colour: [f32; 3]) {
        self.0.push(colour);
    }

    /// Converts all colours. If a component is above 1, they range to 255, which adds a remark.
    pub(crate) fn into_display(self, path: &Path, notes: &mut Vec<String>) -> Vec<Rgb> {
        /// Rounding leaves components of white slightly above 1.
        const MAX_ONE: f32 = 1.01;
        let is_above_one = |c: &f32| *c > MAX_ONE && c.is_finite();
        let mut scale = 1.0;
        if self.0.as_flattened().iter().any(is_above_one) {
            scale = 255.0;
            let file = path.display();
            notes.push(format!(
                "{file}: colours above 1 are read as 0 to 255, like all colours of the file"
            ));
        }
        let colours = self.0.into_iter();
        colours
            .map(|c| from_display(c.map(|c| c / scale)))
            .collect()
    }
}

/// From linear light (IEC 61966-2-1).
pub(crate) fn from_linear(colour: [f32; 3]) -> Rgb {
    from_display(colour.map(|c| {
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
