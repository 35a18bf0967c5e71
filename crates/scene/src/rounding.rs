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
fn finite_bounds(points: &[Position]) -> Option<[Position; 2]> {
    let is_finite = |p: &&Position| p.iter().all(|x| (*x as f32).is_finite());
    let finite = points.iter().filter(is_finite);
    let boxes = finite.map(|p| [*p; 2]);
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
        let bounds = finite_bounds(first).filter(|_| options.recentre);
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
    pub(crate) fn chosen(&self, options: &SceneOptions) -> Option<Position> {
        options.recentre.then_some(self.offset)
    }

    /// Returns a remark if rounding moves a coordinate by more than 0.001 of the first key frame's size.
    pub(crate) fn remark(
        &self,
        path: &Path,
        first: &[Position],
        options: &SceneOptions,
    ) -> Option<String> {
        const SHARE: f64 = 1e-3;
        let [min, max] = finite_bounds(first)?;
        let [x, y, z]: [f64; 3] = std::array::from_fn(|i| max[i] - min[i]);
        let size = x.hypot(y).hypot(z);
        let error = |p: &Position| {
            let rounded = self.point(*p);
            let errors = (0..3).map(|i| (f64::from(rounded[i]) - (p[i] - self.offset[i])).abs());
            errors.filter(|e| e.is_finite()).fold(0.0, f64::max)
        };
        let loss = first.iter().map(error).fold(0.0, f64::max);
        if loss <= size * SHARE {
            return None;
        }
        let hint = if options.recentre {
            ""
        } else {
            "; --recentre subtracts the centre before rounding"
        };
        let (file, loss, size) = (path.display(), figure(loss), figure(size));
        Some(format!(
            "{file}: coordinates lose up to {loss} when they are rounded to 32-bit floats, in a scene of size {size}{hint}"
        ))
    }
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
