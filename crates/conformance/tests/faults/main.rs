//! Backends with a fault each, and the laws that must notice it: a law that notices nothing is no law.

mod faulty;

use conformance::{Disagreement, LAWS, Law, OWN_TREE_LAWS, Reference, hold};
use cpu_ref::CpuBackend;
use faulty::{Fault as F, Faulty};

/// Each law with a fault that it must notice. It may notice others.
const NOTICED: &[(&str, F)] = &[
    ("positions_equal_the_formula", F::PositionsOneUlpOff),
    ("boxes_equal_the_reference", F::LastBoxTooLarge),
    ("boxes_equal_the_reference", F::WhatMovesIsPassedOver),
    (
        "boxes_are_of_the_moment_interpolated_last",
        F::BoxesOfTheMomentBefore,
    ),
    ("counts_equal_the_reference", F::InactiveMiscounted),
    ("counts_equal_the_reference", F::HitsMiscounted),
    ("reports_name_what_was_done", F::TimesOfStagesLeftOut),
    ("reports_name_what_was_done", F::ClockRunsBackwards),
    (
        "positions_come_back_as_they_were",
        F::CopiesAreOfTheNewestFrame,
    ),
    ("positions_come_back_as_they_were", F::CopiesComeTwice),
    ("closest_hits_equal_the_reference", F::DistancesOneUlpOff),
    ("closest_hits_equal_the_reference", F::WeightsSwapped),
    ("closest_hits_equal_the_reference", F::IntervalIsClosed),
    ("closest_hits_equal_the_reference", F::TiesGoToTheFirstLeaf),
    (
        "pictures_and_shadows_equal_the_reference",
        F::DistancesOneUlpOff,
    ),
    (
        "pictures_and_shadows_equal_the_reference",
        F::WeightsSwapped,
    ),
    (
        "pictures_and_shadows_equal_the_reference",
        F::ShadowsInverted,
    ),
    (
        "pictures_and_shadows_equal_the_reference",
        F::PixelsSampledAtCorners,
    ),
    ("any_hit_agrees_with_closest_hit", F::IntervalIsClosed),
    (
        "any_hit_agrees_with_closest_hit",
        F::AnyHitForgetsTheLastRay,
    ),
    ("any_hits_equal_the_reference", F::AnyHitForgetsTheLastRay),
    ("a_camera_is_its_rays", F::PixelsSampledAtCorners),
    ("closed_bodies_do_not_leak", F::EdgesLeak),
    ("closed_bodies_do_not_leak", F::EdgesHitTwice),
    ("tree_age_does_not_change_hits", F::FirstLeafIsNeverHit),
    ("tree_shape_does_not_change_hits", F::FirstLeafIsNeverHit),
    ("tree_shape_does_not_change_hits", F::TiesGoToTheFirstLeaf),
    ("a_swap_does_not_change_hits", F::FirstLeafIsNeverHit),
    ("a_swap_does_not_change_hits", F::NewTreeAnswersForOldFrames),
    (
        "a_tree_made_on_the_device_is_whole",
        F::MadeTreeIsNotTheOneInUse,
    ),
    (
        "a_tree_made_on_the_device_does_not_change_hits",
        F::MadeTreeMissesSometimes,
    ),
    ("a_wrong_tree_is_refused", F::AnyTreeIsTaken),
    (
        "tickets_finish_in_order_and_answers_are_kept",
        F::AnswersOfTheNewestFrame,
    ),
    (
        "tickets_finish_in_order_and_answers_are_kept",
        F::TicketsRepeat,
    ),
    (
        "tickets_finish_in_order_and_answers_are_kept",
        F::AnswersLostWithoutATrace,
    ),
    (
        "what_did_not_change_need_not_be_done_again",
        F::SecondTraceMisses,
    ),
    ("loading_again_starts_afresh", F::EveryThirdSceneIsEmpty),
    ("loading_again_starts_afresh", F::PositionsOutliveTheirScene),
    (
        "what_never_moves_may_be_passed_over",
        F::WhatMovesIsPassedOver,
    ),
];

/// Likewise for the laws of backends that leave what is hit to a driver; the reference keeps those too.
const NOTICED_WITHIN: &[(&str, F)] = &[
    ("positions_equal_the_formula", F::PositionsOneUlpOff),
    ("reports_name_what_was_done", F::TimesOfStagesLeftOut),
    ("positions_come_back_as_they_were", F::CopiesComeTwice),
    ("a_camera_is_its_rays", F::PixelsSampledAtCorners),
    ("counts_equal_what_is_there", F::InactiveMiscounted),
    ("counts_equal_what_is_there", F::HitsMiscounted),
    ("closest_hits_lie_within_rounding", F::WeightsSwapped),
    ("closest_hits_lie_within_rounding", F::FirstLeafIsNeverHit),
    (
        "pictures_and_shadows_lie_within_rounding",
        F::WeightsSwapped,
    ),
    (
        "pictures_and_shadows_lie_within_rounding",
        F::ShadowsInverted,
    ),
    ("any_hits_lie_within_rounding", F::AnyHitForgetsTheLastRay),
];

/// Cases that each law sees, as the full tier has it.
const CASES: u32 = 36;

fn verdict(laws: &[Law], law: &str, fault: F) -> Result<u32, Disagreement> {
    let law = laws.iter().find(|l| l.name == law).expect(law);
    let mut reference = Reference::new(Box::new(CpuBackend::new(Some(1)).unwrap()));
    hold(law, &mut Faulty::new(fault), &mut reference, 1, CASES)
}

/// Every law holds without a fault, and notices each of its own.
fn notices(laws: &[Law], noticed: &[(&str, F)]) {
    let mut missed = Vec::new();
    for law in laws {
        verdict(laws, law.name, F::None).unwrap();
    }
    for &(law, fault) in noticed {
        match verdict(laws, law, fault) {
            Err(e) => assert!(!e.what.contains("panicked"), "{fault:?}: {e}"),
            Ok(_) => missed.push((law, fault)),
        }
    }
    assert!(missed.is_empty(), "unnoticed: {missed:?}");
}

/// The laws for which no fault is planted.
fn idle(laws: &[Law], noticed: &[(&str, F)]) -> Vec<&'static str> {
    let names = laws.iter().map(|l| l.name);
    names
        .filter(|l| noticed.iter().all(|n| n.0 != *l))
        .collect()
}

#[test]
fn every_law_holds_without_a_fault_and_notices_its_own() {
    notices(LAWS, NOTICED);
    // Damaged trees reach no backend, so theirs are tried where they are made.
    assert_eq!(idle(LAWS, NOTICED), ["a_damaged_tree_is_refused"]);
}

#[test]
fn rounding_explains_all_of_the_reference_and_no_fault() {
    notices(OWN_TREE_LAWS, NOTICED_WITHIN);
    assert_eq!(idle(OWN_TREE_LAWS, NOTICED_WITHIN), [""; 0]);
    let law = "closest_hits_lie_within_rounding";
    verdict(OWN_TREE_LAWS, law, F::DistancesOneUlpOff).unwrap();
}

#[test]
fn a_backend_that_panics_disagrees() {
    let found = verdict(LAWS, "closest_hits_equal_the_reference", F::Panics).unwrap_err();
    assert!(found.what.contains("this backend panics"), "{found}");
}
