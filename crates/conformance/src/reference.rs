//! What the reference answers.

use crate::Case;
use crate::stage::{ask, open, stand};
use backend::{Backend, FrameReport, Generation, Hits, Layout, Method, QueryKind, Rays, Result};
use bvh_layout::Topology;
use geom::Aabb;
use std::sync::Arc;

/// What a backend shows of a case at one moment.
#[derive(Debug, Default)]
pub(crate) struct Answer {
    pub(crate) hits: Hits,
    pub(crate) report: FrameReport,
    pub(crate) boxes: Vec<Aabb>,
}

impl Answer {
    /// The closest hits of the case's own rays, and the boxes, after all that was recorded.
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

/// The backend that others are compared with.
pub struct Reference {
    backend: Box<dyn Backend>,
    /// By which method the case at hand is loaded, if it is.
    loaded: Option<Method>,
}

impl Reference {
    /// A reference that has answered nothing yet.
    pub fn new(backend: Box<dyn Backend>) -> Self {
        Self {
            backend,
            loaded: None,
        }
    }

    /// What `rays` find at `time`, by the answers of `method`. Without a query: the boxes of the tree built at the
    /// case's first moment, and counts of triangles.
    pub(crate) fn answer(
        &mut self,
        case: &Case,
        (method, time): (Method, f64),
        query: Option<(Rays<'_>, QueryKind)>,
    ) -> Result<Answer> {
        // The layout changes no answer.
        let layout = Layout::Bvh2;
        let method = Method { layout, ..method };
        let backend = self.backend.as_mut();
        if self.loaded != Some(method) {
            open(backend, &case.animation, case.times[0], method)?;
            self.loaded = Some(method);
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

    /// The closest hits of the case's own rays at `time`, and the boxes, by the usual method with this tree.
    pub(crate) fn by_tree(&mut self, case: &Case, tree: &Topology, time: f64) -> Result<Answer> {
        let backend = self.backend();
        backend.load(Arc::clone(&case.animation), Method::default())?;
        backend.adopt(tree, Generation(1))?;
        stand(backend, &case.animation, time)?;
        Answer::of(backend, case)
    }

    /// The backend itself, for other cases, scenes and trees.
    pub(crate) fn backend(&mut self) -> &mut dyn Backend {
        self.loaded = None;
        self.backend.as_mut()
    }
}
