//! Tests of properties of every device, run on each device of this machine, and of properties of one device only.
//!
//! A device is opened once for all tests that load their own scenes. Tests of an absent device show as ignored, with
//! the reason. `ABVH_REQUIRE_BACKENDS=vulkan,wgpu` makes them fail instead. Validation layers are enabled where
//! installed, and any message fails the test.

#[cfg(target_os = "linux")]
mod cuda;
#[cfg(target_os = "linux")]
mod external;
mod frames;
mod geometry;
mod lent;
#[cfg(target_os = "linux")]
mod other_device;
mod queues;
mod rebuild;
mod scenes;
mod together;
mod wgpu_encode;
mod wgpu_lent;
mod wgpu_module;
mod wgpu_points;
mod wgpu_rays;

use backend::Backend;
use geom::lock;
use gpu_common::{ComputeBackend, GpuDevice, Options, Validation};
use gpu_vulkan::VulkanBackend;
use integration::is_required;
use libtest_mimic::Trial;
use shaders::BufferName;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};

/// A backend on a device, with operations only for tests.
trait Subject: Backend {
    /// Returns the number of buffers created since it was opened.
    fn buffers_made(&self) -> u64;
    /// Returns the first `count` words of a buffer of the current tree.
    fn words(&mut self, name: BufferName, count: usize) -> Vec<u32>;
}

impl<D: GpuDevice> Subject for ComputeBackend<D> {
    fn buffers_made(&self) -> u64 {
        self.gpu().memory().buffers_made
    }

    fn words(&mut self, name: BufferName, count: usize) -> Vec<u32> {
        self.read_tree(name, count).unwrap()
    }
}

type Open = fn() -> backend::Result<Box<dyn Subject>>;

fn watched() -> Options {
    Options {
        validation: Validation::IfInstalled,
        ..Options::default()
    }
}

fn open_vulkan() -> backend::Result<VulkanBackend> {
    gpu_vulkan::open(&watched())
}

/// A name and a test on an open device.
type Test = (&'static str, fn(&mut dyn Subject));
/// A name and a test that closes the device.
type LastTest = (&'static str, fn(Box<dyn Subject>));

/// Names tests by their paths.
macro_rules! named {
    ($($path:path),* $(,)?) => { &[$((stringify!($path), $path)),*] };
}

/// Tests of every device. Each loads its own scenes.
const SHARED: &[Test] = named![
    frames::stages_are_timed_by_one_clock,
    frames::steady_frames_make_no_buffers,
    frames::paged_key_frames_take_memory_for_few,
    frames::device_memory_is_counted_and_given_back,
    frames::a_query_too_large_is_refused_and_a_smaller_one_may_follow_at_once,
    frames::a_moment_is_measured_after_a_query_was_refused,
    frames::scenes_that_share_a_device_are_traced_at_once,
    frames::nothing_is_shaded_without_a_palette,
    geometry::a_submission_may_hold_any_number_of_stages,
    geometry::a_cost_stands_until_the_next_refit,
    geometry::trees_of_any_shape_have_the_references_hits_and_boxes,
    geometry::large_trees_have_the_references_boxes,
];

/// Tests of kernels, for which one device suffices.
const OF_KERNELS: &[Test] = named![
    geometry::treelets_that_stand_still_are_passed_over_to_the_last_bit,
    together::triangles_find_the_rays_that_find_them,
    together::each_ray_goes_by_itself_where_triangles_cover_too_much,
    rebuild::trees_of_any_size_are_whole,
    rebuild::two_triangles_in_a_row_share_a_leaf,
    rebuild::no_tree_is_too_deep_for_the_traversal,
    rebuild::extreme_and_equal_coordinates_make_a_tree,
    rebuild::triangles_are_sorted_by_their_keys_and_equal_keys_keep_their_order,
    rebuild::a_tree_made_here_costs_hardly_more_than_the_hosts,
    together::rays_together_find_what_each_finds_by_itself,
];

/// Tests that end with the device.
const FRESH: &[LastTest] = named![
    frames::a_snapshot_outlives_the_backend,
    frames::a_backend_may_be_dropped_at_any_moment,
];

/// Tests of one device's features.
const OF_VULKAN: &[(&str, fn())] = named![
    queues::required_validation_is_there_or_its_absence_is_named,
    queues::every_adapter_tells_its_limits,
    queues::large_buffers_of_the_host_lie_in_pages_of_the_process,
    queues::no_more_submissions_are_under_way_than_may_be,
];
const OF_THREE_QUEUES: &[(&str, fn())] = named![
    queues::positions_on_their_way_are_not_written_over,
    queues::frames_go_on_though_nothing_comes_down_or_goes_up,
];
const OF_WGPU: &[(&str, fn())] = named![
    wgpu_lent::a_lent_device_without_features_gives_the_same_hits,
    wgpu_lent::a_scene_too_large_is_refused_by_its_limit,
    wgpu_lent::a_device_with_too_few_buffers_is_refused,
    wgpu_lent::a_lent_device_keeps_its_handlers,
    wgpu_lent::stages_are_timed_each_whether_they_share_a_pass_or_not,
    wgpu_lent::every_verb_after_a_loss_is_an_error_and_no_panic,
    wgpu_points::vertices_may_lie_in_a_buffer_of_the_programs,
    wgpu_points::a_buffer_that_does_not_fit_is_an_error,
    wgpu_points::vertices_of_a_buffer_stay_while_another_mesh_is_replaced,
    wgpu_rays::rays_may_lie_in_a_buffer_of_the_programs,
    wgpu_rays::long_lists_take_no_more_room_than_was_asked_for,
    wgpu_rays::buffers_of_rays_are_let_go_of,
    wgpu_rays::a_buffer_of_rays_that_does_not_fit_is_an_error,
    wgpu_encode::a_step_keeps_the_order_of_the_programs_commands,
    wgpu_encode::a_step_that_is_not_submitted_has_no_results_yet,
    wgpu_encode::a_step_that_is_dropped_with_its_commands_is_given_up,
    wgpu_encode::a_tracer_goes_on_after_dropped_commands,
    wgpu_encode::commands_that_wgpu_refuses_have_no_results,
    wgpu_encode::what_cannot_be_encoded_is_refused,
    wgpu_encode::a_tree_stays_until_the_commands_are_done_that_read_it,
    wgpu_module::shaders_find_what_queries_do,
    wgpu_module::a_scene_that_shaders_cannot_trace_is_an_error,
];

#[cfg(target_os = "linux")]
const OF_EXTERNAL_MEMORY: &[(&str, fn())] = named![
    external::vertices_may_lie_in_external_memory,
    external::vertices_of_external_memory_stay_while_another_mesh_is_replaced,
    external::rays_and_answers_may_lie_in_external_memory,
    external::misuse_of_external_memory_is_an_error,
    external::what_is_lent_is_used_between_two_values_of_a_timeline,
];
#[cfg(target_os = "linux")]
const OF_CUDA: &[(&str, fn())] = named![
    cuda::vertices_of_cuda_are_traced_where_they_lie,
    cuda::rays_and_answers_are_shared_with_cuda,
    cuda::steps_and_cuda_wait_for_each_other,
];

fn main() -> ExitCode {
    let arguments = integration::arguments();
    let (open_vulkan, open_wgpu): (Open, Open) = (
        || open_vulkan().map(|b| Box::new(b) as Box<dyn Subject>),
        || gpu_wgpu::open(&watched()).map(|b| Box::new(b) as Box<dyn Subject>),
    );
    let devices = [open_vulkan, open_wgpu].map(|open| Arc::new(Mutex::new(open())));
    let [no_vulkan, no_wgpu] = devices.each_ref().map(|device| {
        let device = lock(device);
        device.as_ref().err().map(ToString::to_string)
    });
    let no_queues = no_vulkan.clone().or_else(queues::lacks_queues);
    let excused = |absent: &Option<String>, name| absent.clone().filter(|_| !is_required(name));
    let [vulkan, wgpu] = &devices;
    let mut trials = Vec::new();
    for (name, absent, device, open) in [
        ("vulkan", &no_vulkan, vulkan, open_vulkan),
        ("wgpu", &no_wgpu, wgpu, open_wgpu),
    ] {
        let excused = excused(absent, name);
        let own = if name == "vulkan" { OF_KERNELS } else { &[] };
        let trial = |law, body| trial(format!("{name}::{law}"), excused.as_deref(), body);
        for &(law, body) in SHARED.iter().chain(own) {
            let device = Arc::clone(device);
            trials.push(trial(law, Box::new(move || watch(&device, body))));
        }
        for &(law, body) in FRESH {
            let device = Arc::clone(device);
            let body = move || {
                body(open().unwrap());
                watch(&device, |_| ());
            };
            trials.push(trial(law, Box::new(body)));
        }
    }
    let mut own = vec![
        (OF_VULKAN, excused(&no_vulkan, "vulkan")),
        (OF_THREE_QUEUES, no_queues),
        (OF_WGPU, excused(&no_wgpu, "wgpu")),
    ];
    #[cfg(target_os = "linux")]
    {
        let lacks = no_vulkan.or_else(external::lacks);
        own.extend([
            (OF_CUDA, lacks.clone().or_else(cuda::absent)),
            (OF_EXTERNAL_MEMORY, lacks),
        ]);
    }
    for (all, why) in own {
        let each = all
            .iter()
            .map(|&(name, body)| trial(name.to_owned(), why.as_deref(), Box::new(body)));
        trials.extend(each);
    }
    libtest_mimic::run(&arguments, trials).exit_code()
}

/// Runs a test, then asserts that the device has no complaints.
fn watch(device: &Mutex<backend::Result<Box<dyn Subject>>>, body: impl FnOnce(&mut dyn Subject)) {
    let mut device = lock(device);
    let subject = &mut **device.as_mut().unwrap();
    body(subject);
    assert_eq!(subject.inspect().complaints(), [""; 0]);
}

fn trial(name: String, lacks: Option<&str>, body: Box<dyn FnOnce() + Send>) -> Trial {
    let trial = Trial::test(name, move || {
        body();
        Ok(())
    });
    match lacks {
        Some(why) => trial.with_kind(why).with_ignored_flag(true),
        None => trial,
    }
}
