//! What the answers are.

use super::questions::{Questions, moments};
use crate::args::{BackendName, ChartArgs, IntersectorName, LayoutName, MethodArgs};
use crate::bench;
use crate::choose::{self, Ahead};
use crate::session::{self, Ask, Session};
use crate::stop::Stop;
use backend::{Hits, Query, QueryKind, Rays};
use conformance::oracle::Oracle;
use geom::{Animation, Point, Ray};
use pipeline::{Frame, Update};
use rayon::prelude::*;
use std::sync::Arc;

/// Moments of a scene at which it is asked.
const MOMENTS: usize = 4;
/// The most rays of one trace.
const MOST: usize = 1 << 20;

/// Questions and their answers.
pub(super) struct GroundTruth {
    pub(super) light: Point,
    pub(super) sheets: Vec<Sheet>,
}

/// Those of one moment.
pub(super) struct Sheet {
    pub(super) questions: Questions,
    /// By exact arithmetic: the triangle and the distance.
    pub(super) closest: Vec<Option<(u32, f64)>>,
    /// By `exact` on the host: 1 where the hit is in shadow.
    pub(super) blocked: Vec<u8>,
}

impl GroundTruth {
    /// For a scene.
    pub(super) fn of(animation: &Arc<Animation>, args: &ChartArgs) -> Result<Self, Stop> {
        let view = output::frame_scene(animation, bench::FOV, args.size.size);
        let moments = moments(animation, MOMENTS);
        let share = args.rays.div_ceil(moments.len());
        let sheets = moments.iter().map(|&time| {
            let questions = Questions::at(animation, &view, time, share);
            let oracle = Oracle::at(animation, animation.pose(time));
            let answer = |ray: &Ray| oracle.closest(ray).map(|hit| (hit.triangle, hit.t));
            Sheet {
                closest: questions.rays.par_iter().map(answer).collect(),
                blocked: Vec::new(),
                questions,
            }
        });
        let mut truth = Self {
            light: view.light,
            sheets: sheets.collect(),
        };
        let mut shadows = Vec::new();
        let mut judge = session::start(animation, &reference())?;
        truth.ask(&mut judge, |_, range, hits| {
            if range.start == 0 {
                shadows.push(Vec::new());
            }
            if let Some(all) = shadows.last_mut() {
                all.extend_from_slice(&hits.blocked);
            }
        })?;
        for (sheet, blocked) in truth.sheets.iter_mut().zip(shadows) {
            sheet.blocked = blocked;
        }
        Ok(truth)
    }

    /// Rays in all.
    pub(super) fn rays(&self) -> usize {
        self.sheets.iter().map(|s| s.questions.rays.len()).sum()
    }

    /// Asks everything of `session`, whose first tree stands at the motion's begin; `hear` gets the sheet,
    /// which of its rays were asked, and what they hit.
    pub(super) fn ask(
        &self,
        session: &mut Session,
        mut hear: impl FnMut(&Sheet, std::ops::Range<usize>, &Hits),
    ) -> Result<(), Stop> {
        let mut index = 0;
        let mut hits = Hits::default();
        let mut trace = |time: f64, rays: &[Ray]| {
            let query = Query {
                rays: Rays::List(rays),
                kind: QueryKind::ClosestAndShadow { light: self.light },
            };
            session.driver.begin(Frame { index, time }, query)?;
            session.driver.finish(Some(&mut hits))?;
            index += 1;
            Ok::<_, Stop>(std::mem::take(&mut hits))
        };
        trace(0.0, &[])?;
        for sheet in &self.sheets {
            let mut done = 0;
            for rays in sheet.questions.rays.chunks(MOST) {
                let hits = trace(sheet.questions.time, rays)?;
                hear(sheet, done..done + rays.len(), &hits);
                done += rays.len();
            }
        }
        Ok(())
    }
}

/// The host, by `exact`, over fresh trees.
fn reference() -> Ask<'static> {
    Ask {
        backend: BackendName::Cpu,
        adapter: None,
        threads: None,
        builder_threads: None,
        method: MethodArgs {
            intersector: IntersectorName::Exact,
            layout: LayoutName::Bvh2,
        },
        update: choose::asked(Update::Rebuild),
        tolerance: 0.0,
        run: None,
        ahead: Ahead::default(),
    }
}
