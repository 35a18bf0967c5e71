//! A program with a wgpu device of its own: the library traces there, and the program's shader reads the hits where they lie.

#![expect(clippy::print_stdout, reason = "it shows what it found")]

use abvh::own_device::{OwnDevice, required_features, required_limits, wgpu};
use abvh::{Camera, Device, Mesh, Query, Scene, Source, Tracer};
use std::error::Error;
use wgpu::util::DeviceExt;

const SIZE: [u32; 2] = [64, 48];

/// Counts rays that hit something nearer than 4.
const SHADER: &str = "
struct Hit { t: f32, u: f32, v: f32, triangle: u32 }
@group(0) @binding(0) var<storage, read> hits: array<Hit>;
@group(0) @binding(1) var<storage, read_write> near: atomic<u32>;
@compute @workgroup_size(64)
fn count(@builtin(global_invocation_id) id: vec3u) {
    if id.x < 64 * 48 && hits[id.x].triangle != 0xffffffff && hits[id.x].t < 4.0 {
        atomicAdd(&near, 1u);
    }
}";

fn open(limits: wgpu::Limits) -> Result<OwnDevice, Box<dyn Error>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_features: required_features(),
        required_limits: limits,
        ..Default::default()
    }))?;
    let info = adapter.get_info();
    Ok(OwnDevice {
        device,
        queue,
        info,
    })
}

/// Has the shader go over the hits, in the queue behind the trace; nobody waits for it before the count is read.
fn count(own: &OwnDevice, hits: &wgpu::Buffer) -> Result<u32, Box<dyn Error>> {
    let OwnDevice { device, queue, .. } = own;
    let near = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: &[0; 4],
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
    });
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry {
                binding: 0,
                resource: hits.as_entire_binding(),
            },
            wgpu::BindGroupEntry {
                binding: 1,
                resource: near.as_entire_binding(),
            },
        ],
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups((SIZE[0] * SIZE[1]).div_ceil(64), 1, 1);
    drop(pass);
    queue.submit([encoder.finish()]);
    let (said, heard) = std::sync::mpsc::channel();
    wgpu::util::DownloadBuffer::read_buffer(device, queue, &near.slice(..), move |bytes| {
        let count = bytes.map(|b| bytemuck::pod_read_unaligned::<u32>(&b));
        said.send(count).expect("somebody listens");
    });
    device.poll(wgpu::PollType::wait_indefinitely())?;
    Ok(heard.recv()??)
}

fn main() -> Result<(), Box<dyn Error>> {
    let sheet = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
    let mut scene = Scene::new();
    let mesh = scene.add(Mesh::streamed(&sheet, &[[0, 1, 2]])?);
    let own = open(required_limits(&scene, (SIZE[0] * SIZE[1]) as usize)?)?;
    let device = Device::from(own.clone());
    let mut tracer = Tracer::builder().device(device).build(scene)?;
    let eye = [0.0, 5.0, 0.1];
    let camera = Camera::look_at(eye, [0.0; 3], [0.0, 0.0, 1.0], 60.0, SIZE).ok_or("no picture")?;
    for height in 0..5 {
        let mut step = tracer.step(0.0);
        let lifted = sheet.map(|[x, _, z]| [x, 0.5 * height as f32, z]);
        step.vertices(mesh, Source::Host(&lifted))?;
        let query = step.trace(&camera, Query::Closest)?;
        let done = step.submit()?;
        let near = count(&own, tracer.hits_buffer(done, query)?)?;
        let distances = tracer.hits(done, query)?.distances();
        assert_eq!(near as usize, distances.filter(|&t| t < 4.0).count());
        println!("{height}: {near} rays meet it nearer than 4");
    }
    Ok(())
}

#[test]
fn the_shader_sees_the_hits() {
    main().unwrap();
}
