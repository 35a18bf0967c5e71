//! The buffers that kernels name, and how large those of a tree are.

use crate::{Shape, record_bytes};
use backend::{Layout, Method};

backend::named! {
    /// A buffer by its name in the kernels, and what messages call it. The build makes [`crate::Binding`]s of these, so a
    /// kernel can name no other.
    pub enum BufferName {
        /// [`crate::Params`] of one dispatch.
        Params = "parameters",
        /// [`crate::Counts`] of one submission.
        Counts = "counts",
        /// What the test of a device's arithmetic computes with: see [`crate::arithmetic`].
        Operands = "operands",
        /// What that test gives.
        Results = "results",
        /// The key frame before the moment.
        Earlier = "a key frame",
        /// The key frame after it.
        Later = "a key frame",
        /// How far its coordinates reach, where the host did not look: wgsl/geometry/range.wgsl.
        Range = "a key frame's range",
        /// Interpolated vertices.
        Positions = "positions",
        /// Rows of positions in which anything moves: see [`crate::moving_rows`].
        MovingRows = "rows that move",
        /// Three vertices a triangle.
        Triangles = "triangles' corners",
        /// Three finite vertices a triangle, for trees of the driver's.
        Cleansed = "cleansed triangles",
        /// The tree's record as the host sends it.
        Topology = "the tree's record",
        /// Leaves by their ranks. Empty with layout `fast`, as is the other list.
        LeafNodes = "the list of leaves",
        /// Inner nodes likewise.
        InnerNodes = "the list of inner nodes",
        /// Three vertices a leaf with layout `fast`, else empty.
        LeafCorners = "the leaves' vertices",
        /// What intersectors read of each triangle.
        Records = "the triangles' records",
        /// With layout `fast` empty until a tree says how many rows it takes ([`Shape::node_rows`]), as is `costs`.
        Nodes = "the tree's nodes",
        /// Partial sums of areas: see build/refit.wgsl and [`Shape::own_cost_bytes`].
        Costs = "the tree's areas",
        /// Empty until a trace says how much it takes: see [`crate::work::Trace::cover_bytes`].
        Covers = "what triangles cover of the picture",
        /// Likewise: see [`crate::work::Trace::visibility_bytes`]. It grows with the picture, not with the tree.
        Visibility = "the visibility buffer",
        /// Rays given one by one.
        Rays = "rays",
        /// Closest hits.
        Hits = "hits",
        /// Whether rays met anything, or hits lie in shadow.
        Occluded = "shadows",
        /// Hits or occlusion, as they are counted.
        Answers = "answers",
        /// sRGB of each triangle: [`backend::Palette::colours`].
        Colours = "the triangles' colours",
        /// [`backend::Palette::tones`].
        Tones = "tones",
        /// Four bytes a pixel, of pictures that are shaded.
        Pixels = "pixels",
        /// The live triangles, for trees made on the device; so are the next.
        Live = "the live triangles",
        /// The numbers of leaves, in place of [`BufferName::LeafNodes`] where not all triangles are live. No kernel's own name.
        LeafNumbers = "the numbers of leaves",
        /// Keys to sort by, before a pass and after it.
        Keys = "keys to sort by",
        /// The leaves' triangles, likewise.
        Sorted = "sorted triangles",
        /// How often each value of a digit occurs.
        Digits = "counts of digits",
        /// Parts of the scene's box.
        Boxes = "the scene's box",
        /// Subtrees that are merged, before a phase and after it.
        Clusters = "clusters",
    }
}

/// Bytes of the buffer `range`.
pub const RANGE_BYTES: u64 = 4 * (8 + geom::Range::SAMPLES as u64);

/// Bytes of each buffer that suffice for every tree of so many leaves; with layout `fast` but for nodes and costs.
pub fn tree_buffers(method: Method, leaves: u64) -> [(BufferName, u64); 8] {
    let usual = |bytes| match method.layout {
        Layout::Bvh2 => bytes,
        Layout::Fast => 0,
    };
    let nodes = (2 * leaves).saturating_sub(1);
    [
        (BufferName::LeafNodes, usual(leaves * 4)),
        (BufferName::InnerNodes, usual(leaves * 4)),
        (BufferName::LeafCorners, leaves * 12 - usual(leaves * 12)),
        (
            BufferName::Records,
            record_bytes(method.intersector, leaves),
        ),
        (BufferName::Nodes, usual(nodes * 32)),
        (BufferName::Costs, usual(Shape::cost_bytes(leaves))),
        (BufferName::Covers, 0),
        (BufferName::Visibility, 0),
    ]
}
