//! Double-precision coordinates, and their rounding to the single precision of key frames.

use crate::SceneOptions;
use geom::Point;
use std::path::Path;

/// Position in double precision, before rounding.
pub(crate) type Position = [f64; 3];

/// Subtracts one offset from all key frames of a scene and rounds the differences.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rounding {
    pub(crate) offset: Position,
}

/// Returns the minimum and the maximum of the positions that are finite in single precision.
fn finite_bounds(points: impl Iterator<Item = Position>) -> Option<[Position; 2]> {
    let is_finite = |p: &Position| p.iter().all(|x| (*x as f32).is_finite());
    let boxes = points.filter(is_finite).map(|p| [p; 2]);
    boxes.reduce(|[min, max], [p, _]| {
        [
            std::array::from_fn(|i| min[i].min(p[i])),
            std::array::from_fn(|i| max[i].max(p[i])),
        ]
    })
}

impl Rounding {
    /// Returns the rounding for a scene: its offset is the centre of the first key frame if the scene is recentred,
    /// else 0.
    pub(crate) fn of(first: &[Position], options: &SceneOptions) -> Self {
        let bounds = finite_bounds(first.iter().copied()).filter(|_| options.recentre);
        let centre = |[min, max]: [Position; 2]| std::array::from_fn(|i| min[i].midpoint(max[i]));
        Self {
            offset: bounds.map(centre).unwrap_or_default(),
        }
    }

    pub(crate) fn point(&self, p: Position) -> Point {
        std::array::from_fn(|i| (p[i] - self.offset[i]) as f32)
    }

    pub(crate) fn points(&self, all: &[Position]) -> Vec<Point> {
        all.iter().map(|&p| self.point(p)).collect()
    }

    /// Returns the offset, or `None` if the scene is not recentred.
    pub(crate) fn reported_offset(&self, options: &SceneOptions) -> Option<Position> {
        options.recentre.then_some(self.offset)
    }

    /// Returns the [remarks] for the first key frame.
    pub(crate) fn remarks(
        &self,
        path: &Path,
        first: &[Position],
        options: &SceneOptions,
    ) -> Vec<String> {
        let rounded = |&p: &Position| RoundedPosition {
            exact: std::array::from_fn(|i| p[i] - self.offset[i]),
            rounded: self.point(p),
        };
        remarks(path, first.iter().map(rounded), options)
    }
}

/// A position before and after rounding.
pub(crate) struct RoundedPosition {
    pub(crate) exact: Position,
    pub(crate) rounded: Point,
}

/// Returns a remark if a coordinate of a scene exceeds the range of single precision, and one if rounding moves a
/// coordinate by more than 0.001 of the scene's size.
pub(crate) fn remarks(
    path: &Path,
    positions: impl Iterator<Item = RoundedPosition> + Clone,
    options: &SceneOptions,
) -> Vec<String> {
    const SHARE: f64 = 1e-3;
    let (mut remarks, file) = (Vec::new(), path.display());
    let errors_of = |p: RoundedPosition| -> [f64; 3] {
        std::array::from_fn(|i| (f64::from(p.rounded[i]) - p.exact[i]).abs())
    };
    let errors = positions.clone().flat_map(errors_of);
    // An infinite error means that a finite coordinate overflowed. If the file's coordinate is infinite or NaN, the
    // error is NaN.
    if errors.clone().any(f64::is_infinite) {
        remarks.push(format!(
            "{file}: a coordinate exceeds the range of 32-bit floats, so no ray hits the triangles that use this vertex"
        ));
    }
    let loss = errors.filter(|e| e.is_finite()).fold(0.0, f64::max);
    let size = finite_bounds(positions.map(|p| p.exact)).map(|[min, max]| {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|i| max[i] - min[i]);
        x.hypot(y).hypot(z)
    });
    if let Some(size) = size.filter(|size| loss > size * SHARE) {
        let hint = if options.recentre {
            ""
        } else {
            "; --recentre subtracts the centre before rounding"
        };
        let (loss, size) = (figure(loss), figure(size));
        remarks.push(format!(
            "{file}: coordinates lose up to {loss} when they are rounded to 32-bit floats, in a scene of size {size}{hint}"
        ));
    }
    remarks
}

/// Formats a number with three decimals. Very small and large numbers use scientific notation.
fn figure(number: f64) -> String {
    match number {
        0.01..1e6 => format!("{number:.3}"),
        _ => format!("{number:.2e}"),
    }
}

#[cfg(test)]
mod tests;
