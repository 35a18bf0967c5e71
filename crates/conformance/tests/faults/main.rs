//! Backends with a fault each, and the laws that must notice it: a law that notices nothing is no law.

mod faulty;

use conformance::{Disagreement, LAWS, Law, OWN_TREE_LAWS, hold};
use cpu_ref::CpuBackend;
use faulty::{Fault, Faulty};

/// Each fault with laws that must notice it. Others may.
const NOTICED: &[(Fault, &[&str])] = &[
    (Fault::PositionsOneUlpOff, &["positions_equal_the_formula"]),
    (Fault::LastBoxTooLarge, &["boxes_equal_the_reference"]),
    (
        Fault::BoxesOfTheMomentBefore,
        &["boxes_are_of_the_moment_interpolated_last"],
    ),
    (Fault::InactiveMiscounted, &["counts_equal_the_reference"]),
    (Fault::HitsMiscounted, &["counts_equal_the_reference"]),
    (Fault::TimesOfStagesLeftOut, &["reports_name_what_was_done"]),
    (Fault::ClockRunsBackwards, &["reports_name_what_was_done"]),
    (
        Fault::CopiesAreOfTheNewestFrame,
        &["positions_come_back_as_they_were"],
    ),
    (
        Fault::CopiesComeTwice,
        &["positions_come_back_as_they_were"],
    ),
    (
        Fault::DistancesOneUlpOff,
        &[
            "closest_hits_equal_the_reference",
            "pictures_and_shadows_equal_the_reference",
        ],
    ),
    (
        Fault::WeightsSwapped,
        &[
            "closest_hits_equal_the_reference",
            "pictures_and_shadows_equal_the_reference",
        ],
    ),
    (
        Fault::IntervalIsClosed,
        &[
            "closest_hits_equal_the_reference",
            "any_hit_agrees_with_closest_hit",
        ],
    ),
    (
        Fault::AnyHitForgetsTheLastRay,
        &[
            "any_hits_equal_the_reference",
            "any_hit_agrees_with_closest_hit",
        ],
    ),
    (
        Fault::ShadowsInverted,
        &["pictures_and_shadows_equal_the_reference"],
    ),
    (
        Fault::PixelsSampledAtCorners,
        &[
            "a_camera_is_its_rays",
            "pictures_and_shadows_equal_the_reference",
        ],
    ),
    (Fault::EdgesLeak, &["closed_bodies_do_not_leak"]),
    (Fault::EdgesHitTwice, &["closed_bodies_do_not_leak"]),
    (
        Fault::FirstLeafIsNeverHit,
        &[
            "tree_age_does_not_change_hits",
            "tree_shape_does_not_change_hits",
            "a_swap_does_not_change_hits",
        ],
    ),
    (
        Fault::TiesGoToTheFirstLeaf,
        &[
            "tree_shape_does_not_change_hits",
            "closest_hits_equal_the_reference",
        ],
    ),
    (
        Fault::NewTreeAnswersForOldFrames,
        &["a_swap_does_not_change_hits"],
    ),
    (
        Fault::MadeTreeIsNotTheOneInUse,
        &["a_tree_made_on_the_device_is_whole"],
    ),
    (
        Fault::MadeTreeMissesSometimes,
        &["a_tree_made_on_the_device_does_not_change_hits"],
    ),
    (Fault::AnyTreeIsTaken, &["a_wrong_tree_is_refused"]),
    (
        Fault::AnswersOfTheNewestFrame,
        &["tickets_finish_in_order_and_answers_are_kept"],
    ),
    (
        Fault::TicketsRepeat,
        &["tickets_finish_in_order_and_answers_are_kept"],
    ),
    (
        Fault::AnswersLostWithoutATrace,
        &["tickets_finish_in_order_and_answers_are_kept"],
    ),
    (
        Fault::SecondTraceMisses,
        &["what_did_not_change_need_not_be_done_again"],
    ),
    (
        Fault::EveryThirdSceneIsEmpty,
        &["loading_again_starts_afresh"],
    ),
    (
        Fault::WhatMovesIsPassedOver,
        &[
            "what_never_moves_may_be_passed_over",
            "boxes_equal_the_reference",
        ],
    ),
    (
        Fault::PositionsOutliveTheirScene,
        &["loading_again_starts_afresh"],
    ),
];

/// Likewise for the laws of backends that leave what is hit to a driver; the reference keeps those too.
const NOTICED_WITHIN: &[(Fault, &[&str])] = &[
    (Fault::PositionsOneUlpOff, &["positions_equal_the_formula"]),
    (Fault::TimesOfStagesLeftOut, &["reports_name_what_was_done"]),
    (
        Fault::CopiesComeTwice,
        &["positions_come_back_as_they_were"],
    ),
    (Fault::PixelsSampledAtCorners, &["a_camera_is_its_rays"]),
    (Fault::InactiveMiscounted, &["counts_equal_what_is_there"]),
    (Fault::HitsMiscounted, &["counts_equal_what_is_there"]),
    (
        Fault::WeightsSwapped,
        &[
            "closest_hits_lie_within_rounding",
            "pictures_and_shadows_lie_within_rounding",
        ],
    ),
    (
        Fault::FirstLeafIsNeverHit,
        &["closest_hits_lie_within_rounding"],
    ),
    (
        Fault::AnyHitForgetsTheLastRay,
        &["any_hits_lie_within_rounding"],
    ),
    (
        Fault::ShadowsInverted,
        &["pictures_and_shadows_lie_within_rounding"],
    ),
];

/// Cases that each law sees, as the test suite has it.
const CASES: u32 = 36;

fn verdict(fault: Fault, law: &str) -> Result<u32, Disagreement> {
    verdict_of(LAWS, fault, law)
}

fn verdict_of(laws: &[Law], fault: Fault, law: &str) -> Result<u32, Disagreement> {
    let law = laws.iter().find(|l| l.name == law).expect(law);
    let mut reference = CpuBackend::new(Some(1)).unwrap();
    hold(law, &mut Faulty::new(fault), &mut reference, 1, CASES)
}

#[test]
fn every_fault_is_noticed_by_its_laws() {
    let mut missed = Vec::new();
    for (fault, laws) in NOTICED {
        for law in *laws {
            match verdict(*fault, law) {
                Err(e) => assert!(!e.what.contains("panicked"), "{fault:?}: {e}"),
                Ok(_) => missed.push((fault, law)),
            }
        }
    }
    assert!(missed.is_empty(), "unnoticed: {missed:?}");
}

/// No law is left without a fault that it notices; damaged trees reach no backend, so theirs is tried elsewhere.
#[test]
fn every_law_notices_a_fault() {
    let noticed = |law: &str| NOTICED.iter().any(|(_, laws)| laws.contains(&law));
    let idle: Vec<_> = LAWS
        .iter()
        .map(|l| l.name)
        .filter(|l| !noticed(l))
        .collect();
    assert_eq!(idle, ["a_damaged_tree_is_refused"]);
}

#[test]
fn a_backend_without_a_fault_keeps_every_law() {
    for law in LAWS {
        verdict(Fault::None, law.name).unwrap();
    }
}

#[test]
fn rounding_explains_all_of_the_reference_and_no_fault() {
    for law in OWN_TREE_LAWS {
        verdict_of(OWN_TREE_LAWS, Fault::None, law.name).unwrap();
        let mut all = NOTICED_WITHIN.iter();
        assert!(
            all.any(|(_, laws)| laws.contains(&law.name)),
            "{}",
            law.name
        );
    }
    for (fault, laws) in NOTICED_WITHIN {
        for law in *laws {
            let found = verdict_of(OWN_TREE_LAWS, *fault, law);
            assert!(found.is_err(), "{fault:?} passes {law}");
        }
    }
    let tolerated = verdict_of(
        OWN_TREE_LAWS,
        Fault::DistancesOneUlpOff,
        "closest_hits_lie_within_rounding",
    );
    tolerated.unwrap();
}

#[test]
fn a_backend_that_panics_disagrees() {
    let found = verdict(Fault::Panics, "closest_hits_equal_the_reference").unwrap_err();
    assert!(found.what.contains("this backend panics"), "{found}");
}
