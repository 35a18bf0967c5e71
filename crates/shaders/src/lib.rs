//! All WGSL, compiled and reflected at build time.
//!
//! Each kernel comes as SPIR-V whose additions, subtractions and multiplications are decorated NoContraction, for those who
//! can load it. For others it comes as WGSL whose arithmetic a compiler cannot see through. Both give the bits that `cpu-ref`
//! gives.
//!
//! The kernels are WESL: each file in `wgsl` imports what it uses itself, and conditions (`@if(EXACT)`) tell variants apart. A
//! comment above an entry point names the axes of its variants: see `build/variants.rs`. This prints a kernel as it is composed:
//!
//! ```sh
//! cargo run -p abvh-shaders --example kernel -- trace_camera watertight fast
//! ```
//!
//! What hosts of these kernels need stands here too, so that no two can differ in it: [`Shape`], the parts of a tree's record;
//! [`Params`]; [`work`], each stage as a list of dispatches; [`rebuild`], likewise for trees made on the device; [`Counts`],
//! what kernels count. `gpu-common` is that host.

pub mod arithmetic;
mod method;
mod params;
mod pictures;
pub mod rebuild;
mod shape;
mod tree_stats;
mod view;
pub mod work;

use backend::Method;

pub use arithmetic::Traits;
pub use method::{RANGE_BYTES, occluded_words, tree_buffers};
pub(crate) use method::{notes, open_shadows_at, places};
pub use params::{Counts, Params};
pub use pictures::{Packets, RasterBackoff};
pub use shape::{MovingShape, Shape, moving_rows};
pub use tree_stats::{Extent, Extents, TreeStats};
pub use view::View;

/// A compute kernel.
#[derive(Clone, Copy, Debug)]
pub struct Kernel {
    /// Its entry point and the values that it serves, such as `trace_rays.watertight.fast`: no two kernels share it.
    pub name: &'static str,
    /// Its entry point.
    pub entry: &'static str,
    /// The axes along which it differs from others with its entry point, each with the values that it serves; none for kernels
    /// that every method shares.
    pub slots: &'static [(&'static str, &'static [&'static str])],
    /// The kernel itself.
    pub code: Code,
    /// The same for devices that round a fused product and sum once, of kernels that divide for each of many rays.
    pub fused: Option<Code>,
    /// Invocations of a workgroup.
    pub workgroup: [u32; 3],
    /// Bytes that a workgroup shares.
    pub shared_bytes: u32,
    /// What it reads and writes, by number, all in group 0.
    pub bindings: &'static [Binding],
}

/// A kernel as hosts load it, in two forms that give the same bits.
#[derive(Clone, Copy, Debug)]
pub struct Code {
    /// WGSL with opaque arithmetic.
    pub wgsl: &'static str,
    /// SPIR-V 1.3 with NoContraction: its words in this machine's order of bytes.
    pub spirv: &'static [u8],
}

/// A buffer that a kernel asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Its number in group 0.
    pub number: u32,
    /// How it is used.
    pub kind: Kind,
    /// The variable's name, which is the buffer's.
    pub name: BufferName,
}

backend::named! {
    /// A buffer by its name in the kernels, and what messages call it. The build makes [`Binding`]s of these, so a
    /// kernel can name no other.
    #[expect(missing_docs, reason = "messages say the others")]
    pub enum BufferName {
        /// [`Params`] of one dispatch.
        Params = "parameters",
        /// [`Counts`] of one submission.
        Counts = "counts",
        /// What the test of a device's arithmetic computes with: see [`crate::arithmetic`].
        Operands = "operands",
        Results = "results",
        /// The key frame before the moment, and the one after it.
        Earlier = "a key frame",
        Later = "a key frame",
        /// What a key frame takes over from a buffer of the program's.
        Lent = "lent positions",
        KeyFrame = "a key frame",
        /// How far its coordinates reach, where the host did not look: wgsl/geometry/range.wgsl.
        Range = "a key frame's range",
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
        Rays = "rays",
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
        Digits = "counts of digits",
        Boxes = "the scene's box",
        /// Subtrees that are merged, before a phase and after it.
        Clusters = "clusters",
    }
}

/// How a kernel uses a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Small and read by all: [`Params`].
    Uniform,
    /// Read.
    Read,
    /// Read and written.
    ReadWrite,
}

/// Storage buffers among bindings.
pub fn storage_buffers(bindings: &[Binding]) -> u32 {
    let all = bindings.iter().filter(|b| b.kind != Kind::Uniform);
    all.count() as u32
}

/// The stages of a ray-tracing pipeline, in one module of SPIR-V 1.4 with NoContraction.
#[derive(Clone, Copy, Debug)]
pub struct RayStages {
    /// The module, as [`Code::spirv`].
    pub spirv: &'static [u8],
    /// Where the driver's tree is bound in group 0.
    pub scene: u32,
    /// What else the stages read and write, by number, all in group 0.
    pub bindings: &'static [Binding],
    /// Entry points that make rays, by name.
    pub generate: &'static [&'static str],
    /// The entry point for rays that hit.
    pub closest_hit: &'static str,
    /// The entry point for rays that miss.
    pub miss: &'static str,
}

include!(concat!(env!("OUT_DIR"), "/kernels.rs"));

/// WGSL that shaders of others call: `traversal/module.wgsl` with all that it uses. Its buffers are bound in group 0.
pub const MODULE: &str = include_str!(concat!(env!("OUT_DIR"), "/module.wgsl"));

impl Kernel {
    /// Whether it is of use to `method`.
    pub fn serves(&self, method: Method) -> bool {
        let mut axes = self.slots.iter();
        axes.all(|(axis, values)| values.contains(&method::value(axis, method)))
    }

    /// What to load on a device.
    pub fn code_for(&self, traits: Traits) -> Code {
        let fused = self.fused.filter(|_| traits.fuses_once);
        fused.unwrap_or(self.code)
    }

    /// Whether a device with these traits takes it at all.
    pub fn suits(&self, traits: Traits) -> bool {
        Packets::of_kernel(self.entry).is_none_or(|packets| traits.packets == Some(packets))
    }

    /// Whether it is of use to [`rebuild`] alone; a host makes those when it first makes a tree.
    pub fn makes_trees(&self) -> bool {
        rebuild::KERNELS.contains(&self.entry)
    }

    /// Whether every frame may need it before its trace; a host makes the others when a trace, a picture or a tree first
    /// asks for them.
    #[must_use]
    pub fn precedes_traces(&self) -> bool {
        let stem = self.entry.split('_').next();
        matches!(
            stem.unwrap_or_default(),
            "interpolate" | "preprocess" | "refit" | "gather" | "sum" | "areas" | "mark"
        )
    }

    /// Whether it is of use to layout `fast` alone.
    pub fn refits_treelets(&self) -> bool {
        let mut all = KERNELS.iter().filter(|k| k.entry == self.entry);
        all.all(|k| k.slots.contains(&("layout", &["fast"])))
    }
}

/// The kernel with that entry point that serves `method`.
///
/// # Panics
/// If there is none: entry points are known when the program is written, and every method has them all.
pub fn kernel(entry: &str, method: Method) -> &'static Kernel {
    let mut all = KERNELS.iter();
    let found = all.find(|k| k.entry == entry && k.serves(method));
    found.unwrap_or_else(|| panic!("no kernel {entry} for {method:?}"))
}

/// The kernel with that entry point, which every method shares; also one of [`RAY_KERNELS`].
///
/// # Panics
/// As [`kernel`].
pub fn common(entry: &str) -> &'static Kernel {
    let beside = RAY_KERNELS.iter().find(|k| k.entry == entry);
    beside.unwrap_or_else(|| kernel(entry, Method::default()))
}
