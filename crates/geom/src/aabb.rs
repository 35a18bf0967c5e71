//! Axis-aligned boxes.

use crate::{Point, Triangle};
use bytemuck::{Pod, Zeroable};

/// Axis-aligned box that includes its boundary. Empty when any `min > max`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Aabb {
    /// Lower corner.
    pub min: Point,
    /// Upper corner.
    pub max: Point,
}

impl Default for Aabb {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Aabb {
    /// Empty box: the neutral element of [`Aabb::union`].
    pub const EMPTY: Self = Self {
        min: [f32::INFINITY; 3],
        max: [f32::NEG_INFINITY; 3],
    };

    /// Returns the smallest box that contains the three corners, which must be finite.
    #[must_use]
    #[inline]
    pub fn of_triangle(corners: &Triangle) -> Self {
        let [a, b, c] = corners;
        Self {
            min: std::array::from_fn(|i| a[i].min(b[i]).min(c[i])),
            max: std::array::from_fn(|i| a[i].max(b[i]).max(c[i])),
        }
    }

    /// Returns the smallest box that contains both boxes.
    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: std::array::from_fn(|i| self.min[i].min(other.min[i])),
            max: std::array::from_fn(|i| self.max[i].max(other.max[i])),
        }
    }

    /// Returns the smallest box that contains `self` and a finite point.
    #[inline]
    pub fn with_point(self, p: Point) -> Self {
        self.union(Self { min: p, max: p })
    }

    /// Returns the eight corners.
    pub fn corners(&self) -> [Point; 8] {
        let ends = [self.min, self.max];
        std::array::from_fn(|i| std::array::from_fn(|axis| ends[i >> axis & 1][axis]))
    }

    /// Returns whether the box contains no point.
    #[inline]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|i| self.min[i] > self.max[i])
    }

    /// Returns the length of the diagonal; 0 if the box is empty.
    pub fn diagonal(&self) -> f64 {
        let [x, y, z] = self.edges();
        (x.powi(2) + y.powi(2) + z.powi(2)).sqrt()
    }

    #[inline]
    fn edges(&self) -> [f64; 3] {
        if self.is_empty() {
            return [0.0; 3];
        }
        std::array::from_fn(|i| f64::from(self.max[i]) - f64::from(self.min[i]))
    }

    /// Returns the edge lengths; zeros if the box is empty.
    #[inline]
    pub fn extent(&self) -> [f32; 3] {
        if self.is_empty() {
            return [0.0; 3];
        }
        std::array::from_fn(|i| self.max[i] - self.min[i])
    }

    /// Returns half the surface area, in double precision so that sums over large trees stay accurate.
    #[inline]
    pub fn half_area(&self) -> f64 {
        let [x, y, z] = self.edges();
        x * y + y * z + z * x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_box_is_neutral() {
        let b = Aabb {
            min: [1.0, 2.0, 3.0],
            max: [2.0, 4.0, 7.0],
        };
        assert_eq!(Aabb::EMPTY.union(b), b);
        assert_eq!(Aabb::EMPTY.half_area(), 0.0);
        assert_eq!(b.half_area(), 2.0 + 8.0 + 4.0);
    }
}
