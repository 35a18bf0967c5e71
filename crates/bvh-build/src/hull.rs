//! A box whose upper corner is negated: one kind of minimum grows all six sides, eight lanes at a time where the machine has them.

use crate::prim::{Bounds, Prim};
use glam::Vec4;

/// Lower corner and negated upper corner; the fourth lanes mean nothing.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Hull {
    pub(crate) lo: Vec4,
    pub(crate) up: Vec4,
}

impl Hull {
    pub(crate) const EMPTY: Self = Self {
        lo: Vec4::INFINITY,
        up: Vec4::INFINITY,
    };

    #[inline]
    pub(crate) fn of(prim: &Prim) -> Self {
        Self {
            lo: prim.lo,
            up: -prim.hi,
        }
    }

    #[inline]
    pub(crate) fn grow(&mut self, other: &Self) {
        self.lo = self.lo.min(other.lo);
        self.up = self.up.min(other.up);
    }

    #[inline]
    pub(crate) fn bounds(&self) -> Bounds {
        Bounds {
            lo: self.lo,
            hi: -self.up,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geom::Aabb;

    #[test]
    fn it_grows_as_a_box_does() {
        let corner = |i: i32, k: i32| ((i * 7919 + k * 31) % 101 - 50) as f32;
        let prims = (0..40).map(|i| {
            let min = [0, 1, 2].map(|k| corner(i, k));
            let max = [0, 1, 2].map(|k| min[k as usize] + corner(i, k + 3).abs());
            Prim::new(&Aabb { min, max }, i as u32)
        });
        let (mut hull, mut bounds) = (Hull::EMPTY, Bounds::EMPTY);
        for prim in prims {
            hull.grow(&Hull::of(&prim));
            bounds.grow(prim.lo, prim.hi);
            let found = hull.bounds();
            assert_eq!(found.lo.truncate(), bounds.lo.truncate());
            assert_eq!(found.hi.truncate(), bounds.hi.truncate());
        }
        assert_eq!(Hull::EMPTY.bounds().lo, Bounds::EMPTY.lo);
        assert_eq!(Hull::EMPTY.bounds().hi, Bounds::EMPTY.hi);
    }
}
