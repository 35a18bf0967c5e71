//! The table of all properties.

mod answers;
mod far;
mod frames;
mod paged;
mod reports;
mod streamed;
mod trees;
mod walk;

use crate::stage::{self, open};
use crate::{Case, Reference};
use anyhow::Result;
use backend::{Hits, Inspect, Intersector, QueryKind, Rays};

/// Selects the intersectors with which a property is tested, one after the other.
type Intersectors = fn(&Check<'_>) -> Vec<Intersector>;

/// A property of backends.
#[derive(Clone, Copy)]
pub struct Property {
    /// Name of the property, as a sentence with underscores.
    pub name: &'static str,
    intersectors: Intersectors,
    /// The name of `intersectors` in the table of properties.
    intersector_set: &'static str,
    /// Whether only the default intersector is tested, in the cases that include it.
    is_narrowed: bool,
    /// Test of the property. The error describes how subject and reference disagree.
    pub(crate) check: fn(&mut Check<'_>) -> Result<()>,
}

impl Property {
    /// Returns this property for the default intersector alone, or `None` if it applies only to `exact`. Cases with
    /// other intersectors are skipped.
    #[must_use]
    pub fn by_usual_intersector(self) -> Option<Self> {
        (self.intersector_set != "exact").then_some(Self {
            is_narrowed: true,
            ..self
        })
    }

    /// Returns the intersectors with which a case is tested.
    pub(crate) fn intersectors_of(&self, check: &Check<'_>) -> Vec<Intersector> {
        let mut all = (self.intersectors)(check);
        all.retain(|intersector| !self.is_narrowed || usual(check).contains(intersector));
        all
    }
}

/// Inputs of a test.
pub(crate) struct Check<'a> {
    pub(crate) case: &'a Case,
    pub(crate) subject: &'a mut dyn Inspect,
    pub(crate) reference: &'a mut Reference,
    /// Intersector with which the subject traces.
    pub(crate) intersector: Intersector,
}

impl<'a> Check<'a> {
    /// Loads the case into the subject, with a tree built at `time`.
    fn open(&mut self, time: f64) -> backend::Result<()> {
        open(self.subject, &self.case.animation, time, self.intersector)
    }

    /// Records `interpolate`, `preprocess` and `refit` at `time`.
    fn interpolate_and_refit(&mut self, time: f64) -> backend::Result<()> {
        stage::interpolate_and_refit(self.subject, &self.case.animation, time)
    }

    fn interpolate(&mut self, time: f64) -> backend::Result<()> {
        self.subject.interpolate(self.case.animation.pose(time))
    }

    fn trace_and_wait(&mut self, rays: Rays<'_>, kind: QueryKind) -> backend::Result<Hits> {
        Ok(stage::trace_and_wait(self.subject, rays, kind)?.hits)
    }

    /// Returns the closest hits of the case's rays.
    fn closest(&mut self) -> backend::Result<Hits> {
        self.trace_and_wait(self.rays(), QueryKind::Closest)
    }

    fn rays(&self) -> Rays<'a> {
        let case: &'a Case = self.case;
        Rays::List(&case.rays)
    }
}

fn all(_: &Check<'_>) -> Vec<Intersector> {
    Intersector::ALL.into()
}

/// Returns the default intersector.
fn usual(_: &Check<'_>) -> Vec<Intersector> {
    vec![Intersector::Watertight]
}

fn exact(_: &Check<'_>) -> Vec<Intersector> {
    vec![Intersector::Exact]
}

/// Returns the intersectors whose results are the same on every backend.
fn robust(_: &Check<'_>) -> Vec<Intersector> {
    let mut all = Intersector::ALL.to_vec();
    all.retain(|i| i.is_equal_across_backends());
    all
}

fn all_in_turn(c: &Check<'_>) -> Vec<Intersector> {
    in_turn(c, &all(c))
}

fn robust_in_turn(c: &Check<'_>) -> Vec<Intersector> {
    in_turn(c, &robust(c))
}

/// Returns one intersector, which rotates with the case number. A few consecutive cases together test all of `all`.
fn in_turn(c: &Check<'_>, all: &[Intersector]) -> Vec<Intersector> {
    vec![all[c.case.number as usize % all.len()]]
}

/// Defines one property per line: its intersectors, its name and its test.
macro_rules! properties {
    ($($intersectors:ident $name:ident: $check:expr;)+) => {
        &[$(Property {
            name: stringify!($name),
            intersectors: $intersectors,
            intersector_set: stringify!($intersectors),
            is_narrowed: false,
            check: $check,
        },)+]
    };
}

/// All properties.
pub const PROPERTIES: &[Property] = properties! {
    robust_in_turn frames_equal_the_reference_after_any_commands: frames::after_commands;
    usual reports_time_only_recorded_stages: reports::stages;
    usual paged_key_frames_have_the_positions_of_held_ones: paged::positions;
    robust_in_turn the_device_measures_streamed_vertices: streamed::measured;
    robust streamed_key_frames_are_played_like_held_ones: streamed::pushed;
    robust hits_equal_the_reference: answers::listed;
    robust pictures_and_shadows_equal_the_reference: answers::shadows;
    all camera_matches_listed_rays: answers::camera_is_rays;
    all any_hit_agrees_with_closest_hit: answers::any_is_closest;
    all batched_queries_match_separate_queries: answers::together;
    exact continued_rays_visit_every_crossing_once: walk::visits_every_crossing_once;
    all_in_turn far_geometry_does_not_change_hits: far::apart;
    usual closed_bodies_do_not_leak: answers::leaks;
    all tree_age_does_not_change_hits: trees::age;
    all tree_shape_does_not_change_hits: trees::shape;
    usual tree_swap_does_not_change_hits: trees::swap;
    all uploaded_tree_is_the_one_adopted: trees::uploaded;
    robust evaluation_does_not_change_results: trees::evaluated;
    usual device_built_tree_is_valid: trees::device_built;
    all_in_turn device_build_does_not_change_hits: trees::same_hits;
    usual trees_of_other_scenes_are_refused: trees::of_other_scenes;
    usual tickets_are_ordered_and_results_kept: reports::tickets;
    usual reloading_resets_all_state: reports::reload;
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nth_case;
    use cpu_ref::CpuBackend;

    /// The command that repeats a failed case tests all intersectors of the property.
    #[test]
    fn narrowed_properties_test_only_their_own_intersectors() {
        let backend = || CpuBackend::new(Some(1)).unwrap();
        let (mut subject, mut reference) = (backend(), Reference::new(Box::new(backend())));
        let cases = [0, 1, 2, 3].map(|number| nth_case(1, number));
        for property in PROPERTIES {
            let Some(narrowed) = property.by_usual_intersector() else {
                continue;
            };
            let mut tested = Vec::new();
            for case in &cases {
                let check = Check {
                    case,
                    subject: &mut subject,
                    reference: &mut reference,
                    intersector: Intersector::Watertight,
                };
                let own = property.intersectors_of(&check);
                let fewer = narrowed.intersectors_of(&check);
                assert!(fewer.iter().all(|i| own.contains(i)), "{}", property.name);
                tested.extend(fewer);
            }
            tested.dedup();
            assert_eq!(tested, [Intersector::Watertight], "{}", property.name);
        }
    }
}
