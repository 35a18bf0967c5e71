//! Rays of a scene with their exact answers.

use super::plan::Way;
use super::rays;
use crate::args::{BackendName, ChartArgs, IntersectorName, LayoutName, MethodArgs};
use crate::bench;
use crate::choose;
use crate::session::{self, Session};
use crate::stop::Stop;
use backend::{Hits, Query, QueryKind, Rays};
use conformance::oracle::Oracle;
use geom::{Animation, Point, Ray};
use pipeline::{Frame, Update};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Moments of a scene at which it is traced.
const MOMENTS: usize = 4;
/// The most rays of one trace.
const MOST: usize = 1 << 20;

/// Rays and their answers.
pub(super) struct GroundTruth {
    light: Point,
    sheets: Vec<Sheet>,
}

/// Those of one moment.
pub(super) struct Sheet {
    pub(super) time: f64,
    pub(super) rays: Vec<Ray>,
    /// How many of them come first, before those that are aimed.
    pub(super) plain: usize,
    /// By exact arithmetic: the triangle and the distance.
    pub(super) closest: Vec<Option<(u32, f64)>>,
    /// By the reference: 1 where the hit is in shadow.
    pub(super) blocked: Vec<u8>,
}

impl GroundTruth {
    /// For a scene.
    pub(super) fn of(animation: &Arc<Animation>, args: &ChartArgs) -> Result<Self, Stop> {
        let view = output::frame_scene(animation, bench::FOV, args.size.size);
        let moments = rays::moments(animation, MOMENTS);
        let plain = args.rays.div_ceil(moments.len());
        let sheet = |&time: &f64| {
            let rays = rays::at(animation, &view, time, plain);
            let oracle = Oracle::at(animation, animation.pose(time));
            let answer = |ray: &Ray| oracle.closest(ray).map(|hit| (hit.triangle, hit.t));
            Sheet {
                time,
                closest: rays.par_iter().map(answer).collect(),
                blocked: Vec::new(),
                plain,
                rays,
            }
        };
        let mut truth = Self {
            light: view.light,
            sheets: moments.iter().map(sheet).collect(),
        };
        // Shadows are compared with those of `exact` on the host, over fresh trees.
        let reference = Way {
            backend: BackendName::Cpu,
            named: true,
            method: MethodArgs {
                intersector: IntersectorName::Exact,
                layout: LayoutName::Bvh2,
            },
            update: choose::asked(Update::Rebuild),
        };
        let mut reference = session::start(animation, &reference.ask())?;
        let mut shadows = Vec::new();
        truth.trace(&mut reference, |_, _, hits| {
            shadows.extend_from_slice(&hits.blocked)
        })?;
        for sheet in &mut truth.sheets {
            let rest = shadows.split_off(sheet.rays.len());
            sheet.blocked = std::mem::replace(&mut shadows, rest);
        }
        Ok(truth)
    }

    /// Traces all by `session`, whose first tree is of the motion's begin; `hear` gets the sheet,
    /// which of its rays were traced, and what they hit.
    pub(super) fn trace(
        &self,
        session: &mut Session,
        mut hear: impl FnMut(&Sheet, Range<usize>, &Hits),
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
            for rays in sheet.rays.chunks(MOST) {
                let hits = trace(sheet.time, rays)?;
                hear(sheet, done..done + rays.len(), &hits);
                done += rays.len();
            }
        }
        Ok(())
    }
}
