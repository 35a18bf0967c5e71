//! Every test of the crate, as data: a test of the device shows as ignored, with
//! the reason, where this machine's device is absent or cannot show what is
//! asked. `ABVH_REQUIRE_BACKENDS=vulkan` turns an absent device red. The validation
//! layer listens where it is installed.

mod frames;
mod geometry;
mod limits;
mod packets;
mod rasterization;
mod rebuild;
mod roads;
mod rt;
mod scenes;

use crate::{clock, errors, queues, snapshots, transfer};
use libtest_mimic::{Arguments, Trial};
use std::process::ExitCode;

type Test = fn();

/// Names a test by its path.
macro_rules! named {
    ($($path:path),* $(,)?) => { &[$((stringify!($path), $path as Test)),*] };
}

/// Tests that need no device.
const PLAIN: &[(&str, Test)] = named![
    clock::tests::stages_are_timed_each_and_all_together,
    clock::tests::a_clock_of_few_bits_goes_on_when_it_wraps,
    clock::tests::a_clock_of_64_bits_keeps_every_tick,
    clock::tests::nothing_is_timed_without_marks_nor_begun_without_stages,
    errors::tests::codes_become_errors_that_say_what_was_being_done,
    crate::limits::tests::a_refused_buffer_names_its_need_and_the_limit_it_meets,
    crate::limits::tests::a_refused_dispatch_names_its_groups_and_how_many_there_may_be,
    crate::limits::tests::a_device_with_too_few_buffers_is_refused_by_the_kernels_name,
    queues::tests::copies_go_to_copy_engines_else_to_spare_queues_else_to_the_one_there_is,
    crate::rt::tests::triangles_are_cleansed_where_a_vertex_is_or_may_become_infinite_or_no_number,
    snapshots::tests::positions_are_written_where_nobody_reads_or_where_reading_ends_first,
    transfer::tests::pieces_lie_side_by_side_and_none_is_large,
];

/// Tests that need a device.
const ON_DEVICE: &[(&str, Test)] = named![
    frames::no_more_submissions_are_under_way_than_may_be,
    frames::results_last_for_two_more_traces,
    frames::times_begin_one_after_the_other_by_one_clock,
    frames::another_scene_forgets_the_first,
    frames::steady_frames_make_no_buffers,
    frames::a_backend_may_be_dropped_at_any_moment,
    geometry::the_deepest_tree_is_refitted_and_traced_from_either_end,
    geometry::a_submission_may_hold_any_number_of_stages,
    geometry::triangles_are_counted_at_the_last_positions_alone,
    geometry::the_cost_of_a_tree_is_the_references,
    geometry::treelets_that_stand_still_are_passed_over_to_the_last_bit,
    geometry::layouts_differ_in_memory_alone,
    geometry::a_flat_triangle_is_counted_at_a_key_frame_though_it_vanishes_after_it,
    geometry::large_trees_have_the_same_boxes_in_either_layout,
    geometry::a_cameras_rays_meet_anything_as_the_list_of_them_does,
    limits::a_query_too_large_is_refused_and_a_smaller_one_may_follow_at_once,
    rasterization::triangles_find_the_rays_that_find_them,
    rasterization::each_ray_goes_by_itself_where_triangles_cover_too_much,
    rebuild::trees_of_any_size_are_whole,
    rebuild::boxes_are_those_that_a_refit_of_the_same_tree_finds,
    rebuild::two_triangles_in_a_row_share_a_leaf_if_a_ray_can_hit_both,
    rebuild::no_tree_is_too_deep_for_the_traversal,
    rebuild::extreme_coordinates_make_a_tree,
    rebuild::equal_triangles_make_a_tree_without_long_paths,
    rebuild::triangles_are_sorted_by_their_keys_and_equal_keys_keep_their_order,
    rebuild::a_tree_made_here_costs_hardly_more_than_the_hosts,
    roads::requests_of_several_submissions_are_answered_in_their_order,
    roads::a_snapshot_outlives_the_backend,
    packets::rays_together_find_what_each_finds_by_itself,
    packets::what_lies_beside_the_picture_covers_none_of_it,
];

/// Tests that need a device whose driver makes and traces trees.
const ON_DRIVERS_TREES: &[(&str, Test)] = named![
    rt::the_drivers_trees_are_hit_where_the_references_are,
    rt::what_the_driver_does_not_tell_is_counted_as_by_the_reference,
    rt::the_drivers_work_is_timed_and_counting_is_not,
    rt::a_scene_without_live_triangles_is_hit_by_nothing,
    rt::trees_of_others_are_refused,
];

/// Tests that need a device whose copies up and down each have a queue of their own.
const ON_THREE_QUEUES: &[(&str, Test)] = named![
    roads::positions_on_their_way_are_not_written_over,
    roads::frames_go_on_though_nothing_comes_down_or_goes_up,
];

/// Tests that need a device whose buffers are small enough for the host to outgrow them.
const ON_SMALL_BUFFERS: &[(&str, Test)] =
    named![limits::a_scene_too_large_is_refused_with_both_numbers_and_a_small_one_still_goes,];

pub(crate) fn run() -> ExitCode {
    let arguments = Arguments::from_args();
    let device = scenes::find();
    let absent = device.as_ref().err().cloned();
    let (queues, buffers) = match &device {
        Ok(backend) => (roads::lacks_queues(backend), limits::are_too_large(backend)),
        Err(_) => (absent.clone(), absent.clone()),
    };
    drop(device);
    let required = std::env::var("ABVH_REQUIRE_BACKENDS").unwrap_or_default();
    let is_excused = |backend| !required.split(',').any(|name| name.trim() == backend);
    let excused = is_excused("vulkan");
    let no_rays = rt::find().err().filter(|_| is_excused("vulkan-rt"));
    let mut trials: Vec<_> = PLAIN.iter().map(|t| trial(t, None)).collect();
    let why = absent.filter(|_| excused);
    trials.extend(ON_DEVICE.iter().map(|t| trial(t, why.as_deref())));
    let with_rays = ON_DRIVERS_TREES.iter();
    trials.extend(with_rays.map(|t| trial(t, no_rays.as_deref())));
    trials.extend(ON_THREE_QUEUES.iter().map(|t| trial(t, queues.as_deref())));
    trials.extend(
        ON_SMALL_BUFFERS
            .iter()
            .map(|t| trial(t, buffers.as_deref())),
    );
    libtest_mimic::run(&arguments, trials).exit_code()
}

fn trial(&(name, test): &(&'static str, Test), lacks: Option<&str>) -> Trial {
    let trial = Trial::test(name, move || {
        test();
        Ok(())
    });
    match lacks {
        Some(why) => trial.with_kind(why).with_ignored_flag(true),
        None => trial,
    }
}
