//! The builder's primitives: boxes with triangle indices, and their bounds.

use geom::Aabb;
use glam::{Mat4, Vec4};

/// A box whose upper corner is stored negated. One minimum of eight lanes then grows all six sides.
/// The fourth lane of each corner is unused, except in a [`Prim`].
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub(crate) struct PrimBounds {
    pub(crate) lo: Vec4,
    pub(crate) up: Vec4,
}

impl PrimBounds {
    pub(crate) const EMPTY: Self = Self {
        lo: Vec4::INFINITY,
        up: Vec4::INFINITY,
    };

    #[inline]
    pub(crate) fn of_point(point: Vec4) -> Self {
        Self {
            lo: point,
            up: -point,
        }
    }

    #[inline]
    pub(crate) fn grow(&mut self, other: &Self) {
        self.lo = self.lo.min(other.lo);
        self.up = self.up.min(other.up);
    }

    #[inline]
    pub(crate) fn union(mut self, other: Self) -> Self {
        self.grow(&other);
        self
    }

    #[inline]
    pub(crate) fn extent(&self) -> Vec4 {
        -(self.lo + self.up)
    }

    pub(crate) fn aabb(&self) -> Aabb {
        let [min, max] = [self.lo, -self.up].map(|v| v.truncate().to_array());
        Aabb { min, max }
    }
}

/// One triangle's box: 32 bytes, accessed sequentially.
///
/// `lo.w` holds the bits of the triangle index, which may be a subnormal number. `up.w` is -1, so that sums and
/// differences of the fourth lanes are normal numbers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Prim {
    pub(crate) bounds: PrimBounds,
}

impl Prim {
    #[inline]
    pub(crate) fn new(bounds: &Aabb, triangle: u32) -> Self {
        let ([x, y, z], [u, v, w]) = (bounds.min, bounds.max);
        let lo = Vec4::new(x, y, z, f32::from_bits(triangle));
        let up = Vec4::new(-u, -v, -w, -1.0);
        let bounds = PrimBounds { lo, up };
        Self { bounds }
    }

    #[inline]
    pub(crate) fn triangle(&self) -> u32 {
        self.bounds.lo.w.to_bits()
    }

    /// Returns twice the centre. Every use allows for the factor.
    #[inline]
    pub(crate) fn center(&self) -> Vec4 {
        self.bounds.lo - self.bounds.up
    }

    #[inline]
    pub(crate) fn scaled(&self, factor: f32) -> Self {
        let PrimBounds { lo, up } = self.bounds;
        let (lo, up) = ((lo * factor).with_w(lo.w), (up * factor).with_w(up.w));
        let bounds = PrimBounds { lo, up };
        Self { bounds }
    }
}

/// The bounds of a set of boxes, and the bounds of their centres as [`Prim::center`] returns them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PrimExtents {
    pub(crate) boxes: PrimBounds,
    pub(crate) centers: PrimBounds,
}

impl PrimExtents {
    pub(crate) const EMPTY: Self = Self {
        boxes: PrimBounds::EMPTY,
        centers: PrimBounds::EMPTY,
    };

    pub(crate) fn of(prims: &[Prim]) -> Self {
        prims.iter().fold(Self::EMPTY, |mut all, prim| {
            all.add(prim);
            all
        })
    }

    #[inline]
    pub(crate) fn add(&mut self, prim: &Prim) {
        self.boxes.grow(&prim.bounds);
        self.centers.grow(&PrimBounds::of_point(prim.center()));
    }

    pub(crate) fn union(self, other: Self) -> Self {
        Self {
            boxes: self.boxes.union(other.boxes),
            centers: self.centers.union(other.centers),
        }
    }
}

/// Measures surface areas inside one node, in units of the node's longest edge. So areas neither overflow nor
/// underflow in scenes of any scale. Every edge is lengthened by 2^-20 of the longest edge, so that boxes without area
/// (points, axis-parallel segments) compare by their length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ruler {
    /// Reciprocal of the longest edge, negated because the sum of a box's corners is the negated extent.
    scale: f32,
}

impl Ruler {
    /// Least extent to divide by, since reciprocals of much smaller extents overflow. [`crate::gather::gather`] scales
    /// boxes so that their largest coordinate is far above this limit.
    pub(crate) const LEAST: f32 = 1.0 / (1_u128 << 100) as f32;
    const PAD: f32 = 1.0 / (1 << 20) as f32;

    pub(crate) fn new(node: &PrimBounds) -> Self {
        let e = node.extent();
        let scale = -1.0 / e.x.max(e.y).max(e.z).max(Self::LEAST);
        Self { scale }
    }

    #[inline]
    fn edges(self, b: &PrimBounds) -> Vec4 {
        (b.lo + b.up) * self.scale + Vec4::splat(Self::PAD)
    }

    /// Returns half the surface area of one box. NaN or infinite for an empty box.
    #[inline]
    pub(crate) fn half_area(self, b: &PrimBounds) -> f32 {
        let e = self.edges(b);
        e.x * e.y + (e.x + e.y) * e.z
    }

    /// Returns half the surface areas of three boxes. The fourth lane is NaN.
    #[inline]
    pub(crate) fn half_areas(self, b: &[PrimBounds; 3]) -> Vec4 {
        let [x, y, z] = [0, 1, 2].map(|i| self.edges(&b[i]));
        let e = Mat4::from_cols(x, y, z, Vec4::NAN).transpose();
        e.x_axis * e.y_axis + (e.x_axis + e.y_axis) * e.z_axis
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_area_boxes_compare_by_length() {
        let [short, long] = [1.0, 2.0].map(|x| {
            let (min, max) = ([0.0; 3], [x, 0.0, 0.0]);
            Prim::new(&Aabb { min, max }, 5).bounds
        });
        let ruler = Ruler::new(&long);
        assert!(ruler.half_area(&short) < ruler.half_area(&long));
        assert!(ruler.half_area(&short) > 0.0);
    }
}
