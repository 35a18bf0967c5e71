//! Tests of GPU backends. Some run on the default Vulkan device and on the default wgpu device. The others run on one
//! device only.
//!
//! The tests in `SHARED`, `LONG` and `OF_KERNELS` share one open device per backend. Tests of an absent device show as
//! ignored, with the reason. `ABVH_REQUIRE_BACKENDS=vulkan,wgpu` makes them fail instead. It does not affect
//! `OF_THREE_QUEUES`, `OF_EXTERNAL_MEMORY` and `OF_CUDA`.
//!
//! Validation layers are enabled where installed, and any message fails the test. `OF_WGPU`, `OF_CUDA` and those tests
//! of `OF_EXTERNAL_MEMORY` that use the library `abvh` run without the layers.

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

use backend::Inspect;
use geom::lock;
use gpu_common::{ComputeBackend, GpuDevice, Options, Validation};
use gpu_vulkan::VulkanBackend;
use integration::{device_trial, ignored_if, is_full, is_required, named, trial};
use shaders::BufferName;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};

/// A backend on a device, with operations only for tests.
trait Subject: Inspect {
    /// Returns the number of buffers created since it was opened.
    fn buffers_made(&self) -> u64;
    /// Returns the first `count` words of a buffer of the current tree.
    fn words(&mut self, name: BufferName, count: usize) -> Vec<u32>;
    /// Returns a backend for another scene on the same device.
    fn share_device(&self) -> Box<dyn Subject>;
}

impl<D: GpuDevice> Subject for ComputeBackend<D> {
    fn buffers_made(&self) -> u64 {
        self.gpu().memory().buffers_made
    }

    fn words(&mut self, name: BufferName, count: usize) -> Vec<u32> {
        self.read_tree(name, count).unwrap()
    }

    fn share_device(&self) -> Box<dyn Subject> {
        Box::new(self.share_device()().unwrap())
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

/// Tests of every device. Each loads its own scenes.
const SHARED: &[Test] = named![
    frames::stages_are_timed_in_milliseconds,
    frames::steady_frames_create_no_buffers,
    frames::only_few_paged_key_frames_are_on_the_device,
    frames::device_memory_is_counted_and_freed,
    frames::too_large_query_is_refused,
    frames::range_is_measured_after_refused_query,
    frames::scenes_share_a_device_concurrently,
    frames::shading_requires_a_palette,
    geometry::submission_accepts_many_stages,
    geometry::cost_persists_until_next_refit,
    geometry::trees_of_any_shape_have_the_references_hits_and_boxes,
];

/// Tests that take long. By default they run on Vulkan only.
const LONG: &[Test] = named![geometry::large_trees_match_reference_boxes];

/// Tests of kernels, for which one device suffices.
const OF_KERNELS: &[Test] = named![
    geometry::skipping_static_treelets_preserves_bits,
    together::rasterization_matches_single_rays,
    together::excessive_coverage_falls_back_to_rays,
    rebuild::trees_of_any_size_are_valid,
    rebuild::adjacent_pairs_share_a_leaf,
    rebuild::nested_triangles_respect_maximum_depth,
    rebuild::builds_trees_of_extreme_coordinates,
    rebuild::radix_sort_is_stable,
    rebuild::device_tree_cost_is_near_host,
    together::packets_match_single_rays,
];

/// Tests that open a device of their own and close it.
const FRESH: &[LastTest] = named![
    frames::snapshot_outlives_the_backend,
    frames::dropping_a_busy_backend_is_safe,
];

/// Tests of one device's features.
const OF_VULKAN: &[(&str, fn())] = named![
    queues::required_validation_is_active_or_reported,
    queues::every_adapter_lists_its_limits,
    queues::large_host_buffers_import_process_pages,
    queues::submissions_in_flight_are_bounded,
    queues::shared_key_frames_equal_copied_ones,
];
const OF_THREE_QUEUES: &[(&str, fn())] = named![
    queues::pending_readbacks_are_not_overwritten,
    queues::frames_continue_during_blocked_copies,
    queues::key_frames_of_waiting_submission_are_kept,
];
const OF_WGPU: &[(&str, fn())] = named![
    wgpu_lent::featureless_device_gives_same_hits,
    wgpu_lent::too_large_scene_names_its_limit,
    wgpu_lent::device_with_few_buffers_is_refused,
    wgpu_lent::lent_device_keeps_its_handlers,
    wgpu_lent::stages_are_timed_within_shared_passes,
    wgpu_lent::calls_after_device_loss_return_errors,
    wgpu_lent::device_is_destroyed_while_no_kernel_compiles,
    wgpu_points::reads_vertices_from_caller_buffers,
    wgpu_points::unsuitable_vertex_buffer_is_an_error,
    wgpu_points::buffer_vertices_survive_mesh_replacement,
    wgpu_rays::reads_rays_from_caller_buffers,
    wgpu_rays::long_lists_fit_the_requested_limits,
    wgpu_rays::ray_buffers_are_released,
    wgpu_rays::unsuitable_ray_buffer_is_an_error,
    wgpu_rays::ray_buffers_are_bound_in_part,
    wgpu_encode::steps_keep_the_command_order,
    wgpu_encode::unsubmitted_step_has_no_results,
    wgpu_encode::step_with_dropped_commands_is_abandoned,
    wgpu_encode::tracer_recovers_from_dropped_commands,
    wgpu_encode::refused_commands_have_no_results,
    wgpu_encode::unencodable_steps_are_refused,
    wgpu_encode::tree_outlives_commands_that_read_it,
    wgpu_encode::submitted_step_follows_encoded_steps,
    wgpu_encode::results_without_triangles_keep_the_command_order,
    wgpu_encode::dropped_step_keeps_resources_of_earlier_step,
    wgpu_module::shader_hits_match_queries,
    wgpu_module::untraceable_scene_is_an_error,
    wgpu_module::replaced_or_refused_scene_needs_a_step,
];

#[cfg(target_os = "linux")]
const OF_EXTERNAL_MEMORY: &[(&str, fn())] = named![
    external::reads_vertices_from_external_memory,
    external::external_vertices_survive_mesh_replacement,
    external::traces_rays_in_external_memory,
    external::external_memory_misuse_is_an_error,
    external::timeline_bounds_external_memory_access,
];
#[cfg(target_os = "linux")]
const OF_CUDA: &[(&str, fn())] = named![
    cuda::traces_cuda_vertices_in_place,
    cuda::shares_rays_and_hits_with_cuda,
    cuda::steps_and_cuda_synchronize,
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
    let [vulkan, wgpu] = &devices;
    let mut trials = Vec::new();
    for (name, absent, device, open) in [
        ("vulkan", &no_vulkan, vulkan, open_vulkan),
        ("wgpu", &no_wgpu, wgpu, open_wgpu),
    ] {
        let own = if name == "vulkan" { OF_KERNELS } else { &[] };
        let long = LONG.iter().filter(|_| name == "vulkan" || is_full());
        let trial = |property, body: Box<dyn FnOnce() + Send>| {
            device_trial(format!("{name}::{property}"), name, absent.clone(), body)
        };
        for &(property, body) in SHARED.iter().chain(own).chain(long) {
            let device = Arc::clone(device);
            trials.push(trial(property, Box::new(move || watch(&device, body))));
        }
        for &(property, body) in FRESH {
            let device = Arc::clone(device);
            let body = move || {
                body(open().unwrap());
                watch(&device, |_| ());
            };
            trials.push(trial(property, Box::new(body)));
        }
    }
    let excused = no_vulkan.clone().filter(|_| !is_required("vulkan"));
    let mut own = vec![(OF_VULKAN, excused), (OF_THREE_QUEUES, no_queues)];
    #[cfg(target_os = "linux")]
    {
        let lacks = no_vulkan.or_else(external::lacks);
        own.extend([
            (OF_CUDA, lacks.clone().or_else(cuda::absent)),
            (OF_EXTERNAL_MEMORY, lacks),
        ]);
    }
    for (all, why) in own {
        let each = all.iter().map(|&(name, body)| {
            let device = Arc::clone(vulkan);
            let body = move || {
                body();
                // Messages are those of the whole process.
                watch(&device, |_| ());
            };
            ignored_if(trial(name, body), why.clone())
        });
        trials.extend(each);
    }
    for &(name, body) in OF_WGPU {
        let absent = no_wgpu.clone();
        trials.push(device_trial(name.to_owned(), "wgpu", absent, body));
    }
    libtest_mimic::run(&arguments, trials).exit_code()
}

/// Runs a test, then asserts that there are no validation messages.
fn watch(device: &Mutex<backend::Result<Box<dyn Subject>>>, body: impl FnOnce(&mut dyn Subject)) {
    let mut device = lock(device);
    let subject = &mut **device.as_mut().unwrap();
    body(subject);
    let validation_messages = subject.complaints();
    assert_eq!(validation_messages, [""; 0]);
}
