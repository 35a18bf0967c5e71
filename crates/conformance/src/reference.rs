//! What the reference answers.

use crate::Case;
use crate::stage::{ask, open, stand};
use backend::{Backend, FrameReport, Hits, Layout, Method, QueryKind, Rays};
use geom::Aabb;

/// What a backend shows of a case at one moment.
#[derive(Debug, Default)]
pub(crate) struct Answer {
    pub(crate) hits: Hits,
    pub(crate) report: FrameReport,
    pub(crate) boxes: Vec<Aabb>,
}

/// The backend that others are compared with.
pub struct Reference {
    backend: Box<dyn Backend>,
    /// By which method the case at hand is loaded, if it is.
    loaded: Option<Method>,
}

impl Reference {
    /// A reference that has answered nothing yet.
    #[must_use]
    pub fn new(backend: Box<dyn Backend>) -> Self {
        Self {
            backend,
            loaded: None,
        }
    }

    /// Whether it has a method that gives the answers of `method`, whatever the layout.
    pub(crate) fn supports(&self, method: Method) -> bool {
        self.backend.supports(usual(method))
    }

    /// What `rays` find at `time`, by the answers of `method`. Without a query: the boxes of the tree built at the
    /// case's first moment, and counts of triangles.
    pub(crate) fn answer(
        &mut self,
        case: &Case,
        (method, time): (Method, f64),
        query: Option<(Rays<'_>, QueryKind)>,
    ) -> backend::Result<Answer> {
        let method = usual(method);
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

    /// The backend itself, for other cases, scenes and trees.
    pub(crate) fn backend(&mut self) -> &mut dyn Backend {
        self.loaded = None;
        self.backend.as_mut()
    }
}

/// The method of the usual layout that gives the same answers.
fn usual(method: Method) -> Method {
    let layout = Layout::Bvh2;
    Method { layout, ..method }
}
