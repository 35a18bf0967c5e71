//! Where a builder's boxes come from.

use geom::{Aabb, Animation, Point, Pose};

/// One box a triangle. An empty box (or one with a NaN) leaves its triangle out of the tree.
pub trait Boxes: Sync {
    /// Triangles, those left out included.
    fn len(&self) -> usize;

    /// The box of one triangle.
    fn get(&self, triangle: u32) -> Aabb;

    /// Whether there is no triangle at all.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Boxes for [Aabb] {
    fn len(&self) -> usize {
        self.len()
    }

    #[inline]
    fn get(&self, triangle: u32) -> Aabb {
        self[triangle as usize]
    }
}

/// An animation at a moment given by its vertices.
impl Boxes for (&Animation, &[Point]) {
    fn len(&self) -> usize {
        self.0.triangle_count()
    }

    #[inline]
    fn get(&self, triangle: u32) -> Aabb {
        self.0.build_box(self.1, triangle)
    }
}

/// An animation at a pose, blended anew for each triangle asked for.
impl Boxes for (&Animation, Pose) {
    fn len(&self) -> usize {
        self.0.triangle_count()
    }

    #[inline]
    fn get(&self, triangle: u32) -> Aabb {
        self.0.build_box_at(self.1, triangle)
    }
}
