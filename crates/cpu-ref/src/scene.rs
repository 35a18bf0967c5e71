//! The loaded scene: an animation, its current tree, and all data computed from them.

use crate::interpolate::{copy, interpolate};
use crate::scale::Scale;
use crate::tiles::{Counts, Output};
use crate::trace::TraceTask;
use crate::{Accelerator, Geometry, Unhittable, reserve};
use backend::{BackendError, Generation, Intersector, Query, Result, check_tree, sah_cost};
use bvh_build::MAX_DEPTH;
use bvh_layout::Topology;
use geom::{Animation, Point, Pose, StaticParts};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// Number of static vertices at which two runs of moving ones stay separate. Below it, one longer run is cheaper.
const GAP: usize = 64;

/// An animation with its tree, at one moment.
pub(crate) struct SceneState {
    animation: Arc<Animation>,
    intersector: Intersector,
    /// Range of coordinates at the moment that was interpolated last.
    range: geom::Range,
    pub(crate) positions: Vec<Point>,
    /// Runs of vertices that cover all moving ones, or one run of all vertices if too few are static to be worth
    /// skipping.
    runs: Vec<Range<usize>>,
    pub(crate) tree: Box<dyn Accelerator>,
    /// The tree that was evaluated last.
    candidate: Option<Candidate>,
    /// Counts from the last preprocess, including triangles without a leaf.
    pub(crate) unhittable: Unhittable,
    /// SAH cost from the last refit.
    pub(crate) sah_cost: Option<f64>,
    /// Number of rays resolved in exact arithmetic that no report includes yet.
    pub(crate) settled: AtomicU64,
}

/// A tree that is not current, with the boxes of the moment at which it was evaluated.
struct Candidate {
    generation: Generation,
    tree: Box<dyn Accelerator>,
}

impl SceneState {
    /// # Errors
    /// If memory does not suffice.
    pub(crate) fn new(
        animation: Arc<Animation>,
        intersector: Intersector,
        tree: Box<dyn Accelerator>,
    ) -> Result<Self> {
        let (mut positions, all) = (Vec::new(), animation.vertex_count());
        reserve(&mut positions, all, "positions")?;
        positions.resize(all, [0.0; 3]);
        // Static vertices outside the runs are written only here.
        copy(animation.first(), &mut positions);
        let parts = animation.static_parts();
        let pays = StaticParts::pays(all - parts.vertex_count(), all);
        let everything = std::iter::once(0..all);
        Ok(Self {
            runs: if pays {
                parts.moving_runs(GAP)
            } else {
                everything.collect()
            },
            range: geom::Range::ORDINARY,
            animation,
            intersector,
            positions,
            tree,
            candidate: None,
            unhittable: Unhittable::default(),
            sah_cost: None,
            settled: AtomicU64::new(0),
        })
    }

    /// # Errors
    /// If the tree does not belong to this scene, or memory does not suffice.
    pub(crate) fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        if let Some(candidate) = self
            .candidate
            .as_mut()
            .filter(|c| c.generation == generation)
        {
            std::mem::swap(&mut self.tree, &mut candidate.tree);
            // The replaced tree must not be adopted under this generation.
            candidate.generation = Generation(0);
            return Ok(());
        }
        self.check(tree)?;
        self.tree.adopt(tree, &self.animation)
    }

    /// Loads a tree for evaluation, into the last candidate or one from `new_tree`. Returns `false` if memory does not
    /// suffice.
    ///
    /// # Errors
    /// If the tree does not belong to this scene.
    pub(crate) fn load_candidate(
        &mut self,
        (tree, generation): (&Topology, Generation),
        new_tree: impl FnOnce() -> Box<dyn Accelerator>,
    ) -> Result<bool> {
        self.check(tree)?;
        let candidate = self.candidate.get_or_insert_with(|| Candidate {
            generation: Generation(0),
            tree: new_tree(),
        });
        if candidate.generation == generation {
            return Ok(true);
        }
        candidate.generation = Generation(0);
        match candidate.tree.adopt(tree, &self.animation) {
            Ok(()) => candidate.generation = generation,
            Err(BackendError::OutOfMemory { .. }) => return Ok(false),
            Err(e) => return Err(e),
        }
        Ok(true)
    }

    /// Refits the candidate and returns its SAH cost.
    pub(crate) fn evaluate(&mut self) -> Option<f64> {
        let geometry = geometry(&self.animation, &self.positions, self.range);
        let tree = &mut self.candidate.as_mut()?.tree;
        tree.preprocess(&geometry, self.intersector);
        let (total, root) = tree.refit();
        sah_cost(total, root.half_area())
    }

    fn check(&self, tree: &Topology) -> Result<()> {
        check_tree(tree, &self.animation)?;
        if tree.level_count() > MAX_DEPTH as usize + 1 {
            let (levels, limit) = (tree.level_count(), MAX_DEPTH + 1);
            let why = format!("it has {levels} levels, the limit is {limit}");
            return Err(BackendError::WrongTree(why));
        }
        Ok(())
    }

    pub(crate) fn interpolate(&mut self, pose: Pose) -> Result<()> {
        self.range = self.animation.range(pose);
        let moment = self.animation.moment(pose)?;
        interpolate(&moment, (&self.runs, &mut self.positions));
        Ok(())
    }

    pub(crate) fn preprocess(&mut self) {
        let without_leaf = self.animation.triangle_count() - self.animation.live_count();
        let geometry = geometry(&self.animation, &self.positions, self.range);
        self.unhittable = self.tree.preprocess(&geometry, self.intersector);
        self.unhittable.inactive += without_leaf as u64;
    }

    /// Updates the boxes and the tree's SAH cost.
    pub(crate) fn refit(&mut self) {
        let (total, root) = self.tree.refit();
        self.sah_cost = sah_cost(total, root.half_area());
    }

    pub(crate) fn trace(&self, query: Query<'_>, out: Output<'_>) -> Counts {
        let task = TraceTask {
            query,
            geometry: self.geometry(),
            intersector: self.intersector,
            settled: &self.settled,
        };
        self.tree.trace(task, out)
    }

    fn geometry(&self) -> Geometry<'_> {
        geometry(&self.animation, &self.positions, self.range)
    }

    /// Returns the boxes in node order, in the scene's units.
    #[cfg(feature = "inspect")]
    pub(crate) fn boxes(&self) -> Result<Vec<geom::Aabb>> {
        let geometry = self.geometry();
        let (boxes, scale) = (self.tree.boxes(&geometry)?, geometry.scale);
        Ok(boxes.into_iter().map(|b| scale.undo(b)).collect())
    }
}

fn geometry<'a>(
    animation: &'a Animation,
    positions: &'a [Point],
    range: geom::Range,
) -> Geometry<'a> {
    Geometry {
        positions,
        triangles: animation.triangles(),
        scale: Scale::of(animation),
        range,
    }
}
