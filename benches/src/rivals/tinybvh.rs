//! `tinybvh` (Bikker) by the crate `tinybvh-rs`: binned builds, on threads of its own where meshes are large. The feature `tinybvh` compiles its C++.

use crate::Node;
use geom::{Aabb, Triangle};
use tinybvh_rs::bvh;

/// Triangles as that library wants them, and a tree over them.
pub struct TinyBvh<'a> {
    corners: &'a [[f32; 4]],
    tree: Option<bvh::BVH<'a>>,
}

impl<'a> TinyBvh<'a> {
    /// The corners of all triangles, one after the other.
    #[must_use]
    pub fn soup(triangles: &[Triangle]) -> Vec<[f32; 4]> {
        let corners = triangles.as_flattened().iter();
        corners.map(|&[x, y, z]| [x, y, z, 0.0]).collect()
    }

    /// A tree over the corners of a mesh.
    ///
    /// # Panics
    /// If there is half a triangle.
    #[must_use]
    pub fn new(corners: &'a [[f32; 4]]) -> Self {
        let tree = bvh::BVH::new(corners.into()).expect("three corners a triangle");
        let tree = Some(tree);
        Self { corners, tree }
    }

    /// Builds anew, in the memory at hand.
    ///
    /// # Panics
    /// Never: corners were counted before.
    pub fn rebuild(&mut self) {
        let tree = self.tree.take().expect("there is a tree between builds");
        let built = tree.data().bvh(self.corners.into());
        let built = built.and_then(|tree| tree.build(self.corners.into()));
        self.tree = Some(built.expect("three corners a triangle"));
    }

    /// Splits leaves until each holds one triangle.
    pub fn split_leaves(&mut self) {
        if let Some(tree) = &mut self.tree {
            tree.split_leaves(1);
        }
    }

    /// All nodes, the root first.
    ///
    /// # Panics
    /// Never: there is a tree between builds.
    #[must_use]
    pub fn nodes(&self) -> Vec<Node> {
        let tree = self.tree.as_ref().expect("there is a tree between builds");
        let nodes = tree.nodes().iter().enumerate();
        // The second place is left empty, so that siblings share a cache line.
        nodes
            .filter(|(at, _)| *at != 1)
            .map(|(_, node)| Node {
                bounds: Aabb {
                    min: node.min,
                    max: node.max,
                },
                triangles: node.tri_count,
            })
            .collect()
    }
}
