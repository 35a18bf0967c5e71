//! The loaded scene: an animation, its current tree, and all data computed from them.

use crate::accelerator::{Accelerator, reserve};
use crate::geometry::{Geometry, Unhittable};
use crate::interpolate::interpolate;
use crate::output::{HitCounts, TraceOutput};
use crate::scale::Scale;
use crate::shadow::Light;
use crate::trace::QueryTracer;
use backend::{BackendError, Generation, Intersector, Query, Result, check_tree, sah_cost};
use bvh_layout::Topology;
use geom::{Animation, Point, Pose, StaticParts, copy_in_parallel};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// Runs of moving vertices are merged if fewer static vertices than this separate them, because one longer run is
/// cheaper.
const GAP: usize = 64;

/// An animation with its tree, at one moment.
pub(crate) struct SceneState {
    animation: Arc<Animation>,
    intersector: Intersector,
    /// Range of coordinates at the moment that was interpolated last.
    range: geom::CoordinateRange,
    pub(crate) positions: Vec<Point>,
    /// Runs of vertices to interpolate. They contain all moving vertices, or simply all vertices if few are static.
    runs: Vec<Range<usize>>,
    pub(crate) accelerator: Box<dyn Accelerator>,
    /// The tree that was evaluated last, with the boxes of that moment. If it was adopted, the tree that it replaced.
    candidate: Box<dyn Accelerator>,
    /// Generation of `candidate`; 0 if it must be loaded before use.
    candidate_generation: Generation,
    /// Counts from the last preprocess, including triangles without a leaf.
    pub(crate) unhittable: Unhittable,
    /// SAH cost from the last refit.
    pub(crate) sah_cost: Option<f64>,
    /// Number of rays resolved in exact arithmetic that no report includes yet.
    pub(crate) exact_rays: AtomicU64,
}

impl SceneState {
    /// Creates the state of a scene. All vertices have the positions of the first key frame. `new_tree` creates empty
    /// trees.
    ///
    /// # Errors
    /// If memory does not suffice.
    pub(crate) fn new(
        animation: Arc<Animation>,
        intersector: Intersector,
        new_tree: impl Fn() -> Box<dyn Accelerator>,
    ) -> Result<Self> {
        let (mut positions, all) = (Vec::new(), animation.vertex_count());
        reserve(&mut positions, all, "positions")?;
        positions.resize(all, [0.0; 3]);
        // Static vertices outside the runs are written only here.
        copy_in_parallel(&mut positions, animation.first());
        let parts = animation.static_parts();
        let pays = StaticParts::pays(all - parts.vertex_count(), all);
        let everything = std::iter::once(0..all);
        Ok(Self {
            runs: if pays {
                parts.moving_runs(GAP)
            } else {
                everything.collect()
            },
            range: geom::CoordinateRange::ORDINARY,
            animation,
            intersector,
            positions,
            accelerator: new_tree(),
            candidate: new_tree(),
            candidate_generation: Generation(0),
            unhittable: Unhittable::default(),
            sah_cost: None,
            exact_rays: AtomicU64::new(0),
        })
    }

    /// # Errors
    /// If the tree does not belong to this scene, or memory does not suffice.
    pub(crate) fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        if self.candidate_generation == generation {
            std::mem::swap(&mut self.accelerator, &mut self.candidate);
            self.candidate_generation = Generation(0);
            return Ok(());
        }
        check_tree(tree, &self.animation)?;
        self.accelerator.adopt(tree, &self.animation)
    }

    /// Loads a tree for evaluation, in the memory of the last candidate. Returns `false` if memory does not suffice.
    ///
    /// # Errors
    /// If the tree does not belong to this scene.
    pub(crate) fn load_candidate(
        &mut self,
        tree: &Topology,
        generation: Generation,
    ) -> Result<bool> {
        check_tree(tree, &self.animation)?;
        if self.candidate_generation == generation {
            return Ok(true);
        }
        self.candidate_generation = Generation(0);
        match self.candidate.adopt(tree, &self.animation) {
            Ok(()) => self.candidate_generation = generation,
            Err(BackendError::OutOfMemory { .. }) => return Ok(false),
            Err(e) => return Err(e),
        }
        Ok(true)
    }

    /// Refits the candidate and returns its SAH cost.
    pub(crate) fn evaluate(&mut self) -> Option<f64> {
        let geometry = geometry(&self.animation, &self.positions, self.range);
        self.candidate.preprocess(&geometry, self.intersector);
        Self::cost(&mut *self.candidate)
    }

    pub(crate) fn interpolate(&mut self, pose: Pose) -> Result<()> {
        self.range = self.animation.range(pose);
        let moment = self.animation.moment(pose)?;
        interpolate(&moment, &self.runs, &mut self.positions);
        Ok(())
    }

    pub(crate) fn preprocess(&mut self) {
        let without_leaf = self.animation.triangle_count() - self.animation.live_count();
        let geometry = geometry(&self.animation, &self.positions, self.range);
        self.unhittable = self.accelerator.preprocess(&geometry, self.intersector);
        self.unhittable.inactive += without_leaf as u64;
    }

    /// Updates the boxes and the tree's SAH cost.
    pub(crate) fn refit(&mut self) {
        self.sah_cost = Self::cost(&mut *self.accelerator);
    }

    /// Refits a tree and returns its SAH cost.
    fn cost(accelerator: &mut dyn Accelerator) -> Option<f64> {
        let areas = accelerator.refit();
        sah_cost(areas, accelerator.tree().root().half_area())
    }

    pub(crate) fn trace(&self, query: Query<'_>, out: TraceOutput<'_>) -> HitCounts {
        let (geometry, tree) = (self.geometry(), self.accelerator.tree());
        let light = query.kind.light();
        let tracer = QueryTracer {
            query,
            tree,
            geometry,
            intersector: self.intersector,
            light: light.map(|at| Light::new(at, &geometry, &tree.root())),
            exact_rays: &self.exact_rays,
        };
        self.accelerator.trace(&tracer, out)
    }

    fn geometry(&self) -> Geometry<'_> {
        geometry(&self.animation, &self.positions, self.range)
    }

    /// Returns the boxes in breadth-first order, in the scene's units.
    #[cfg(feature = "inspect")]
    pub(crate) fn boxes(&self) -> Result<Vec<geom::Aabb>> {
        let geometry = self.geometry();
        let (boxes, scale) = (self.accelerator.boxes(&geometry)?, geometry.scale);
        Ok(boxes.into_iter().map(|b| scale.undo(b)).collect())
    }
}

fn geometry<'a>(
    animation: &'a Animation,
    positions: &'a [Point],
    range: geom::CoordinateRange,
) -> Geometry<'a> {
    Geometry {
        positions,
        triangles: animation.triangles(),
        scale: Scale::of(animation),
        range,
    }
}
