//! Shared code of the benchmarks: meshes, rays, and other crates behind one trait.
//!
//! Every group names a mesh and its number of triangles. Every function in a group does the same work on the same
//! triangles or rays, so times are comparable within a group. The bench `duel` needs the library of Embree (see
//! `EmbreeScene`).

mod mesh;
mod ours;
mod rays;
mod rounds;
mod trees;

pub use ::rivals::embree::{EmbreeScene, Packet16, SceneMode};
pub use mesh::{Mesh, meshes};
pub use ours::{Ours, Tracer, built};
pub use rays::{blocks, camera, diffuse_rays, light, random_numbers, random_rays, shadow_rays};
pub use rounds::{Contender, Samples, in_turn, least, median};
pub use trees::{CrateTree, Node, sah_cost, trees};

use abvh::own_device::{OwnDevice, required_limits, useful_features, wgpu};
use abvh::{Device, Scene};
use comfy_table::Table;
use criterion::Criterion;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::time::Duration;
use wgpu::util::DeviceExt;

/// Returns a configuration with few short samples, because medians are only compared within one run.
pub fn criterion() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args()
}

/// Returns the thread counts in `ABVH_THREADS` (`1,2,16`), or else 1 and the number of cores.
pub fn thread_counts() -> Vec<usize> {
    if let Ok(named) = std::env::var("ABVH_THREADS") {
        return named.split(',').filter_map(|n| n.parse().ok()).collect();
    }
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    if all > 1 { vec![1, all] } else { vec![1] }
}

/// Returns the value of the environment variable `name`, or else `usual`.
pub fn setting(name: &str, usual: usize) -> usize {
    let named = std::env::var(name).ok();
    named.and_then(|n| n.parse().ok()).unwrap_or(usual)
}

/// Scenes for the measurements of library steps.
pub const STEP_SCENES: [&str; 3] = ["demo:collide:70000", "demo:collide:250000", "demo:shatter"];

/// Returns the library device called `name`. Unknown names mean `auto`.
pub fn device(name: &str) -> Device {
    match name {
        "cpu" => Device::Cpu,
        "vulkan" => Device::Vulkan(None),
        "wgpu" => Device::Wgpu(None),
        _ => Device::Auto,
    }
}

/// Creates a wgpu device as a program would, with limits for `scene` and queries of `rays` rays.
///
/// # Panics
/// If there is no adapter or the device cannot be opened.
pub fn own_device(scene: &Scene, rays: usize) -> OwnDevice {
    let desc = wgpu::InstanceDescriptor::new_without_display_handle();
    let instance = wgpu::Instance::new(desc);
    let options = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    };
    let adapter = pollster::block_on(instance.request_adapter(&options)).expect("there is one");
    let wanted = wgpu::DeviceDescriptor {
        required_features: useful_features() & adapter.features(),
        required_limits: required_limits(scene, rays).expect("it is small"),
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&wanted)).expect("it opens");
    let info = adapter.get_info();
    OwnDevice {
        device,
        queue,
        info,
    }
}

/// Creates a buffer with `contents` on a device.
pub fn filled_buffer(own: &OwnDevice, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    own.device
        .create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents,
            usage,
        })
}

/// Starts a thread pool in which to run a measured closure.
///
/// # Panics
/// If the system refuses to start the threads.
pub fn pool(threads: usize) -> ThreadPool {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("the machine can start threads")
}

/// Returns the arguments after `--`, without options of the harness.
pub fn words() -> impl Iterator<Item = String> {
    std::env::args().skip(1).filter(|arg| !arg.starts_with('-'))
}

/// Prints a table on stderr. `|` separates the columns of `header`.
#[expect(clippy::print_stderr, reason = "facts for whoever runs the benchmark")]
pub fn print_table(title: &str, header: &str, rows: Vec<Vec<String>>) {
    let mut table = Table::new();
    table.set_header(header.split('|')).add_rows(rows);
    eprintln!("\n{title}\n{table}\n");
}
