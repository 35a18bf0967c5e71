//! How often a way is wrong, and how far off where it is right.

use super::truth::{GroundTruth, Sheet};
use crate::session::{self, Ask};
use crate::stop::Stop;
use backend::Hits;
use geom::Hit;
use output::plot::{Aimed, Point, TError};
use scene::Scene;
use std::ops::Range;

/// What became of a scene's rays.
#[derive(Debug, Default)]
pub(super) struct AnswerCounts {
    tested: u64,
    wrong: u64,
    wrong_shadow: u64,
    aimed: Aimed,
    /// Of `t`, in units in the last place, where the triangle is right.
    errors: Vec<f64>,
}

/// Traces all rays one way.
pub(super) fn judge(
    scene: &Scene,
    ask: &Ask<'_>,
    truth: &GroundTruth,
) -> Result<AnswerCounts, Stop> {
    let mut session = session::start(&scene.animation, ask)?;
    let mut counts = AnswerCounts::default();
    truth.trace(&mut session, |sheet, range, hits| {
        counts.add(sheet, range, hits);
    })?;
    Ok(counts)
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

    /// Writes it into a point.
    pub(super) fn enter(mut self, point: &mut Point) {
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
    use geom::Ray;

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
        let mut point = Point::default();
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
