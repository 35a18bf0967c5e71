//! The backend on whatever adapter this machine has, against its twins.
//!
//! Where there is none, trials show as ignored, with the reason.

mod call_counts;
mod cost;
mod lent;
mod life;
mod scenes;
mod twins;

use libtest_mimic::{Arguments, Failed, Trial};

type Body = fn() -> Result<(), Failed>;

const TRIALS: &[(&str, Body)] = &[
    (
        "refit_measures_what_the_tree_costs",
        cost::refit_measures_what_the_tree_costs,
    ),
    (
        "a_cost_stands_until_the_next_refit",
        cost::a_cost_stands_until_the_next_refit,
    ),
    (
        "a_steady_frame_makes_no_buffer_and_no_bind_group",
        call_counts::a_steady_frame_makes_no_buffer_and_no_bind_group,
    ),
    (
        "device_memory_is_counted_and_given_back",
        call_counts::device_memory_is_counted_and_given_back,
    ),
    (
        "any_hit_of_camera_rays_is_that_of_the_rays_one_by_one",
        twins::any_hit_of_camera_rays_is_that_of_the_rays_one_by_one,
    ),
    (
        "submissions_share_one_clock",
        life::submissions_share_one_clock,
    ),
    (
        "every_variant_answers_as_its_twins_do",
        twins::every_variant_answers_as_its_twins_do,
    ),
    (
        "large_trees_have_the_same_boxes_everywhere",
        twins::large_trees_have_the_same_boxes_everywhere,
    ),
    (
        "an_old_tree_and_a_new_one_give_the_same_hits",
        twins::an_old_tree_and_a_new_one_give_the_same_hits,
    ),
    (
        "an_empty_tree_is_missed_by_all",
        twins::an_empty_tree_is_missed_by_all,
    ),
    (
        "a_wrong_tree_is_refused_and_the_old_one_stays",
        life::a_wrong_tree_is_refused_and_the_old_one_stays,
    ),
    (
        "snapshots_hold_the_vertices_of_their_frame",
        life::snapshots_hold_the_vertices_of_their_frame,
    ),
    (
        "a_snapshot_outlives_the_backend",
        life::a_snapshot_outlives_the_backend,
    ),
    (
        "results_last_for_two_more_traces",
        life::results_last_for_two_more_traces,
    ),
    (
        "another_scene_forgets_the_first",
        life::another_scene_forgets_the_first,
    ),
    ("stages_are_timed", life::stages_are_timed),
    (
        "a_whole_life_leaves_no_validation_message",
        life::a_whole_life_leaves_no_validation_message,
    ),
    (
        "a_lent_device_without_features_gives_the_same_hits",
        lent::a_lent_device_without_features_gives_the_same_hits,
    ),
    (
        "a_scene_too_large_is_refused_by_its_limit",
        lent::a_scene_too_large_is_refused_by_its_limit,
    ),
    (
        "a_device_with_too_few_buffers_is_refused",
        lent::a_device_with_too_few_buffers_is_refused,
    ),
    (
        "a_lent_device_with_features_is_timed_and_keeps_its_handlers",
        lent::a_lent_device_with_features_is_timed_and_keeps_its_handlers,
    ),
    (
        "stages_are_timed_each_whether_they_share_a_pass_or_not",
        lent::stages_are_timed_each_whether_they_share_a_pass_or_not,
    ),
    (
        "every_verb_after_a_loss_is_an_error_and_no_panic",
        lent::every_verb_after_a_loss_is_an_error_and_no_panic,
    ),
    (
        "a_lost_device_is_an_error_and_no_panic",
        lent::a_lost_device_is_an_error_and_no_panic,
    ),
];

fn main() {
    let arguments = Arguments::from_args();
    let absent = gpu_wgpu::adapters().err().map(|e| e.to_string());
    let trial = |&(name, body): &(&str, Body)| match &absent {
        None => Trial::test(name, body),
        Some(why) => Trial::test(name, body)
            .with_kind(why.clone())
            .with_ignored_flag(true),
    };
    libtest_mimic::run(&arguments, TRIALS.iter().map(trial).collect()).exit();
}
