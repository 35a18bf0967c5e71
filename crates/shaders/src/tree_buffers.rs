//! What a device keeps of the tree in use beside its record, in buffers of whatever kind its host has.

use crate::{Shape, record_bytes};
use backend::{Layout, Method};

/// What messages call the buffer `nodes`.
pub const NODES: &str = "the tree's nodes";
/// What messages call the buffer `costs`.
pub const COSTS: &str = "the tree's areas";
/// What messages call the buffer `covers`.
pub const COVERS: &str = "what triangles cover of the picture";
/// What messages call the buffer `visibility`.
pub const VISIBILITY: &str = "the visibility buffer";

/// Buffers by the kernels' names.
#[derive(Debug)]
pub struct TreeBuffers<B> {
    /// Empty with layout `fast`, as is the other list.
    leaf_nodes: B,
    inner_nodes: B,
    /// Three vertices a leaf with layout `fast`, else empty.
    leaf_corners: B,
    records: B,
    /// With layout `fast` empty until a tree says how many rows it takes ([`Shape::node_rows`]), as is `costs`.
    pub nodes: B,
    /// Partial sums of areas: see build/refit.wgsl. See [`Shape::own_cost_bytes`].
    pub costs: B,
    /// Empty until a trace says how much it takes: see [`crate::work::Trace::cover_bytes`].
    pub covers: B,
    /// Likewise: see [`crate::work::Trace::visibility_bytes`]. It grows with the picture, not with the tree.
    pub visibility: B,
}

impl<B> TreeBuffers<B> {
    /// Room for every tree of so many leaves; with layout `fast` but for nodes and costs.
    /// `make` makes a buffer of so many bytes, by a name for messages.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn new<E>(
        method: Method,
        leaves: u64,
        mut make: impl FnMut(&'static str, u64) -> Result<B, E>,
    ) -> Result<Self, E> {
        let usual = |bytes| match method.layout {
            Layout::Bvh2 => bytes,
            Layout::Fast => 0,
        };
        let records = record_bytes(method.intersector, leaves);
        Ok(Self {
            leaf_nodes: make("the list of leaves", usual(leaves * 4))?,
            inner_nodes: make("the list of inner nodes", usual(leaves * 4))?,
            leaf_corners: make("the leaves' vertices", leaves * 12 - usual(leaves * 12))?,
            records: make("the triangles' records", records)?,
            nodes: make(NODES, usual((2 * leaves).saturating_sub(1) * 32))?,
            costs: make(COSTS, usual(Shape::cost_bytes(leaves)))?,
            covers: make(COVERS, 0)?,
            visibility: make(VISIBILITY, 0)?,
        })
    }

    /// The buffer of that name, where there is one.
    pub fn find(&self, name: &str) -> Option<&B> {
        Some(match name {
            "leaf_nodes" => &self.leaf_nodes,
            "inner_nodes" => &self.inner_nodes,
            "leaf_corners" => &self.leaf_corners,
            "records" => &self.records,
            "nodes" => &self.nodes,
            "costs" => &self.costs,
            "covers" => &self.covers,
            "visibility" => &self.visibility,
            _ => return None,
        })
    }

    /// All but `visibility`, which is a picture's.
    pub fn all(&self) -> impl Iterator<Item = &B> {
        let lists = [&self.leaf_nodes, &self.inner_nodes, &self.leaf_corners];
        lists
            .into_iter()
            .chain([&self.records, &self.nodes, &self.costs, &self.covers])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_layout_has_room_for_what_its_kernels_name() {
        let bytes = |layout, name: &str| {
            let method = Method {
                layout,
                ..Method::default()
            };
            let made = TreeBuffers::new(method, 10, |_, bytes| Ok::<_, ()>(bytes));
            made.unwrap().find(name).copied()
        };
        for (name, usual, fast) in [
            ("leaf_nodes", 40, 0),
            ("inner_nodes", 40, 0),
            ("leaf_corners", 0, 120),
            ("records", 480, 480),
            ("nodes", 19 * 32, 0),
        ] {
            assert_eq!(bytes(Layout::Bvh2, name), Some(usual), "{name}");
            assert_eq!(bytes(Layout::Fast, name), Some(fast), "{name}");
        }
        assert!(bytes(Layout::Bvh2, "costs") > bytes(Layout::Fast, "costs"));
        assert_eq!(bytes(Layout::Fast, "topology"), None);
    }
}
