//! What the reference answers, found once a case, method, moment and question.

use crate::stage::{ask, open, stand};
use crate::{Case, Trial};
use backend::{Backend, FrameReport, Hits, Layout, Method, QueryKind, Rays};
use geom::Aabb;
use std::collections::HashMap;
use std::mem::{Discriminant, discriminant};
use std::sync::Arc;

/// Answers that are kept: about 5 KB each.
const KEPT: usize = 1 << 13;

/// What is looked at: of a case's own rays (or its camera's), by kind of query; `None` for boxes.
type Question = Option<(bool, Discriminant<QueryKind>)>;

type Key = ((u64, Trial), Method, u64, Question);

/// What the reference shows of a case at one moment.
#[derive(Debug, Default)]
pub(crate) struct Answer {
    pub(crate) hits: Hits,
    pub(crate) report: FrameReport,
    /// Found only where no rays are traced.
    pub(crate) boxes: Vec<Aabb>,
}

/// The backend that others are compared with. It remembers what it answered.
pub struct Reference {
    backend: Box<dyn Backend>,
    known: HashMap<Key, Arc<Answer>>,
    case: Option<(u64, Trial)>,
    /// By which method the case at hand is loaded, if it is.
    loaded: Option<Method>,
}

impl Reference {
    /// A reference that has answered nothing yet.
    #[must_use]
    pub fn new(backend: Box<dyn Backend>) -> Self {
        Self {
            backend,
            known: HashMap::new(),
            case: None,
            loaded: None,
        }
    }

    /// From now on, answers are about this case.
    pub(crate) fn begin(&mut self, case: (u64, Trial)) {
        (self.case, self.loaded) = (Some(case), None);
    }

    /// Whether it has a method that gives the answers of `method`, whatever the layout.
    pub(crate) fn supports(&self, method: Method) -> bool {
        self.backend.supports(usual(method))
    }

    /// What `rays` of the case (its list or its camera) find at `time`, by the answers of `method`.
    pub(crate) fn answer(
        &mut self,
        case: &Case,
        at: (Method, f64),
        rays: Rays<'_>,
        kind: QueryKind,
    ) -> backend::Result<Arc<Answer>> {
        self.look(case, at, Some((rays, kind)))
    }

    /// The boxes at `time` of the tree built at the case's first moment, and counts of triangles.
    pub(crate) fn boxes(&mut self, case: &Case, at: (Method, f64)) -> backend::Result<Arc<Answer>> {
        self.look(case, at, None)
    }

    fn look(
        &mut self,
        case: &Case,
        (method, time): (Method, f64),
        query: Option<(Rays<'_>, QueryKind)>,
    ) -> backend::Result<Arc<Answer>> {
        let method = usual(method);
        let id = self.case.expect("a case was begun");
        let question =
            query.map(|(rays, kind)| (matches!(rays, Rays::Camera(_)), discriminant(&kind)));
        let key = (id, method, time.to_bits(), question);
        if let Some(known) = self.known.get(&key) {
            return Ok(Arc::clone(known));
        }
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
        let answer = Arc::new(answer);
        if self.known.len() >= KEPT {
            self.known.clear();
        }
        self.known.insert(key, Arc::clone(&answer));
        Ok(answer)
    }

    /// The backend itself, for scenes and trees that no other question is about.
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
