//! Results of the reference backend.

use crate::Case;
use crate::stage::{Traced, interpolate_and_refit, open, trace_and_wait};
use backend::{Generation, Inspect, Intersector, Query, QueryKind, Rays, Result};
use bvh_layout::Topology;
use geom::Aabb;
use std::sync::Arc;

/// Results of a frame, with the boxes of its tree.
#[derive(Debug)]
pub(crate) struct FrameResults {
    pub(crate) traced: Traced,
    pub(crate) boxes: Vec<Aabb>,
}

impl FrameResults {
    /// Traces the case's rays after all recorded commands. Returns the closest hits and the boxes.
    pub(crate) fn of(backend: &mut dyn Inspect, case: &Case) -> Result<Self> {
        Ok(Self {
            traced: trace_and_wait(backend, Rays::List(&case.rays), QueryKind::Closest)?,
            boxes: backend.boxes()?,
        })
    }
}

/// The backend with which others are compared.
pub struct Reference {
    backend: Box<dyn Inspect>,
    /// Intersector with which the current case is loaded, or `None` if it is not loaded.
    loaded: Option<Intersector>,
}

impl Reference {
    /// Creates a reference with no case loaded.
    pub fn new(backend: Box<dyn Inspect>) -> Self {
        Self {
            backend,
            loaded: None,
        }
    }

    /// Traces a query at `time`, by `intersector`.
    pub(crate) fn trace(
        &mut self,
        case: &Case,
        intersector: Intersector,
        time: f64,
        query: Query<'_>,
    ) -> Result<Traced> {
        let backend = self.backend.as_mut();
        if self.loaded != Some(intersector) {
            open(backend, &case.animation, case.times[0], intersector)?;
            self.loaded = Some(intersector);
        }
        interpolate_and_refit(backend, &case.animation, time)?;
        trace_and_wait(backend, query.rays, query.kind)
    }

    /// Returns the closest hits of the case's rays at `time` with `intersector`, and the boxes of `tree`.
    pub(crate) fn by_tree(
        &mut self,
        case: &Case,
        intersector: Intersector,
        tree: &Topology,
        time: f64,
    ) -> Result<FrameResults> {
        self.unload();
        let backend = self.backend.as_mut();
        backend.load(Arc::clone(&case.animation), intersector)?;
        backend.adopt(tree, Generation(1))?;
        interpolate_and_refit(backend, &case.animation, time)?;
        FrameResults::of(backend, case)
    }

    /// Marks the current case as not loaded. The next trace loads its case.
    pub(crate) fn unload(&mut self) {
        self.loaded = None;
    }
}
