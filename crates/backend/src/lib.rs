//! The interface that every backend implements: interpolate, preprocess, refit and trace one scene on a device.
//!
//! # Ownership
//!
//! A backend has one owner, which calls it through `&mut`. No lock is needed.
//!
//! # Scenes
//!
//! [`Backend::load`] makes an animation current and fixes its intersector. It drops the previous tree, positions and
//! results.
//!
//! # Recording and submission
//!
//! `interpolate`, `preprocess`, `refit` and `trace` only record work. [`Backend::submit`] starts the recorded work in
//! call order and returns a [`Ticket`]. One exception: on the host, `trace` with a list of rays runs all recorded work
//! at once, so that it need not copy the list. Tickets increase, and submissions finish in ticket order. At most
//! [`FRAMES_IN_FLIGHT`] submissions are unfinished at any time; a further `submit` blocks until the oldest has
//! finished.
//!
//! `load`, `submit`, [`Backend::wait`], [`Backend::take_hits`] and [`Backend::pixels`] wait for submissions to finish. On
//! devices with a single queue, such as all devices of wgpu, so do [`Backend::load_palette`], the first `rebuild` and the
//! first `request_positions`, because they upload data. Other methods may wait for the last use of memory that they reuse,
//! for key frames or for the compilation of kernels.
//!
//! A submission's report and traces remain available until [`FRAMES_IN_FLIGHT`] later submissions with traces have been
//! submitted. [`Backend::retain_traces`] extends this. A report can be read any number of times. Hits can be taken once.
//!
//! # Stage order
//!
//! 1. `interpolate` blends two key frames and writes vertex positions.
//! 2. `preprocess` reads the latest positions and writes one triangle record and one box per leaf. It needs a tree,
//!    because it stores records and boxes in the order of the tree's leaves. Instead of waiting for `interpolate`, it
//!    may blend the key frames itself. The result is bit-identical.
//! 3. `refit` reads the boxes of leaves and writes the boxes of inner nodes.
//! 4. `trace` reads records and boxes and writes hits.
//!
//! A stage may be skipped if its input has not changed: a static scene runs the first three once. [`Backend::adopt`]
//! and `interpolate` each make records and boxes stale. Tracing stale records or boxes
//! panics.
//!
//! # Trees
//!
//! A tree contains exactly the *live* triangles of the animation ([`geom::Animation::is_live`]): those whose vertices
//! are finite in at least one key frame, or all triangles of a streamed animation. Its generation must be positive and
//! higher than the previous one. [`Backend::adopt`] panics if recorded work is not submitted yet. Work recorded
//! afterwards uses the new tree, and submitted work keeps the old one.
//!
//! Large trees take time to reach a device. The builder thread therefore writes the tree through a [`TreeWriter`], and
//! the frame loop (`pipeline::Driver`) adopts it once [`Backend::upload_tree`] returns `true`. The host does not wait
//! for the copy.
//!
//! # Hits
//!
//! A hit depends on the ray, the triangles and the intersector, but not on the tree, its age, its format or the thread
//! count. With `watertight` and `exact`, all backends return the same hits. With the other intersectors, hits may differ
//! between devices. `docs/design/hits.md` defines hits and proves this.
//!
//! # Errors
//!
//! [`BackendError`] reports failures, unsupported operations and trees that do not fit the scene. Calls in a wrong order,
//! such as tracing a stale tree, and unknown tickets panic. [`BackendError::Misuse`] reports that the calling program
//! misused a resource that it shares with the library.

/// Defines an enum and a list of its variants. Each variant has a name for the command line, or for tables and files.
#[macro_export]
macro_rules! named {
    ($(#[$meta:meta])* $vis:vis enum $name:ident {
        $($(#[$doc:meta])* $variant:ident = $text:literal,)+
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        $vis enum $name {
            $($(#[$doc])* $variant,)+
        }

        impl $name {
            /// All variants.
            $vis const ALL: [Self; [$($text,)+].len()] = [$(Self::$variant,)+];

            /// Returns the variant's name on the command line, or in tables and files.
            #[must_use]
            $vis fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }
    };
}

mod device;
mod error;
mod frame;
mod options;
mod query;

pub use device::{
    AdapterInfo, Arithmetic, Capabilities, Device, DeviceBytes, DeviceKind, MemoryUse,
};
pub use error::{BackendError, Result};
pub use frame::{FrameReport, Generation, Snapshot, Spares, StageTimes, Ticket, rounded, sah_cost};
pub use options::{BackendName, Intersector, Policy};
pub use query::{Hits, HitsPool, Palette, Query, QueryKind, Rays};

use bvh_layout::Topology;
#[cfg(feature = "inspect")]
use geom::{Aabb, Point};
use geom::{Animation, Pose};
use std::any::Any;
use std::sync::Arc;

/// The form of a [`Topology`] that a backend reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TreeFormat {
    /// The binary tree itself.
    #[default]
    Binary,
    /// The binary tree divided into treelets, the parts that GPUs refit: [`Topology::treelets`].
    Treelets,
    /// An eight-wide tree: [`Topology::blocks`].
    WideBlocks,
}

/// Function that writes a tree into memory for upload, on any thread. See [`Backend::tree_writer`].
pub type TreeWriter = Box<dyn FnOnce(&Topology) + Send>;

/// Interpolates, refits and traces one scene on a device.
///
/// The crate documentation states the contract. `# Errors` sections list only errors specific to a method;
/// [`BackendError`] lists all.
pub trait Backend: Send + Any {
    /// Returns the device's name, kind, driver and capabilities.
    fn device(&self) -> &Device;

    /// Returns the device memory that is in use, and the amount that was available when the device was opened. The frame
    /// loop calls this for each frame, so it must not query the driver.
    fn memory(&self) -> MemoryUse {
        MemoryUse::default()
    }

    /// Makes `animation` current, to be traced with `intersector`.
    ///
    /// # Errors
    /// The scene exceeds a limit or the memory of the device.
    fn load(&mut self, animation: Arc<Animation>, intersector: Intersector) -> Result<()>;

    /// Starts to compile, on other threads, the kernels that queries like this one need. `builds_trees` states whether
    /// trees are built on the device. Without this call, kernels are compiled on first use, except those that
    /// [`Backend::load`] compiles.
    fn prepare(&mut self, _query: Query<'_>, _builds_trees: bool) {}

    /// Returns a function with which a builder thread writes the tree of `generation` in the device's format. Returns
    /// `None` if the backend needs no such preparation, and on GPUs also before the first upload of a tree.
    fn tree_writer(&mut self, _generation: Generation) -> Result<Option<TreeWriter>> {
        Ok(None)
    }

    /// Starts to upload a tree while frames run, unless its upload has already started. Returns whether the upload has
    /// finished. Does not wait for the upload.
    fn upload_tree(&mut self, _tree: &Topology, _generation: Generation) -> Result<bool> {
        Ok(true)
    }

    /// Makes `tree` current for all work recorded from now on.
    ///
    /// # Errors
    /// The tree does not contain exactly the animation's live triangles, or does not fit the device. The previous tree
    /// stays current.
    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()>;

    /// Records `preprocess` and `refit` of a tree that is not current. The current tree still needs its own calls of
    /// both. Call this after `interpolate` and before `preprocess`, with a tree whose [upload](Backend::upload_tree) has
    /// finished. The submission's report then contains the tree's cost ([`FrameReport::candidate_cost`]). A later
    /// [`Backend::adopt`] of this tree copies nothing to the device, but `preprocess` and `refit` must run after it.
    /// Returns `false`, and records nothing, if the backend measures no costs or lacks memory for a second tree.
    ///
    /// # Errors
    /// The tree does not contain exactly the animation's live triangles.
    fn evaluate(&mut self, _tree: &Topology, _generation: Generation) -> Result<bool> {
        Ok(false)
    }

    /// Records the build of a tree on the device from the current positions, and makes the tree current. The generation
    /// must increase as it does for [`Backend::adopt`]. The build includes `preprocess` and `refit`: calls of both
    /// do nothing until the next `interpolate`. After it, `preprocess` panics until another tree is built or adopted. The
    /// first build allocates scratch memory, which is kept until another scene is loaded.
    ///
    /// # Errors
    /// Also the error of [`Capabilities::device_rebuild`].
    fn rebuild(&mut self, _generation: Generation) -> Result<()> {
        self.device().capabilities.device_rebuild.clone()
    }

    /// Records the interpolation of key frames to the positions at `pose`: a key frame and the weight of the next one.
    fn interpolate(&mut self, pose: Pose) -> Result<()>;

    /// Records the computation of triangle records and boxes of leaves from positions.
    fn preprocess(&mut self) -> Result<()>;

    /// Records the computation of the boxes of inner nodes from the boxes of leaves.
    fn refit(&mut self) -> Result<()>;

    /// Records the trace of queries. At most one call per submission. Small queries finish sooner in one call than in
    /// several submissions, because they run concurrently. Only backends that
    /// [support batches](Capabilities::can_batch) accept more than one query.
    fn trace(&mut self, queries: &[Query<'_>]) -> Result<()>;

    /// Stores the colours for pictures. Until the next [`Backend::load`], the trace of a single camera query with
    /// shadows also shades its hits to pixels. Returns `false` if the backend does not shade.
    fn load_palette(&mut self, _palette: &Palette) -> Result<bool> {
        Ok(false)
    }

    /// Records a copy of the positions to the host for [`Backend::take_positions`]. At most one call per submission.
    fn request_positions(&mut self) -> Result<()>;

    /// Submits the work recorded since the last call.
    fn submit(&mut self) -> Result<Ticket>;

    /// Blocks until `ticket` has finished and returns its report.
    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport>;

    /// Returns whether `ticket` has finished, so that its report and hits can be read without blocking. Never blocks.
    fn is_done(&mut self, _ticket: Ticket) -> Result<bool> {
        Ok(true)
    }

    /// Blocks until `ticket` has finished and replaces `hits` by the hits of query `index`, which can be taken once.
    /// GPU backends copy the hits into the memory of `hits`. Host backends exchange buffers instead, and may use the
    /// previous memory of `hits` for later traces.
    fn take_hits(&mut self, ticket: Ticket, index: usize, hits: &mut Hits) -> Result<()>;

    /// Blocks until `ticket` has finished and copies its pixels into `out`: four bytes each (red, green, blue, 255),
    /// row by row. They equal, byte for byte, those of the host's shading in crate `abvh`. Returns `false` if the
    /// submission shaded no pixels; the host then shades its hits.
    fn pixels(&mut self, _ticket: Ticket, _out: &mut Vec<u8>) -> Result<bool> {
        Ok(false)
    }

    /// Retains the reports and traces of these submissions until the next call or until another scene is loaded.
    /// `tickets` is in ascending order. A trace that the previous call named and this call does not name is released:
    /// later traces reuse its memory. The backend keeps the memory of at most
    /// `max(tickets.len() + 1, FRAMES_IN_FLIGHT)` released traces, and frees the rest.
    fn retain_traces(&mut self, tickets: &[Ticket]);

    /// Returns the oldest requested positions that were not taken yet, with the ticket of their submission. Returns
    /// `None` if they have not arrived. Never blocks.
    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>>;
}

/// Maximum number of unfinished submissions.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// Reads the output of a stage, for tests. Each method except [`Inspect::complaints`] waits for all submissions.
#[cfg(feature = "inspect")]
pub trait Inspect: Backend {
    /// Returns one position per vertex, after `interpolate`.
    fn positions(&mut self) -> Result<Vec<Point>>;

    /// Returns one box per node of the binary tree, in breadth-first order and in the scene's units, after `refit`.
    /// Leaves of inactive and degenerate triangles have [`Aabb::EMPTY`].
    fn boxes(&mut self) -> Result<Vec<Aabb>>;

    /// Reads back and validates the tree that the last [`Backend::rebuild`] built. The boxes of [`Inspect::boxes`] are
    /// those of its nodes.
    ///
    /// # Errors
    /// [`BackendError::WrongTree`] if the device's output is no tree over the live triangles. The error of
    /// [`Capabilities::device_rebuild`] if the device builds no trees.
    ///
    /// # Panics
    /// If the current tree was built on the host.
    fn rebuilt(&mut self) -> Result<Topology> {
        Err(BackendError::no_device_trees(self.device().backend))
    }

    /// Returns the messages of all calls that wgpu has rejected so far. If Vulkan's validation layer is enabled, also
    /// returns its warnings and errors in this process. Backend `wgpu` returns only the layer's errors, and only in
    /// builds with debug assertions.
    fn complaints(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// Rejects a tree that does not contain exactly the animation's live triangles.
///
/// It suffices to count the leaves and to check that each leaf's triangle is live: a [`Topology`] names each triangle
/// at most once, and only triangles of its scene.
///
/// # Errors
/// [`BackendError::WrongTree`] with the counts found and expected, or with a triangle that has a leaf but is not live.
pub fn check_tree(tree: &Topology, animation: &Animation) -> Result<()> {
    let wrong = |why| Err(BackendError::WrongTree(why));
    let triangles = (tree.triangle_count(), animation.triangle_count());
    let leaves = (tree.binary().leaf_count(), animation.live_count());
    for (what, (found, expected)) in [("triangles", triangles), ("leaves", leaves)] {
        if found != expected {
            return wrong(format!("it has {found} {what}, the scene {expected}"));
        }
    }
    if animation.live_count() == animation.triangle_count() {
        return Ok(());
    }
    let mut leaves = tree.binary().order().iter();
    match leaves.find(|&&t| !animation.is_live(t)) {
        None => Ok(()),
        Some(t) => wrong(format!("triangle {t} has a leaf but is never active")),
    }
}
