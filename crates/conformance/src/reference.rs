//! Results of the reference backend.

use crate::Case;
use crate::stage::{ask, open, stand};
use backend::{Backend, FrameReport, Generation, Hits, Intersector, QueryKind, Rays, Result};
use bvh_layout::Topology;
use geom::Aabb;
use std::sync::Arc;

/// Results of a backend for a case at one time.
#[derive(Debug, Default)]
pub(crate) struct Answer {
    pub(crate) hits: Hits,
    pub(crate) report: FrameReport,
    pub(crate) boxes: Vec<Aabb>,
}

impl Answer {
    /// Returns the closest hits of the case's rays, and the boxes, after all recorded commands.
    pub(crate) fn of(backend: &mut dyn Backend, case: &Case) -> Result<Self> {
        let (hits, report) = ask(backend, Rays::List(&case.rays), QueryKind::Closest)?;
        let boxes = backend.inspect().boxes()?;
        Ok(Self {
            hits,
            report,
            boxes,
        })
    }
}

/// The backend with which others are compared.
pub struct Reference {
    backend: Box<dyn Backend>,
    /// Intersector with which the current case is loaded, or `None` if it is not loaded.
    loaded: Option<Intersector>,
}

impl Reference {
    /// Creates a reference with no case loaded.
    pub fn new(backend: Box<dyn Backend>) -> Self {
        Self {
            backend,
            loaded: None,
        }
    }

    /// Returns the results of a query at `time`.
    ///
    /// Without a query, returns the boxes of the tree built at the case's first time, and the counts of triangles.
    pub(crate) fn answer(
        &mut self,
        case: &Case,
        (intersector, time): (Intersector, f64),
        query: Option<(Rays<'_>, QueryKind)>,
    ) -> Result<Answer> {
        let backend = self.backend.as_mut();
        if self.loaded != Some(intersector) {
            open(backend, &case.animation, case.times[0], intersector)?;
            self.loaded = Some(intersector);
        }
        stand(backend, &case.animation, time)?;
        let mut answer = Answer::default();
        if let Some((rays, kind)) = query {
            (answer.hits, answer.report) = ask(backend, rays, kind)?;
        } else {
            let ticket = backend.submit()?;
            answer.report = backend.wait(ticket)?;
            answer.boxes = backend.inspect().boxes()?;
        }
        Ok(answer)
    }

    /// Returns the closest hits of the case's rays at `time`, and the boxes, with the default intersector and this tree.
    pub(crate) fn by_tree(&mut self, case: &Case, tree: &Topology, time: f64) -> Result<Answer> {
        let backend = self.backend();
        backend.load(Arc::clone(&case.animation), Intersector::Watertight)?;
        backend.adopt(tree, Generation(1))?;
        stand(backend, &case.animation, time)?;
        Answer::of(backend, case)
    }

    /// Returns the backend, for other cases, scenes and trees.
    pub(crate) fn backend(&mut self) -> &mut dyn Backend {
        self.loaded = None;
        self.backend.as_mut()
    }
}
