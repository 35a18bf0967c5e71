//! Queries of the library in a static scene.
//!
//! Compares sixteen cameras in one step with one camera of the same total number of pixels. The sixteen are either
//! tiles of the large image, with the same rays, or see its whole view at a quarter of its resolution. Also compares
//! rays in device memory with the rays of a camera.
//!
//! `cargo bench -p benches --bench queries [-- auto|cpu|vulkan|wgpu]`. Steps (`ABVH_STEPS`) are submitted without
//! waiting for hits, so the device determines the time of a step.

use abvh::own_device::{RayBuffers, wgpu};
use abvh::{Camera, Device, Mesh, Query, Ray, Scene, Step, Tracer};
use benches::{
    Mesh as Motion, STEP_SCENES, camera, device, filled_buffer, median, own_device, print_table,
    setting, words,
};
use std::time::Instant;

/// Size of one of sixteen cameras, and of one camera with the same total number of pixels.
const SMALL: [u32; 2] = [640, 480];
const LARGE: [u32; 2] = [2560, 1920];
/// Size of a camera whose rays are also traced as a list: 2.3 million rays.
const LISTED: [u32; 2] = [1920, 1200];
const ROUNDS: usize = 5;

fn main() {
    let device = device(&words().next().unwrap_or_default());
    let motions = STEP_SCENES.map(|scene| Motion::open(scene).expect("demos open"));
    let rows = motions.iter().map(|motion| many(motion, &device)).collect();
    let header = "scene|device|one camera ms|16 tiles ms|ratio|16 whole views ms|ratio";
    print_table("Rays of sixteen cameras of 640x480", header, rows);
    let rows = motions.iter().map(listed).collect();
    let header =
        "scene|camera ms|in blocks|times|camera's, shuffled|any direction, of the host|of a buffer";
    print_table("Closest hits of 2.3 million rays, wgpu", header, rows);
}

fn standing(motion: &Motion) -> Scene {
    let mesh = Mesh::fixed(
        &motion.positions(motion.start()),
        motion.animation.triangles(),
    );
    let mut scene = Scene::new();
    scene.add(mesh.expect("it is a mesh"));
    scene
}

/// Returns the milliseconds per step, as the median of several rounds.
fn time(tracer: &mut Tracer, ask: &mut dyn FnMut(&mut Step<'_>)) -> f64 {
    let steps = setting("ABVH_STEPS", 300);
    let mut round = || {
        let begun = Instant::now();
        for _ in 0..steps {
            let mut step = tracer.step(0.0);
            ask(&mut step);
            step.submit().expect("it traces");
        }
        begun.elapsed().as_secs_f64() * 1e3 / steps as f64
    };
    // Warm-up: compiles kernels.
    round();
    median(&(0..ROUNDS).map(|_| round()).collect::<Vec<_>>())
}

fn trace(step: &mut Step<'_>, camera: &Camera) {
    step.trace(camera, Query::Closest).expect("it traces");
}

fn many(motion: &Motion, device: &Device) -> Vec<String> {
    let tracer = Tracer::builder()
        .device(device.clone())
        .build(standing(motion));
    let mut tracer = tracer.expect("the device is there");
    let [small, large] = [SMALL, LARGE].map(|size| camera(motion, size));
    let tiles: Vec<_> = (0..16).map(|i| tile(&large, [i % 4, i / 4])).collect();
    let one = time(&mut tracer, &mut |step| trace(step, &large));
    let [of_tiles, of_views] = [&tiles[..], &[small; 16]].map(|cameras| {
        time(&mut tracer, &mut |step| {
            cameras.iter().for_each(|camera| trace(step, camera));
        })
    });
    let device = tracer.device().to_owned();
    let mut row = vec![motion.label.clone(), device];
    let numbers = [one, of_tiles, of_tiles / one, of_views, of_views / one];
    row.extend(numbers.map(|x| format!("{x:.3}")));
    row
}

/// Returns the camera of one tile of an image, by the tile's column and row.
fn tile(whole: &Camera, [column, row]: [u32; 2]) -> Camera {
    let [x, y] = [column * SMALL[0], row * SMALL[1]].map(|pixels| pixels as f32);
    let corner = |i: usize| whole.corner[i] + x * whole.across[i] + y * whole.down[i];
    let [width, height] = SMALL;
    Camera {
        corner: std::array::from_fn(corner),
        width,
        height,
        ..*whole
    }
}

fn listed(motion: &Motion) -> Vec<String> {
    let scene = standing(motion);
    let camera = camera(motion, LISTED);
    let count = camera.pixels();
    let own = own_device(&scene, count);
    let tracer = Tracer::builder().device(Device::from(own.clone()));
    let mut tracer = tracer.build(scene).expect("it is loaded");
    let buffer = |rays: &[Ray]| {
        let usage = wgpu::BufferUsages::STORAGE;
        filled_buffer(&own, bytemuck::cast_slice(rays), usage)
    };
    let hits = own.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 16 * count as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let of_buffer = |tracer: &mut Tracer, rays: &[Ray]| {
        let rays = buffer(rays);
        let asked = RayBuffers {
            rays: &rays,
            count,
            results: Some(&hits),
        };
        time(tracer, &mut |step| {
            step.trace_buffers(asked, Query::Closest)
                .expect("it traces");
        })
    };
    let blocks = benches::blocks(&camera, [8, 4]);
    let mut next = benches::random_numbers();
    let mut shuffled = blocks.clone();
    for i in (1..shuffled.len()).rev() {
        shuffled.swap(i, (next() * (i + 1) as f32) as usize % (i + 1));
    }
    let anywhere = benches::random_rays(motion, count);
    let of_camera = time(&mut tracer, &mut |step| trace(step, &camera));
    let in_blocks = of_buffer(&mut tracer, &blocks);
    let shuffled = of_buffer(&mut tracer, &shuffled);
    let of_host = time(&mut tracer, &mut |step| {
        step.trace(&anywhere, Query::Closest).expect("it traces");
    });
    let anywhere = of_buffer(&mut tracer, &anywhere);
    let numbers = [
        of_camera,
        in_blocks,
        in_blocks / of_camera,
        shuffled,
        of_host,
        anywhere,
    ];
    let numbers = numbers.map(|x| format!("{x:.3}"));
    [motion.label.clone()].into_iter().chain(numbers).collect()
}
