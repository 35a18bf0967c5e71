//! Backends with one fault each, and the properties that must detect it. A property that detects no fault tests
//! nothing.

mod faulty;

use conformance::{Cases, Disagreement, PROPERTIES, Reference, check_property};
use cpu_ref::CpuBackend;
use faulty::Faulty;

/// Properties, each with faults that it must detect. It may detect others.
const DETECTED: &str = "
frames_equal_the_reference_after_any_commands: positions one ulp off, last box too large, boxes of the moment before, inactive miscounted, copies are of the newest frame, copies come twice
only_recorded_stages_have_times: a refit time without a refit
paged_key_frames_have_the_positions_of_held_ones: paged key frames come late
device_measured_range_does_not_change_hits: streamed vertices are not measured
streamed_key_frames_are_played_like_held_ones: streamed key frames come late, first leaf is never hit
hits_equal_the_reference: distances one ulp off, weights swapped, interval is closed, hits of similar indices go to the first leaf, hits miscounted, any hit forgets the last ray
pictures_and_shadows_equal_the_reference: distances one ulp off, weights swapped, shadows inverted, pixels sampled at corners
any_hit_agrees_with_closest_hit: interval is closed, any hit forgets the last ray
camera_matches_listed_rays: pixels sampled at corners, second trace misses
batched_queries_match_separate_queries: all queries except the first miss
continued_rays_visit_every_crossing_once: distances one ulp off, weights swapped, hit again where the ray begins, any hit forgets the last ray
far_geometry_does_not_change_hits: far vertices change other hits, far triangles are lost
closed_bodies_do_not_leak: edges leak, edges hit twice
tree_age_does_not_change_hits: first leaf is never hit
tree_shape_does_not_change_hits: first leaf is never hit, hits of similar indices go to the first leaf
tree_swap_does_not_change_hits: first leaf is never hit, new tree answers for old frames
uploaded_tree_is_the_one_adopted: an abandoned upload is adopted, first leaf is never hit
evaluation_does_not_change_results: cost is that of the current tree, evaluation counts inactive triangles twice, first leaf is never hit
device_built_tree_is_valid: made tree is not the one in use
device_build_does_not_change_hits: made tree misses sometimes
trees_of_other_scenes_are_refused: any tree is taken
tickets_are_ordered_and_results_kept: answers of the newest frame, tickets repeat, submissions without rays discard results
reloading_resets_all_state: every third scene is empty, positions outlive their scene
";

/// Number of cases per property, as in tests of backends with `ABVH_FULL=1`.
const CASES: u32 = 36;

/// Tests a property on a backend with this fault.
fn check(property: &str, fault: &'static str, cases: &Cases) -> Result<u32, Disagreement> {
    let property = PROPERTIES.iter().find(|p| p.name == property);
    let property = property.expect("the property is known");
    let mut reference = Reference::new(Box::new(CpuBackend::new(Some(1)).unwrap()));
    check_property(property, &mut Faulty::new(fault), &mut reference, cases)
}

#[test]
fn every_property_holds_without_a_fault() {
    // The tests of `cpu` and `vulkan` try more cases. These show that the wrapper around the backend changes nothing.
    let cases = Cases::new(1, 0..=11);
    for property in PROPERTIES {
        check(property.name, "none", &cases).unwrap();
    }
}

#[test]
fn every_property_detects_its_faults() {
    let cases = Cases {
        shrinks: 0,
        ..Cases::new(1, 0..=CASES - 1)
    };
    let mut untested: Vec<_> = PROPERTIES.iter().map(|p| p.name).collect();
    for (property, faults) in DETECTED.lines().filter_map(|line| line.split_once(": ")) {
        untested.retain(|name| *name != property);
        for fault in faults.split(", ") {
            let found = check(property, fault, &cases).expect_err(fault);
            assert!(!found.what.contains("panicked"), "{fault}: {found}");
        }
    }
    assert_eq!(untested, [""; 0]);
}

#[test]
fn panicking_backend_counts_as_disagreement() {
    let found = shrunk("hits_equal_the_reference", "panics");
    assert!(found.what.contains("this backend panics"), "{found}");
    assert!(found.minimal.animation.triangle_count() <= 1, "{found}");
}

/// Returns the disagreement in the smallest case that was found.
fn shrunk(property: &str, fault: &'static str) -> Disagreement {
    let cases = Cases::new(1, 0..=CASES - 1);
    check(property, fault, &cases).expect_err(fault)
}

/// Properties, each with faults that must shrink to small cases.
const SHRUNK: &str = "
frames_equal_the_reference_after_any_commands: last box too large, boxes of the moment before
hits_equal_the_reference: weights swapped, hits of similar indices go to the first leaf
tree_age_does_not_change_hits: first leaf is never hit
paged_key_frames_have_the_positions_of_held_ones: paged key frames come late
streamed_key_frames_are_played_like_held_ones: streamed key frames come late
";

/// The most triangles, key frames and rays of a case that shows such a fault.
const SMALL: [usize; 3] = [4, 2, 2];

#[test]
fn faults_shrink_to_small_cases() {
    for (property, faults) in SHRUNK.lines().filter_map(|line| line.split_once(": ")) {
        for fault in faults.split(", ") {
            let found = shrunk(property, fault);
            let (animation, rays) = (&found.minimal.animation, &found.minimal.rays);
            let sizes = [
                animation.triangle_count(),
                animation.key_count(),
                rays.len(),
            ];
            let is_small = sizes.iter().zip(SMALL).all(|(&size, most)| size <= most);
            assert!(is_small, "{sizes:?}: {found}");
            // The number of the case reproduces the fault.
            let alone = Cases::new(1, found.case..=found.case);
            let again = check(property, fault, &alone).unwrap_err();
            assert_eq!((again.case, again.held), (found.case, 0));
        }
    }
}
