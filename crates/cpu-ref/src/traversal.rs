//! The interface of a tree: traversal by rays, independent of the number of children per node.

use crate::intersect::TriangleData;
use crate::scale::PreparedRay;
use geom::Aabb;

/// A tree with the boxes and triangles of one moment. Boxes are in scaled units.
pub trait TreeTraversal: Sync {
    /// Returns the root box.
    fn root(&self) -> Aabb;

    /// Calls `visitor` for every triangle whose own box the ray enters no later than the bound, in approximate order
    /// of distance. The bound is `t_max` at first. Returns whether the visitor ended the traversal.
    fn traverse(&self, ray: &PreparedRay, visitor: &mut TriangleVisitor<'_>) -> bool;

    /// Calls `each` for each child of a node, with a box that contains the child. Node 0 is the root. The root of an
    /// empty tree has no children.
    fn children(&self, node: u32, each: &mut dyn FnMut(&Aabb, Child));
}

/// A child of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// Another node.
    Node(u32),
    /// A triangle, by its index in the scene.
    Triangle(u32),
}

/// Function of a visited triangle and the current bound. Returns the new bound, or `None` to end the traversal.
pub type TriangleVisitor<'a> = dyn FnMut(&VisitedTriangle<'_>, f32) -> Option<f32> + 'a;

/// A triangle whose own box the ray meets, and the span of the ray within that box.
#[derive(Clone, Copy, Debug)]
pub struct VisitedTriangle<'a> {
    /// Index of the triangle in the scene.
    pub triangle: u32,
    /// The triangle's data for the tree's intersector.
    pub data: &'a TriangleData,
    /// The later of entry and `t_min`.
    pub entry: f32,
    /// Distance at which the ray leaves the box.
    pub exit: f32,
}
