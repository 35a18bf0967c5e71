//! The one seam: what a device must do to interpolate, preprocess, refit and trace.
//!
//! # The contract
//!
//! **Owner.** A backend has one owner, which drives it by `&mut`. Nothing else needs a lock.
//!
//! **Scene.** [`Backend::load`] makes an animation current, with the method to
//! use. It drops whatever was current before: tree, positions, results.
//!
//! **Recording.** `interpolate`, `preprocess`, `refit` and `trace` only record. [`Backend::submit`] starts what was
//! recorded since the last submit, in the order of the calls, and returns a [`Ticket`]; tickets rise and finish in
//! order. Only [`Backend::wait`] and what gives results block. Up to [`FRAMES_IN_FLIGHT`] submissions may be unfinished;
//! one more `submit` waits for the oldest. What a submission reported and found is kept until `FRAMES_IN_FLIGHT`
//! further submissions with a trace were made, or as many as [`Backend::keep`] says, and may be asked for any number of
//! times until then. [`Backend::release`] ends this time earlier for the traces of one submission, which then no longer
//! counts as one with a trace. Its report is kept for `FRAMES_IN_FLIGHT` further submissions of any kind.
//!
//! **Order within a frame.** `interpolate` writes positions. `preprocess` writes one record and one box a leaf, of the
//! positions interpolated last (these alone would not do: leaves stand in the tree's order, so it needs a tree); it may
//! blend them from the key frames once more, to the same bits, so as not to wait for them. `refit` reads the boxes of
//! leaves and writes those of inner nodes. `trace` reads records and boxes. Stages whose input did not change may be
//! left out: a static scene runs the first three once. But a tree is traced only after `preprocess` and `refit` at the
//! frame's own positions: [`Backend::adopt`] and `interpolate` each make records and boxes stale, and tracing stale
//! ones panics.
//!
//! **Trees.** [`Backend::adopt`] takes effect at once, between submissions: all that is recorded later sees the new
//! tree, all that was submitted before saw the old. Generations strictly rise. The tree must hold exactly the
//! animation's live triangles ([`geom::Animation::is_live`]). A large tree takes its time to reach the device. So that
//! no frame waits, whoever builds it has a [`TreeWriter`] write it, and it is adopted once [`Backend::bring`] says that
//! it is there.
//!
//! **Candidates.** [`Backend::evaluate`] refits a tree that is not current yet, in buffers of its own, at the positions of
//! the frame that is recorded. The submission's report then has the costs of both trees. A tree that is adopted after its
//! evaluation keeps these buffers, so adopting it takes no further work.
//!
//! **Trees made on the device.** Where [`Backend::check_rebuild`] allows it, [`Backend::rebuild`] stands for `adopt`:
//! it makes a tree of the positions at hand, is recorded like a stage, and its generation rises like that of an adopted
//! tree. `preprocess` and `refit` may follow, and find nothing left to do. Once positions are others, the tree is made
//! anew or another adopted; `preprocess` panics otherwise.
//!
//! **Pictures.** Where [`Backend::load_palette`] says so, [`Backend::shade`] records hits to pixels after `trace`, and
//! [`Backend::pixels`] fetches them: the bytes that the host's shading gives (crate `shading`).
//!
//! **Positions.** [`Backend::request_positions`] records a copy of the interpolated vertices back to the host;
//! [`Backend::take_positions`] polls for it and never blocks. A submission holds one request at most; requests of
//! several submissions may be outstanding and are answered in their order.
//!
//! **Answers.** They depend on the rays, the triangles and the intersector alone: not on the tree, its age, its layout,
//! the thread count or (for `watertight` and `exact`) the backend. What a hit is, stands in `docs/design/hits.md`.
//!
//! **Errors.** [`BackendError`] is what a correct caller cannot foresee. Misuse
//! (tracing a stale tree, waiting for a ticket never given) panics.

/// An enum whose variants have names, on the command line or in tables and files, and a list of them all.
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
            /// All there are.
            $vis const ALL: [Self; [$($text,)+].len()] = [$(Self::$variant,)+];

            /// The name on the command line, or in tables and files.
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
mod query;

pub use device::{AdapterInfo, Arithmetic, Device, DeviceBytes, DeviceKind};
pub use error::{BackendError, Result};
pub use frame::{FrameReport, Generation, Snapshot, Spares, StageTimes, Ticket, sah_cost};
pub use query::{Hits, HitsPool, Intersector, Layout, Method, Palette, Query, QueryKind, Rays};

use bvh_layout::Topology;
use geom::{Aabb, Animation, Point, PointBuffer, Pose};
use std::any::Any;
use std::sync::Arc;

/// Puts a tree where a device takes it from, on any thread: see [`Backend::tree_writer`].
pub type TreeWriter = Box<dyn FnOnce(&Topology) + Send>;

/// Makes a backend, on any thread.
pub type Opener = Box<dyn FnOnce() -> Result<Box<dyn Backend>> + Send>;

/// A device that deforms, refits and traces one scene. See the crate's page for the contract, and [`BackendError`] for what
/// may go wrong in any call.
pub trait Backend: Send + Any {
    /// Who is at work: shown in logs, test names and result rows.
    fn device(&self) -> &Device;

    /// What makes a further backend on the same device, for another scene that is loaded and traced beside this one; `None`
    /// where a device has to be opened, which may hold up what the others do.
    fn another(&self) -> Option<Opener> {
        None
    }

    /// Makes `animation` current, to be traced by `method`.
    ///
    /// # Errors
    /// The scene does not fit the device.
    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()>;

    /// Makes ready, beside other work, what such queries of the scene will take, with trees made here or handed in. Without
    /// it they are made ready when they first come.
    fn prepare(&mut self, _query: Query<'_>, _makes_trees: bool) {}

    /// Makes `tree` current for all that is recorded from now on.
    ///
    /// # Errors
    /// The tree does not hold exactly the animation's live triangles, or does
    /// not fit the device. The old tree is then still current.
    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()>;

    /// What writes the tree of that generation as the device wants it, for whoever builds it: then this thread need not.
    /// `None` where that would save nothing.
    fn tree_writer(&mut self, _generation: Generation) -> Result<Option<TreeWriter>> {
        Ok(None)
    }

    /// Has a tree set out for the device, beside the frames, if it did not yet; says whether it is there. Never blocks.
    fn bring(&mut self, _tree: &Topology, _generation: Generation) -> Result<bool> {
        Ok(true)
    }

    /// Records the refit of a tree that is not current, beside the current one. Comes after `interpolate` and before
    /// `preprocess`. The tree must have been [brought](Backend::bring). The submission's report then has its cost
    /// ([`FrameReport::candidate_cost`]). Returns `false`, and records nothing, where the cost cannot be measured: the backend
    /// measures no costs, or memory does not suffice for a second tree.
    ///
    /// # Errors
    /// The tree does not hold exactly the animation's live triangles.
    fn evaluate(&mut self, _tree: &Topology, _generation: Generation) -> Result<bool> {
        Ok(false)
    }

    /// Whether [`Backend::adopt`] reads a tree's treelets ([`Topology::treelets`]) by the method loaded. Whoever builds
    /// trees then adds them in good time; a tree without them is adopted too, but slowly.
    fn wants_treelets(&self) -> bool {
        false
    }

    /// Likewise for the eight-wide form ([`Topology::blocks`]).
    fn wants_blocks(&self) -> bool {
        false
    }

    /// Memory for a key frame of the scene loaded that is yet to be [pushed](Animation::push): where the device can, it reads
    /// it there.
    fn point_buffer(&mut self, points: usize) -> Result<PointBuffer> {
        Ok(vec![[0.0; 3]; points].into())
    }

    /// Records: key frames to positions.
    fn interpolate(&mut self, pose: Pose) -> Result<()>;

    /// Whether the backend makes trees on its device for the method loaded.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] where trees are made by the host alone, or
    /// [`BackendError::Limit`] with what the device lacks.
    fn check_rebuild(&self) -> Result<()> {
        Err(no_trees(self.device().backend))
    }

    /// Records: positions to a tree made on the device, current from then on. `preprocess` and `refit` may follow as
    /// after [`Backend::adopt`]. The first tree takes room on the device, which is kept until another scene is loaded.
    ///
    /// # Errors
    /// Those of [`Backend::check_rebuild`] too.
    fn rebuild(&mut self, _generation: Generation) -> Result<()> {
        Err(no_trees(self.device().backend))
    }

    /// Records: positions to triangle records and boxes of leaves.
    fn preprocess(&mut self) -> Result<()>;

    /// Records: boxes of leaves to boxes of inner nodes.
    fn refit(&mut self) -> Result<()>;

    /// Records: records and boxes to hits. At most one trace a submission.
    fn trace(&mut self, query: Query<'_>) -> Result<()>;

    /// Whether [`Backend::trace_together`] takes these queries.
    fn traces_together(&self, _queries: &[Query<'_>]) -> bool {
        false
    }

    /// Records: several traces of one submission, in the place of its one. Small ones end sooner than by themselves, since
    /// none waits for the slowest rays of another. Asked where [`Backend::traces_together`] says so.
    fn trace_together(&mut self, _queries: &[Query<'_>]) -> Result<()> {
        let (backend, what) = (self.device().backend, "several traces of one submission");
        Err(BackendError::unsupported(backend, what))
    }

    /// Takes what pictures are painted by, until the next [`Backend::load`]. `false` where pictures are left to the host:
    /// then nothing is shaded.
    fn load_palette(&mut self, _palette: &Palette) -> Result<bool> {
        Ok(false)
    }

    /// Records: what the trace before it finds for `query`, a camera's with shadows, to pixels. Without a palette it does
    /// nothing.
    fn shade(&mut self, _query: Query<'_>) -> Result<()> {
        Ok(())
    }

    /// Blocks until `ticket` is done and copies its pixels into `out`, four bytes each (red, green, blue, 255), row by row.
    /// `false` if it shaded none: its hits are then for the host to shade.
    fn pixels(&mut self, _ticket: Ticket, _out: &mut Vec<u8>) -> Result<bool> {
        Ok(false)
    }

    /// Records: a copy of the positions to the host, for [`Backend::take_positions`]. At most one a submission.
    fn request_positions(&mut self) -> Result<()>;

    /// Starts what was recorded since the last call.
    fn submit(&mut self) -> Result<Ticket>;

    /// Blocks until `ticket` is done and says what it did.
    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport>;

    /// Blocks until `ticket` is done and lends what its trace found, the same each time.
    ///
    /// To keep it without a copy, exchange it for other memory, which a later trace then uses:
    /// `std::mem::swap(backend.hits(ticket)?, &mut mine)`.
    fn hits(&mut self, ticket: Ticket) -> Result<&mut Hits>;

    /// Returns the hits of query `place` among those that were traced together. Blocks until `ticket` is done.
    fn hits_of(&mut self, ticket: Ticket, place: usize) -> Result<&mut Hits> {
        assert!(place == 0, "there was one query");
        self.hits(ticket)
    }

    /// Moves the hits of a query into `into`, without a copy on the host. Later traces may use the memory that was there.
    /// Blocks until `ticket` is done. A query's hits can be taken once.
    fn take_hits(&mut self, ticket: Ticket, place: usize, into: &mut Hits) -> Result<()> {
        std::mem::swap(self.hits_of(ticket, place)?, into);
        Ok(())
    }

    /// Returns whether `ticket` is done, so that neither its report nor its hits have to be waited for. Never blocks.
    fn is_done(&mut self, _ticket: Ticket) -> Result<bool> {
        Ok(true)
    }

    /// Frees the traces of a submission before they are old enough, or keeps their memory for later traces. It keeps the
    /// memory of at most as many traces as [`Backend::keep`] allows.
    fn release(&mut self, _ticket: Ticket) {}

    /// Keeps the traces of submissions until `traces` further ones with a trace were made, at least [`FRAMES_IN_FLIGHT`].
    /// Released traces beyond that number are freed at once. Holds until another scene is loaded.
    fn keep(&mut self, traces: usize);

    /// The oldest positions requested and not taken yet, with the ticket of
    /// their submission; `None` while they are under way. Never blocks.
    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>>;

    /// Bytes of device memory that the backend holds, where it can tell.
    fn device_bytes(&self) -> Option<DeviceBytes> {
        None
    }

    /// Bytes of device memory that may still be had, where the driver tells.
    fn free_device_bytes(&self) -> Option<u64> {
        None
    }

    /// Views that only tests and dumps need.
    fn inspect(&mut self) -> &mut dyn Inspect;
}

/// Submissions that may be unfinished at a time.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// Views into the output of a stage, off the frame's path. Each waits for all submissions.
pub trait Inspect {
    /// After `interpolate`: one position a vertex.
    fn positions(&mut self) -> Result<Vec<Point>>;

    /// After `refit`: one box a node, in node order, in the scene's units.
    /// Leaves of inactive and degenerate triangles have [`Aabb::EMPTY`].
    fn boxes(&mut self) -> Result<Vec<Aabb>>;

    /// The tree that the last [`Backend::rebuild`] made, read back as a record
    /// and checked like any other. [`Inspect::boxes`] follows its node order.
    ///
    /// # Errors
    /// [`BackendError::WrongTree`] if what the device made is no tree over the
    /// live triangles; [`BackendError::Unsupported`] where it makes none.
    fn rebuilt(&mut self) -> Result<Topology> {
        Err(no_trees("the backend"))
    }

    /// What the device's interface refused so far, and what its validation layer has said in this process.
    fn complaints(&mut self) -> Vec<String> {
        Vec::new()
    }
}

fn no_trees(backend: &'static str) -> BackendError {
    BackendError::unsupported(backend, "trees made on the device")
}

/// Refuses a tree that does not hold exactly the animation's live triangles.
///
/// A record names each triangle at most once, and none beyond its scene's, so
/// counting leaves and asking each whether it is live suffices.
///
/// # Errors
/// [`BackendError::WrongTree`] with what was found and expected.
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
