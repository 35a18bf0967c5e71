//! Backends with one fault each, and the properties that must detect it. A property that detects no fault tests
//! nothing.

mod faulty;

use conformance::{Disagreement, LAWS, Law, OWN_TREE_LAWS, Reference, hold};
use cpu_ref::CpuBackend;
use faulty::Faulty;

/// Properties, each with faults that it must detect. It may detect others.
const NOTICED: &str = "
positions_equal_the_formula: positions one ulp off
boxes_are_of_the_moment_interpolated_last: last box too large, boxes of the moment before, what moves is passed over, inactive miscounted
reports_name_what_was_done: times of stages left out, clock runs backwards
positions_come_back_as_they_were: copies are of the newest frame, copies come twice
positions_of_a_stream_are_those_of_held_key_frames: key frames of a stream come late
key_frames_that_arrive_need_no_look_of_the_host: what arrives is not measured
key_frames_that_arrive_are_played_as_those_held: key frames that arrive come late, first leaf is never hit
closest_hits_equal_the_reference: distances one ulp off, weights swapped, interval is closed, ties go to the first leaf, hits miscounted
pictures_and_shadows_equal_the_reference: distances one ulp off, weights swapped, shadows inverted, pixels sampled at corners
any_hit_agrees_with_closest_hit: interval is closed, any hit forgets the last ray
any_hits_equal_the_reference: any hit forgets the last ray
a_camera_is_its_rays: pixels sampled at corners, second trace misses
queries_together_find_what_each_does: the second of several queries misses
a_ray_that_continues_visits_every_crossing_once: distances one ulp off, weights swapped, hit again where the ray begins, any hit forgets the last ray
far_geometry_changes_no_other_hit: far vertices change other hits, far triangles are lost
closed_bodies_do_not_leak: edges leak, edges hit twice
tree_age_does_not_change_hits: first leaf is never hit
tree_shape_does_not_change_hits: first leaf is never hit, ties go to the first leaf
a_swap_does_not_change_hits: first leaf is never hit, new tree answers for old frames
a_tree_that_was_brought_is_the_one_adopted: a tree that was left is adopted, first leaf is never hit
a_tree_is_evaluated_beside_the_current_one: cost is that of the current tree, evaluation counts inactive triangles twice, first leaf is never hit
a_tree_made_on_the_device_is_whole: made tree is not the one in use
a_tree_made_on_the_device_does_not_change_hits: made tree misses sometimes
a_wrong_tree_is_refused: any tree is taken
tickets_finish_in_order_and_answers_are_kept: answers of the newest frame, tickets repeat, answers lost without a trace
loading_again_starts_afresh: every third scene is empty, positions outlive their scene
what_never_moves_may_be_passed_over: what moves is passed over
";

/// Properties of backends whose driver determines hits, with faults that they must detect. The reference has these
/// properties too.
const NOTICED_WITHIN: &str = "
positions_equal_the_formula: positions one ulp off
reports_name_what_was_done: times of stages left out
positions_come_back_as_they_were: copies come twice
positions_of_a_stream_are_those_of_held_key_frames: key frames of a stream come late
a_camera_is_its_rays: pixels sampled at corners
closest_hits_lie_within_rounding: weights swapped, first leaf is never hit, inactive miscounted, hits miscounted
pictures_and_shadows_lie_within_rounding: weights swapped, shadows inverted
any_hits_lie_within_rounding: any hit forgets the last ray
key_frames_that_arrive_are_played_as_those_held: key frames that arrive come late, hits miscounted
";

/// Number of cases per property, as in the full tier.
const CASES: u32 = 36;

fn verdict(laws: &[Law], law: &str, fault: &'static str) -> Result<u32, Disagreement> {
    let law = laws.iter().find(|l| l.name == law).expect(law);
    let mut reference = Reference::new(Box::new(CpuBackend::new(Some(1)).unwrap()));
    hold(law, &mut Faulty::new(fault), &mut reference, 1, 0..CASES)
}

/// Checks that every property holds without a fault, and detects each of its faults. Returns the properties without
/// any.
fn notices(laws: &[Law], noticed: &'static str) -> Vec<&'static str> {
    let mut idle: Vec<_> = laws.iter().map(|l| l.name).collect();
    for law in laws {
        verdict(laws, law.name, "none").unwrap();
    }
    for (law, faults) in noticed.lines().filter_map(|line| line.split_once(": ")) {
        idle.retain(|l| *l != law);
        for fault in faults.split(", ") {
            let found = verdict(laws, law, fault).expect_err(fault);
            assert!(!found.what.contains("panicked"), "{fault}: {found}");
        }
    }
    idle
}

#[test]
fn every_law_holds_without_a_fault_and_notices_its_own() {
    assert_eq!(notices(LAWS, NOTICED), [""; 0]);
}

#[test]
fn rounding_explains_all_of_the_reference_and_no_fault() {
    assert_eq!(notices(OWN_TREE_LAWS, NOTICED_WITHIN), [""; 0]);
    let law = "closest_hits_lie_within_rounding";
    verdict(OWN_TREE_LAWS, law, "distances one ulp off").unwrap();
}

#[test]
fn a_backend_that_panics_disagrees() {
    let found = verdict(LAWS, "closest_hits_equal_the_reference", "panics").unwrap_err();
    assert!(found.what.contains("this backend panics"), "{found}");
}
