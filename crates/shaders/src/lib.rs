//! All WGSL kernels, compiled and reflected at build time.
//!
//! Each kernel comes in two forms. Both give the same bits as `cpu-ref`, except for textbook intersectors
//! (`docs/design/hits.md`) and areas of boxes. The first is SPIR-V in which each FAdd, FSub and FMul is decorated
//! NoContraction, except in functions named `loose_…`. The second is WGSL with arithmetic that a compiler cannot see
//! through, for backends that cannot load SPIR-V.
//!
//! The kernels are WESL: each file in `wgsl` imports what it uses, and conditions (`@if(EXACT)`) distinguish variants. A
//! comment above an entry point lists the properties in which its variants differ: see `build/variants.rs`. This prints
//! a composed kernel:
//!
//! ```sh
//! cargo run -p abvh-shaders --example kernel -- trace_camera watertight
//! ```
//!
//! The crate also holds what a host needs to run the kernels: [`Shape`] describes a tree's buffers, [`Params`]
//! the parameters of a dispatch, and [`Counts`] the counters. [`work`] returns each stage as a list of dispatches, and
//! [`rebuild`] returns those that build trees on the device. `gpu-common` uses it.

pub mod arithmetic;
mod params;
mod pictures;
pub mod rebuild;
mod shape;
mod sizes;
#[cfg(any(test, feature = "inspect"))]
mod view;
pub mod work;

use backend::Intersector;

pub use arithmetic::Traits;
pub(crate) use params::{
    AnswerParams, ExtremesParams, InterpolationParams, MeasureParams, PhaseParams, PointsParams,
    RasterParams, SearchParams, SortParams, SumParams, TreeletsParams,
};
pub use params::{Counts, OwnParams, Params};
pub use pictures::{Packets, RasterBackoff};
pub use shape::{MovingShape, Shape, moving_rows};
pub use sizes::{RANGE_BYTES, occluded_words, tree_buffers};
pub(crate) use sizes::{candidate_capacity, fallback_workers, undecided_shadows_at};
#[cfg(any(test, feature = "inspect"))]
pub use view::View;

/// A compute kernel.
#[derive(Clone, Copy, Debug)]
pub struct Kernel {
    /// Entry point and intersectors that the kernel serves, such as `trace_rays.watertight`. Unique among kernels.
    pub name: &'static str,
    /// Entry point.
    pub entry: &'static str,
    /// The kernel's own parameters, if any: a member of `Params` in `wgsl/lib/params.wgsl`.
    pub parameters: Option<&'static str>,
    /// Whether a frame of any scene may run the kernel before it traces rays. A host loads such kernels with every
    /// scene. It loads most others when a trace, a picture or a tree first uses them.
    pub loads_with_scene: bool,
    /// Names of the intersectors that the kernel serves, with underscores. Empty if it serves all.
    pub intersectors: &'static [&'static str],
    /// Code for all devices.
    pub code: Code,
    /// Code for devices whose fused multiply-add rounds once. `None` for kernels that never or seldom divide.
    pub fused: Option<Code>,
    /// Workgroup size, in invocations.
    pub workgroup: [u32; 3],
    /// Workgroup memory, in bytes.
    pub shared_bytes: u32,
    /// Buffers of the kernel by number, all in group 0.
    pub bindings: &'static [Binding],
}

/// A kernel in two forms.
#[derive(Clone, Copy, Debug)]
pub struct Code {
    /// WGSL with opaque arithmetic.
    pub wgsl: &'static str,
    /// SPIR-V 1.3 with NoContraction except in functions named `loose_…`, as words in the byte order of this machine.
    pub spirv: &'static [u8],
}

/// A buffer that a kernel uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Binding number in group 0.
    pub number: u32,
    /// How the kernel uses the buffer.
    pub kind: Kind,
    /// Name of the variable in the kernel, which identifies the buffer.
    pub name: BufferName,
}

backend::named! {
    /// A buffer by its name in the kernels, with its name in messages. The build creates [`Binding`]s from these names, so
    /// a kernel cannot use any other buffer.
    #[expect(missing_docs, reason = "the name in messages describes the variant")]
    pub enum BufferName {
        /// [`Params`] of one dispatch.
        Params = "parameters",
        /// [`Counts`] of one submission.
        Counts = "counts",
        /// Operands and results of the self-test: see [`crate::arithmetic`].
        Operands = "operands",
        Results = "results",
        /// The key frames before and after the current time.
        Earlier = "a key frame",
        Later = "a key frame",
        /// Source of `copy_points`: positions of the calling program, or results of a query.
        CopySource = "the source of a copy",
        /// Target of `copy_points`: a key frame, or the calling program's buffer for results.
        KeyFrame = "a key frame",
        /// Range of a key frame's coordinates, measured by a kernel if the host has not: see wgsl/geometry/range.wgsl.
        Range = "a key frame's range",
        Positions = "positions",
        /// Rows of positions that contain moving vertices: see [`crate::moving_rows`].
        MovingRows = "the list of moving rows",
        /// Three vertex indices per triangle.
        Triangles = "the triangles' vertex indices",
        /// Three finite vertices per triangle, for trees that the driver builds.
        FiniteTriangles = "finite triangles",
        /// The tree's topology, as the host uploads it.
        Topology = "the tree's topology",
        /// Three vertex indices per leaf.
        LeafCorners = "the leaves' vertex indices",
        /// Triangle records, in the format of the intersector.
        Records = "the triangles' records",
        /// Fits only the root until a tree determines the size: see [`Shape::node_rows`].
        Nodes = "the tree's nodes",
        /// Partial sums of areas: see build/costs.wgsl. Empty until a tree determines its size: see [`Shape::cost_bytes`].
        Costs = "the tree's partial areas",
        /// Empty until a trace determines its size: see [`crate::work::Trace::coverage_bytes`].
        PixelCoverage = "the triangles' pixel coverage",
        /// Empty until a trace determines its size: see [`crate::work::Trace::visibility_bytes`]. The size depends on the
        /// picture, not on the tree.
        Visibility = "the visibility buffer",
        Rays = "rays",
        Hits = "hits",
        /// Whether rays hit anything, or hits are in shadow.
        Occluded = "shadows",
        /// Hits or occlusion: `extreme_rays` writes them, and `count_answers` reads them.
        Answers = "results of rays",
        /// sRGB colour of each triangle: [`backend::Palette::colours`].
        Colours = "the triangles' colours",
        /// [`backend::Palette::tones`].
        Tones = "tones",
        /// Four bytes per pixel of shaded pictures.
        Pixels = "pixels",
        /// The triangles that a tree must contain: [`geom::Animation::is_live`]. This and the following buffers are
        /// for trees built on the device.
        Live = "the live triangles",
        /// Sort keys, before and after a pass.
        Keys = "sort keys",
        /// The triangles of the leaves, before and after a pass.
        Sorted = "sorted triangles",
        Digits = "counts of digits",
        Boxes = "the scene's box",
        /// Subtrees to be merged, before and after a phase.
        Clusters = "clusters",
    }
}

/// How a kernel uses a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A small read-only buffer: [`Params`].
    Uniform,
    /// Read only.
    Read,
    /// Read and written.
    ReadWrite,
}

/// Returns the number of storage buffers among `bindings`.
pub fn storage_buffers(bindings: &[Binding]) -> u32 {
    let all = bindings.iter().filter(|b| b.kind != Kind::Uniform);
    all.count() as u32
}

/// The stages of a ray-tracing pipeline, in one module of SPIR-V 1.4 with NoContraction except in functions named
/// `loose_…`.
#[derive(Clone, Copy, Debug)]
pub struct RayStages {
    /// The module, in the format of [`Code::spirv`].
    pub spirv: &'static [u8],
    /// Binding of the driver's tree in group 0.
    pub scene: u32,
    /// The other buffers of the stages by number, all in group 0.
    pub bindings: &'static [Binding],
    /// Entry points that generate rays, by name. The other entry points are `closest_hit` and `miss`.
    pub generate: &'static [&'static str],
}

include!(concat!(env!("OUT_DIR"), "/kernels.rs"));

/// WGSL that shaders of a program can call: `traversal/module.wgsl` with everything it uses. Its buffers are bound in
/// group 0.
pub const MODULE: &str = include_str!(concat!(env!("OUT_DIR"), "/module.wgsl"));

impl Kernel {
    /// Returns whether the kernel serves an intersector.
    pub fn serves(&self, intersector: Intersector) -> bool {
        let name = intersector.name().replace('-', "_");
        self.intersectors.is_empty() || self.intersectors.contains(&&*name)
    }

    /// Returns the code to load on a device.
    pub fn code_for(&self, traits: Traits) -> Code {
        let fused = self.fused.filter(|_| traits.fma_rounds_once);
        fused.unwrap_or(self.code)
    }

    /// Returns whether only [`rebuild`] uses the kernel. A host loads such kernels before the device builds a tree.
    pub fn builds_trees(&self) -> bool {
        rebuild::KERNELS.contains(&self.entry)
    }

    /// Checks that the kernel declares a constant with the host's value.
    #[cfg(test)]
    #[track_caller]
    pub(crate) fn assert_declares(&self, constant: &str, value: u32) {
        let text = format!("const {constant}: u32 = {value}u;");
        assert!(self.code.wgsl.contains(&text), "{} lacks {text}", self.name);
    }
}

/// Returns the kernel with this entry point that serves `intersector`.
///
/// # Panics
/// Panics if there is no such kernel. Entry points are known at compile time.
pub fn kernel(entry: &str, intersector: Intersector) -> &'static Kernel {
    let mut all = KERNELS.iter();
    let found = all.find(|k| k.entry == entry && k.serves(intersector));
    found.unwrap_or_else(|| panic!("no kernel {entry} for {intersector}"))
}

/// Returns the kernel with this entry point, which all intersectors share.
///
/// # Panics
/// Panics if there is no such kernel.
pub fn common(entry: &str) -> &'static Kernel {
    kernel(entry, Intersector::Watertight)
}
