//! The buffers that kernels name, and how large those of a tree are.

use crate::{Shape, record_bytes};
use backend::{Layout, Method};

/// A buffer by its name in the kernels. The build makes [`crate::Binding`]s of these, so a kernel can name no other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BufferName {
    /// [`crate::Params`] of one dispatch.
    Params,
    /// [`crate::Counts`] of one submission.
    Counts,
    /// What the test of a device's arithmetic computes with: see [`crate::arithmetic`].
    Operands,
    /// What that test gives.
    Results,
    /// The key frame before the moment.
    Earlier,
    /// The key frame after it.
    Later,
    /// How far its coordinates reach, where the host did not look: wgsl/geometry/range.wgsl.
    Range,
    /// Interpolated vertices.
    Positions,
    /// Rows of positions in which anything moves: see [`crate::moving_rows`].
    MovingRows,
    /// Three vertices a triangle.
    Triangles,
    /// Three finite vertices a triangle, for trees of the driver's.
    Cleansed,
    /// The tree's record as the host sends it.
    Topology,
    /// Leaves by their ranks. Empty with layout `fast`, as is the other list.
    LeafNodes,
    /// Inner nodes likewise.
    InnerNodes,
    /// Three vertices a leaf with layout `fast`, else empty.
    LeafCorners,
    /// What intersectors read of each triangle.
    Records,
    /// With layout `fast` empty until a tree says how many rows it takes ([`Shape::node_rows`]), as is `costs`.
    Nodes,
    /// Partial sums of areas: see build/refit.wgsl and [`Shape::own_cost_bytes`].
    Costs,
    /// Empty until a trace says how much it takes: see [`crate::work::Trace::cover_bytes`].
    Covers,
    /// Likewise: see [`crate::work::Trace::visibility_bytes`]. It grows with the picture, not with the tree.
    Visibility,
    /// Rays given one by one.
    Rays,
    /// Closest hits.
    Hits,
    /// Whether rays met anything, or hits lie in shadow.
    Occluded,
    /// Hits or occlusion, as they are counted.
    Answers,
    /// sRGB of each triangle: [`backend::Palette::colours`].
    Colours,
    /// [`backend::Palette::tones`].
    Tones,
    /// Four bytes a pixel, of pictures that are shaded.
    Pixels,
    /// The live triangles, for trees made on the device; so are the next.
    Live,
    /// The numbers of leaves, in place of [`BufferName::LeafNodes`] where not all triangles are live. No kernel's own name.
    LeafNumbers,
    /// Keys to sort by, before a pass and after it.
    Keys,
    /// The leaves' triangles, likewise.
    Sorted,
    /// How often each value of a digit occurs.
    Digits,
    /// Parts of the scene's box.
    Boxes,
    /// Subtrees that are merged, before a phase and after it.
    Clusters,
}

impl BufferName {
    /// What messages call it.
    pub fn what(self) -> &'static str {
        match self {
            Self::Params => "parameters",
            Self::Counts => "counts",
            Self::Operands => "operands",
            Self::Results => "results",
            Self::Earlier | Self::Later => "a key frame",
            Self::Range => "a key frame's range",
            Self::Positions => "positions",
            Self::MovingRows => "rows that move",
            Self::Triangles => "triangles' corners",
            Self::Cleansed => "cleansed triangles",
            Self::Topology => "the tree's record",
            Self::LeafNodes => "the list of leaves",
            Self::InnerNodes => "the list of inner nodes",
            Self::LeafCorners => "the leaves' vertices",
            Self::Records => "the triangles' records",
            Self::Nodes => "the tree's nodes",
            Self::Costs => "the tree's areas",
            Self::Covers => "what triangles cover of the picture",
            Self::Visibility => "the visibility buffer",
            Self::Rays => "rays",
            Self::Hits => "hits",
            Self::Occluded => "shadows",
            Self::Answers => "answers",
            Self::Colours => "the triangles' colours",
            Self::Tones => "tones",
            Self::Pixels => "pixels",
            Self::Live => "the live triangles",
            Self::LeafNumbers => "the numbers of leaves",
            Self::Keys => "keys to sort by",
            Self::Sorted => "sorted triangles",
            Self::Digits => "counts of digits",
            Self::Boxes => "the scene's box",
            Self::Clusters => "clusters",
        }
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
