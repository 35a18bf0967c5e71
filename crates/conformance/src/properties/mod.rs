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

/// Selects the intersectors with which a property is tested on the case with this number, one after the other.
type Intersectors = fn(u32) -> Vec<Intersector>;

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
    /// Test of the property. The error describes the failure: the result, and the expected one.
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

    /// Returns the numbers of all cases that test the property.
    pub fn case_numbers(&self) -> impl Iterator<Item = u32> {
        (0..=u32::MAX).filter(move |&number| !self.intersectors_of(number).is_empty())
    }

    /// Returns the intersectors with which the case with this number is tested. They are empty if it is skipped.
    pub(crate) fn intersectors_of(&self, number: u32) -> Vec<Intersector> {
        let mut all = (self.intersectors)(number);
        all.retain(|intersector| !self.is_narrowed || usual(number).contains(intersector));
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

fn all(_: u32) -> Vec<Intersector> {
    Intersector::ALL.into()
}

/// Returns the default intersector.
fn usual(_: u32) -> Vec<Intersector> {
    vec![Intersector::Watertight]
}

fn exact(_: u32) -> Vec<Intersector> {
    vec![Intersector::Exact]
}

/// Returns the intersectors whose results are the same on every backend.
fn robust(_: u32) -> Vec<Intersector> {
    let mut all = Intersector::ALL.to_vec();
    all.retain(|i| i.is_equal_across_backends());
    all
}

fn all_in_turn(number: u32) -> Vec<Intersector> {
    in_turn(number, &all(number))
}

fn robust_in_turn(number: u32) -> Vec<Intersector> {
    in_turn(number, &robust(number))
}

/// Returns one intersector, which rotates with the case number. A few consecutive cases together test all of `all`.
fn in_turn(number: u32, all: &[Intersector]) -> Vec<Intersector> {
    vec![all[number as usize % all.len()]]
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
    usual only_recorded_stages_have_times: reports::stages;
    usual paged_key_frames_have_the_positions_of_held_ones: paged::positions;
    robust_in_turn device_measured_range_does_not_change_hits: streamed::measured;
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
    use crate::{Cases, check_property};
    use cpu_ref::CpuBackend;

    /// The command printed for a failed case tests the whole property. It repeats the failure only if the whole
    /// property tests the same intersector on that case.
    #[test]
    fn narrowed_properties_test_only_their_own_intersectors() {
        for property in PROPERTIES {
            let Some(narrowed) = property.by_usual_intersector() else {
                continue;
            };
            for number in narrowed.case_numbers().take(5) {
                let tested = narrowed.intersectors_of(number);
                assert_eq!(tested, [Intersector::Watertight], "{}", property.name);
                let own = property.intersectors_of(number);
                assert!(own.contains(&tested[0]), "{}", property.name);
            }
        }
    }

    #[test]
    fn skipped_cases_are_not_counted() {
        let backend = || CpuBackend::new(Some(1)).unwrap();
        let (mut subject, mut reference) = (backend(), Reference::new(Box::new(backend())));
        let mut narrowed = PROPERTIES.iter().filter_map(|p| p.by_usual_intersector());
        let skipping = narrowed.find(|p| p.intersectors_of(1).is_empty());
        let property = skipping.unwrap();
        let cases = Cases::new(1, 1..=1);
        let held = check_property(&property, &mut subject, &mut reference, &cases);
        assert_eq!(held.unwrap(), 0);
    }
}
