//! The interface that every device implements: interpolate, preprocess, refit and trace one scene.
//!
//! # Ownership
//!
//! A backend has one owner, which calls it through `&mut`. No lock is needed.
//!
//! # Scenes
//!
//! [`Backend::load`] makes an animation current and fixes its tracing method. It drops the previous tree, positions and
//! results.
//!
//! # Recording and submission
//!
//! `interpolate`, `preprocess`, `refit` and `trace` only record work. [`Backend::submit`] starts the recorded work in
//! call order and returns a [`Ticket`]. Tickets increase, and submissions finish in ticket order. At most
//! [`FRAMES_IN_FLIGHT`] submissions are unfinished at any time; a further `submit` blocks until the oldest has
//! finished.
//!
//! Only `submit`, [`Backend::wait`] and the methods that return results block. The report and the hits of a submission
//! stay available for [`FRAMES_IN_FLIGHT`] further submissions that contain a trace. [`Backend::keep`] can raise this
//! number. Until then they can be read any number of times. [`Backend::release`] drops the traces of one submission
//! earlier. It then no longer counts as a submission that contains a trace. Its report stays available for
//! `FRAMES_IN_FLIGHT` further submissions of any kind.
//!
//! # Stage order
//!
//! 1. `interpolate` blends two key frames and writes vertex positions.
//! 2. `preprocess` reads the latest positions and writes one triangle record and one box per leaf. It needs a tree,
//!    because leaves are in tree order. It may blend the key frames again, to the same bits, instead of waiting for
//!    `interpolate`.
//! 3. `refit` reads the boxes of leaves and writes the boxes of inner nodes.
//! 4. `trace` reads records and boxes and writes hits.
//!
//! A stage may be skipped if its input has not changed: a static scene runs the first three once. [`Backend::adopt`]
//! and `interpolate` each make records and boxes stale. Tracing before `preprocess` and `refit` have run at the frame's
//! own positions panics.
//!
//! # Trees
//!
//! A tree contains exactly the live triangles of the animation ([`geom::Animation::is_live`]). Its generation must be
//! higher than the previous one. [`Backend::adopt`] takes effect between submissions: work recorded afterwards uses the
//! new tree, and submitted work keeps the old one.
//!
//! Large trees take time to reach a device. The builder thread therefore writes the tree through a [`TreeWriter`], and
//! the driver adopts it once [`Backend::bring`] returns `true`. No frame waits for the copy.
//!
//! # Candidates
//!
//! [`Backend::evaluate`] refits a tree that is not current yet at the positions of the recorded frame. The tree has its
//! own buffers. The submission's report contains the costs of both trees. A candidate that is adopted later keeps its
//! buffers, so adopting it requires no further work.
//!
//! # Trees built on the device
//!
//! If [`Backend::check_rebuild`] succeeds, [`Backend::rebuild`] can replace `adopt`. It records, like a stage, the
//! build of a tree from the current positions. The generation must increase as it does for `adopt`. A following
//! `preprocess` or `refit` does nothing. After the positions change, the owner must rebuild or adopt another tree:
//! preprocessing a tree that was built on the device panics.
//!
//! # Pictures
//!
//! If [`Backend::load_palette`] returns `true`, [`Backend::shade`] records the shading of hits after `trace`, and
//! [`Backend::pixels`] returns the pixels. They equal, byte for byte, those of the host's shading (crate `shading`).
//!
//! # Positions
//!
//! [`Backend::request_positions`] records a copy of the interpolated vertices to the host. [`Backend::take_positions`]
//! polls for it and never blocks. A submission contains at most one request. Requests of several submissions may be
//! outstanding; they complete in submission order.
//!
//! # Hits
//!
//! A hit depends on the ray, the triangles and the intersector only. It does not depend on the tree, its age, its
//! layout or the thread count. With `watertight` and `exact` it does not depend on the backend. `docs/design/hits.md`
//! defines hits and proves this.
//!
//! # Errors
//!
//! [`BackendError`] covers failures that a correct caller cannot anticipate. Incorrect calls, such as tracing a stale
//! tree or waiting for an unknown ticket, panic.

/// Defines an enum whose variants have names for the command line or for tables and files, and a list of all variants.
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

mod axes;
mod device;
mod error;
mod frame;
mod query;

pub use axes::{Intersector, Policy};
pub use device::{AdapterInfo, Arithmetic, Device, DeviceBytes, DeviceKind};
pub use error::{BackendError, Result};
pub use frame::{FrameReport, Generation, Snapshot, Spares, StageTimes, Ticket, rounded, sah_cost};
pub use query::{Hits, HitsPool, Layout, Method, Palette, Query, QueryKind, Rays};

use bvh_layout::Topology;
use geom::{Aabb, Animation, Point, PointBuffer, Pose};
use std::any::Any;
use std::sync::Arc;

/// Function that writes a tree into memory for upload, on any thread. See [`Backend::tree_writer`].
pub type TreeWriter = Box<dyn FnOnce(&Topology) + Send>;

/// Function that creates a backend, on any thread.
pub type Opener = Box<dyn FnOnce() -> Result<Box<dyn Backend>> + Send>;

/// A device that deforms, refits and traces one scene.
///
/// The crate documentation states the contract. `# Errors` sections list only errors specific to a method;
/// [`BackendError`] lists all.
pub trait Backend: Send + Any {
    /// Returns the device's name, kind and driver, as shown in logs, test names and result rows.
    fn device(&self) -> &Device;

    /// Returns a function that creates a backend for another scene on the same device. Both scenes can be loaded and
    /// traced at the same time. Returns `None` if the device would have to be opened again, which may block other
    /// scenes.
    fn another(&self) -> Option<Opener> {
        None
    }

    /// Makes `animation` current, to be traced by `method`.
    ///
    /// # Errors
    /// The scene exceeds a limit or the memory of the device.
    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()>;

    /// Starts to compile, on other threads, the kernels that queries like this one need. `makes_trees` states whether
    /// trees are built on the device. Without this call, kernels are compiled on first use.
    fn prepare(&mut self, _query: Query<'_>, _makes_trees: bool) {}

    /// Makes `tree` current for all work recorded from now on.
    ///
    /// # Errors
    /// The tree does not contain exactly the animation's live triangles, or does not fit the device. The previous tree
    /// stays current.
    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()>;

    /// Returns a function with which a builder thread writes the tree of `generation` in the device's format. Returns
    /// `None` if that saves no work on the owner's thread.
    fn tree_writer(&mut self, _generation: Generation) -> Result<Option<TreeWriter>> {
        Ok(None)
    }

    /// Starts the upload of a tree concurrently with frames, unless it was started before. Returns whether the tree has
    /// arrived. Never blocks.
    fn bring(&mut self, _tree: &Topology, _generation: Generation) -> Result<bool> {
        Ok(true)
    }

    /// Records the refit of a tree that is not current, in addition to the current one. Call it after `interpolate` and
    /// before `preprocess`, with a tree whose [upload](Backend::bring) has finished. The submission's report then
    /// contains the tree's cost ([`FrameReport::candidate_cost`]). Returns `false`, and records nothing, if the backend
    /// measures no costs or lacks memory for a second tree.
    ///
    /// # Errors
    /// The tree does not contain exactly the animation's live triangles.
    fn evaluate(&mut self, _tree: &Topology, _generation: Generation) -> Result<bool> {
        Ok(false)
    }

    /// Returns whether [`Backend::adopt`] reads a tree's treelets ([`Topology::treelets`]) with the loaded method.
    /// Builders then add treelets ahead of time; `adopt` accepts a tree without treelets, but takes longer.
    fn wants_treelets(&self) -> bool {
        false
    }

    /// Returns whether [`Backend::adopt`] reads a tree's eight-wide form ([`Topology::blocks`]) with the loaded method.
    /// Builders then add it ahead of time.
    fn wants_blocks(&self) -> bool {
        false
    }

    /// Allocates memory for a key frame that will be [pushed](Animation::push) to the loaded scene. The device reads
    /// the memory directly if it can.
    fn point_buffer(&mut self, points: usize) -> Result<PointBuffer> {
        Ok(vec![[0.0; 3]; points].into())
    }

    /// Records: writes the positions at `pose`, blended from key frames.
    fn interpolate(&mut self, pose: Pose) -> Result<()>;

    /// Checks that trees can be built on the device with the loaded method.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] if only the host builds trees, or [`BackendError::Limit`] if a limit of the device
    /// is too low.
    fn check_rebuild(&self) -> Result<()> {
        Err(no_trees(self.device().backend))
    }

    /// Records: builds a tree from the current positions on the device and makes it current. `preprocess` and `refit`
    /// may follow as after [`Backend::adopt`]. The first tree allocates scratch memory, which is kept until another
    /// scene is loaded.
    ///
    /// # Errors
    /// Also those of [`Backend::check_rebuild`].
    fn rebuild(&mut self, _generation: Generation) -> Result<()> {
        Err(no_trees(self.device().backend))
    }

    /// Records: writes triangle records and boxes of leaves from positions.
    fn preprocess(&mut self) -> Result<()>;

    /// Records: writes the boxes of inner nodes from the boxes of leaves.
    fn refit(&mut self) -> Result<()>;

    /// Records: traces one query and writes its hits. At most one call per submission.
    fn trace(&mut self, query: Query<'_>) -> Result<()>;

    /// Returns whether [`Backend::trace_together`] accepts these queries.
    fn traces_together(&self, _queries: &[Query<'_>]) -> bool {
        false
    }

    /// Records: traces a batch of queries, in place of the submission's single [`Backend::trace`]. Small queries finish
    /// sooner than one after another, because they run at the same time. Call it only if [`Backend::traces_together`]
    /// returns `true`.
    fn trace_together(&mut self, _queries: &[Query<'_>]) -> Result<()> {
        let (backend, what) = (self.device().backend, "several traces of one submission");
        Err(BackendError::unsupported(backend, what))
    }

    /// Stores the colours for [`Backend::shade`], until the next [`Backend::load`]. Returns `false` if the backend does
    /// not shade.
    fn load_palette(&mut self, _palette: &Palette) -> Result<bool> {
        Ok(false)
    }

    /// Records: shades the hits of the recorded trace of `query`, a camera query with shadows, into pixels. Does
    /// nothing without a palette.
    fn shade(&mut self, _query: Query<'_>) -> Result<()> {
        Ok(())
    }

    /// Blocks until `ticket` has finished and copies its pixels into `out`: four bytes each (red, green, blue, 255),
    /// row by row. Returns `false` if the submission shaded no pixels; the host then shades its hits.
    fn pixels(&mut self, _ticket: Ticket, _out: &mut Vec<u8>) -> Result<bool> {
        Ok(false)
    }

    /// Records: copies the positions to the host for [`Backend::take_positions`]. At most one call per submission.
    fn request_positions(&mut self) -> Result<()>;

    /// Submits the work recorded since the last call.
    fn submit(&mut self) -> Result<Ticket>;

    /// Blocks until `ticket` has finished and returns its report.
    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport>;

    /// Blocks until `ticket` has finished and returns the hits of its trace. Repeated calls return the same hits.
    ///
    /// To keep the hits without a copy, swap them with other memory, which a later trace then uses:
    /// `std::mem::swap(backend.hits(ticket)?, &mut mine)`.
    fn hits(&mut self, ticket: Ticket) -> Result<&mut Hits>;

    /// Returns the hits of query `place` of a batch. Blocks until `ticket` has finished.
    fn hits_of(&mut self, ticket: Ticket, place: usize) -> Result<&mut Hits> {
        assert!(place == 0, "there was one query");
        self.hits(ticket)
    }

    /// Moves the hits of query `place` into `into`, without a copy on the host. Later traces may use the previous
    /// memory of `into`. Blocks until `ticket` has finished. The hits of a query can be taken once.
    fn take_hits(&mut self, ticket: Ticket, place: usize, into: &mut Hits) -> Result<()> {
        std::mem::swap(self.hits_of(ticket, place)?, into);
        Ok(())
    }

    /// Returns whether `ticket` has finished, so that its report and hits can be read without blocking. Never blocks.
    fn is_done(&mut self, _ticket: Ticket) -> Result<bool> {
        Ok(true)
    }

    /// Drops the traces of a submission before they expire. Their memory is reused by later traces or freed. It is kept
    /// for at most the number of traces that [`Backend::keep`] sets.
    fn release(&mut self, _ticket: Ticket) {}

    /// Keeps each trace for `traces` further submissions that contain a trace, or for [`FRAMES_IN_FLIGHT`] if that is
    /// more. Frees released traces beyond that number. Applies until another scene is loaded.
    fn keep(&mut self, traces: usize);

    /// Returns the oldest requested positions that were not taken yet, with the ticket of their submission. Returns
    /// `None` if they have not arrived. Never blocks.
    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>>;

    /// Returns the bytes of device memory that the backend holds, or `None` if unknown.
    fn device_bytes(&self) -> Option<DeviceBytes> {
        None
    }

    /// Returns the bytes of device memory that are still available, or `None` if the driver does not report them.
    fn free_device_bytes(&self) -> Option<u64> {
        None
    }

    /// Returns access to intermediate results, for tests and dumps.
    fn inspect(&mut self) -> &mut dyn Inspect;
}

/// Maximum number of unfinished submissions.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// Reads the output of a stage, outside a frame's time-critical path. Each method waits for all submissions.
pub trait Inspect {
    /// Returns one position per vertex, after `interpolate`.
    fn positions(&mut self) -> Result<Vec<Point>>;

    /// Returns one box per node, in node order and in the scene's units, after `refit`. Leaves of inactive and
    /// degenerate triangles have [`Aabb::EMPTY`].
    fn boxes(&mut self) -> Result<Vec<Aabb>>;

    /// Reads back the tree that the last [`Backend::rebuild`] built and checks it like any other tree. The boxes of
    /// [`Inspect::boxes`] are in its node order.
    ///
    /// # Errors
    /// [`BackendError::WrongTree`] if the device's output is no tree over the live triangles;
    /// [`BackendError::Unsupported`] if the device builds no trees.
    fn rebuilt(&mut self) -> Result<Topology> {
        Err(no_trees("the backend"))
    }

    /// Returns all calls that the device's interface has rejected so far, and all messages of its validation layer in
    /// this process.
    fn complaints(&mut self) -> Vec<String> {
        Vec::new()
    }
}

fn no_trees(backend: &'static str) -> BackendError {
    BackendError::unsupported(backend, "trees made on the device")
}

/// Rejects a tree that does not contain exactly the animation's live triangles.
///
/// It suffices to count the leaves and to check that each leaf's triangle is live: a [`Topology`] names each triangle
/// at most once, and only triangles of its scene.
///
/// # Errors
/// [`BackendError::WrongTree`] with the counts found and expected.
pub fn check_tree(tree: &Topology, animation: &Animation) -> Result<()> {
    let wrong = |why| Err(BackendError::WrongTree(why));
    let triangles = (tree.triangle_count(), animation.triangle_count());
    let leaves = (tree.leaf_count(), animation.live_count());
    let moving = tree.moving().map(|moving| {
        let counts = (moving.leaves().len(), animation.moving_count());
        ("its lists have", "moving leaves", counts)
    });
    let all = [
        ("it has", "triangles", triangles),
        ("it has", "leaves", leaves),
    ];
    for (whose, what, (found, expected)) in all.into_iter().chain(moving) {
        if found != expected {
            return wrong(format!("{whose} {found} {what}, the scene {expected}"));
        }
    }
    if animation.live_count() == animation.triangle_count() {
        return Ok(());
    }
    let mut leaves = tree.leaf_triangles().iter();
    match leaves.find(|&&t| !animation.is_live(t)) {
        None => Ok(()),
        Some(t) => wrong(format!("triangle {t} has a leaf but is never active")),
    }
}
