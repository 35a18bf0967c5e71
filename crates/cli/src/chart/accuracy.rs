//! Rays of a scene with their exact answers; how often a way is wrong, and how far off where it is right.

use super::rays;
use crate::args::{BackendName, ChartArgs, IntersectorName, LayoutName, MethodArgs};
use crate::bench;
use crate::choose::{self, Ask};
use crate::session::{self, Session};
use crate::stop::Stop;
use backend::{Hits, Query, QueryKind, Rays};
use conformance::oracle::Oracle;
use geom::{Animation, Hit, Point, Ray};
use output::plot::{self, Aimed, TError};
use pipeline::{Frame, Update};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Moments of a scene at which it is traced.
const MOMENTS: usize = 4;
const MOST: usize = 1 << 20;

pub(super) struct GroundTruth {
    light: Point,
    sheets: Vec<Sheet>,
}

struct Sheet {
    time: f64,
    rays: Vec<Ray>,
    /// How many of them come first, before those that are aimed.
    plain: usize,
    /// By exact arithmetic: the triangle and the distance.
    closest: Vec<Option<(u32, f64)>>,
    /// By the reference: 1 where the hit is in shadow.
    blocked: Vec<u8>,
}

impl GroundTruth {
    pub(super) fn of(animation: &Arc<Animation>, args: &ChartArgs) -> Result<Self, Stop> {
        let view = output::frame_scene(animation, bench::FOV, args.size.size);
        let moments = rays::moments(animation, MOMENTS);
        let plain = args.rays.div_ceil(moments.len());
        let sheet = |&time: &f64| -> Result<_, Stop> {
            let rays = rays::at(animation, &view, time, plain);
            let oracle = Oracle::at(&animation.at(time).map_err(Stop::bad)?);
            let answer = |ray: &Ray| oracle.closest(ray).map(|hit| (hit.triangle, hit.t));
            Ok(Sheet {
                time,
                closest: rays.par_iter().map(answer).collect(),
                blocked: Vec::new(),
                plain,
                rays,
            })
        };
        let mut truth = Self {
            light: view.light,
            sheets: moments.iter().map(sheet).collect::<Result<_, _>>()?,
        };
        // Shadows are compared with those of `exact` on the host, over fresh trees.
        let method = MethodArgs {
            intersector: IntersectorName::Exact,
            layout: LayoutName::Bvh2,
        };
        let ask = Ask::of(BackendName::Cpu, method, choose::asked(Update::Rebuild));
        let mut reference = session::start(animation, &ask)?;
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

    /// Traces all rays one way.
    pub(super) fn judge(
        &self,
        animation: &Arc<Animation>,
        ask: &Ask<'_>,
    ) -> Result<AnswerCounts, Stop> {
        let mut session = session::start(animation, ask)?;
        let mut counts = AnswerCounts::default();
        self.trace(&mut session, |sheet, range, hits| {
            counts.add(sheet, range, hits);
        })?;
        Ok(counts)
    }

    /// Traces all by `session`, whose first tree is of the motion's begin; `hear` gets the sheet,
    /// which of its rays were traced, and what they hit.
    fn trace(
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

#[derive(Debug, Default)]
pub(super) struct AnswerCounts {
    tested: u64,
    wrong: u64,
    wrong_shadow: u64,
    aimed: Aimed,
    /// Of `t`, in units in the last place, where the triangle is right.
    errors: Vec<f64>,
}

impl AnswerCounts {
    fn add(&mut self, sheet: &Sheet, range: Range<usize>, hits: &Hits) {
        let answers = hits.closest.iter().zip(&hits.blocked);
        for (i, (hit, &blocked)) in range.zip(answers) {
            let truth = sheet.closest[i];
            let right = truth.map_or(!hit.is_hit(), |(triangle, _)| triangle == hit.triangle);
            if i >= sheet.plain {
                self.aimed.rays += 1;
                self.aimed.wrong += u64::from(!right);
                continue;
            }
            self.tested += 1;
            self.wrong += u64::from(!right);
            if !right {
                continue;
            }
            self.wrong_shadow += u64::from(blocked != sheet.blocked[i]);
            self.errors.extend(truth.map(|(_, t)| off(hit, t)));
        }
    }

    pub(super) fn enter(mut self, point: &mut plot::Point) {
        point.rays_tested = self.tested;
        point.wrong = self.wrong;
        point.wrong_shadow = self.wrong_shadow;
        point.aimed = self.aimed;
        self.errors.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| {
            let rank = (self.errors.len() as f64 * share).ceil() as usize;
            self.errors.get(rank.saturating_sub(1)).copied()
        };
        point.t_error_ulp = (!self.errors.is_empty()).then(|| TError {
            median: at(0.5),
            p999: at(0.999),
            worst: at(1.0),
        });
    }
}

/// How far a hit's `t` is from the exact one, in units in the last place of that, rounded to f32.
fn off(hit: &Hit, exact: f64) -> f64 {
    let rounded = (exact as f32).abs();
    let unit = f64::from(rounded.next_up()) - f64::from(rounded);
    (f64::from(hit.t) - exact).abs() / unit
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(triangle: u32, t: f32) -> Hit {
        Hit {
            t,
            triangle,
            ..Hit::MISS
        }
    }

    #[test]
    fn every_sort_of_fault_is_counted_where_it_belongs() {
        let sheet = Sheet {
            time: 0.0,
            rays: vec![Ray::new([0.0; 3], [1.0; 3]); 7],
            plain: 5,
            closest: [Some(1), Some(1), None, None, Some(1), Some(1), None]
                .map(|hit: Option<u32>| hit.map(|triangle| (triangle, 1.0)))
                .to_vec(),
            blocked: vec![1, 0, 0, 0, 0, 0, 0],
        };
        let next = 1.0_f32.next_up();
        let found = [
            hit(1, 1.0),
            hit(1, next),
            Hit::MISS,
            hit(1, 1.0),
            hit(2, 1.0),
            Hit::MISS,
            Hit::MISS,
        ];
        let mut counts = AnswerCounts::default();
        let part = |range: Range<usize>| Hits {
            closest: found[range.clone()].to_vec(),
            blocked: vec![0; range.len()],
        };
        // As if traced in two goes.
        counts.add(&sheet, 0..3, &part(0..3));
        counts.add(&sheet, 3..7, &part(3..7));
        let mut point = plot::Point::default();
        counts.enter(&mut point);
        assert_eq!((point.rays_tested, point.wrong), (5, 2));
        assert_eq!(point.wrong_shadow, 1);
        assert_eq!(point.aimed, Aimed { rays: 2, wrong: 1 });
        let t = point.t_error_ulp.unwrap();
        assert_eq!((t.median, t.worst), (Some(0.0), Some(1.0)));
    }

    #[test]
    fn distances_are_compared_before_they_are_rounded() {
        assert_eq!(off(&hit(0, 3.0), 3.0), 0.0);
        let half = 2.0 + f64::from(f32::EPSILON);
        assert_eq!(off(&hit(0, 2.0), half), 0.5);
        assert!(off(&hit(0, 0.0), 0.0) == 0.0);
    }
}
