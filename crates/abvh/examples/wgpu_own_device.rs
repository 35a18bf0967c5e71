//! Traces on the program's own wgpu device. One shader moves the vertices, the library traces rays, and another shader
//! reads the hits from device memory. All commands are in one encoder, which the program submits.

#![expect(clippy::print_stdout, reason = "it shows what it found")]

use abvh::own_device::{OwnDevice, required_features, required_limits, wgpu};
use abvh::{Camera, CameraPose, Device, Mesh, Query, Scene, Source, Tracer};
use std::error::Error;
use wgpu::util::DeviceExt;

const SIZE: [u32; 2] = [64, 48];

/// Lifts the sheet, and counts the hits that are nearer than 4.
const SHADER: &str = "
@group(0) @binding(0) var<storage, read_write> positions: array<f32>;
@compute @workgroup_size(3)
fn lift(@builtin(global_invocation_id) id: vec3u) {
    positions[3 * id.x + 1] += 0.5;
}
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

/// Records a dispatch of the shader entry point `entry` with `buffers`.
fn run(
    encoder: &mut wgpu::CommandEncoder,
    device: &wgpu::Device,
    entry: &str,
    (buffers, groups): (&[&wgpu::Buffer], u32),
) {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some(entry),
        compilation_options: Default::default(),
        cache: None,
    });
    let entries = buffers.iter().zip(0..);
    let entries = entries.map(|(buffer, binding)| wgpu::BindGroupEntry {
        binding,
        resource: buffer.as_entire_binding(),
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries.collect::<Vec<_>>(),
    });
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(groups, 1, 1);
}

fn buffer(own: &OwnDevice, contents: &[f32]) -> wgpu::Buffer {
    let contents: Vec<u8> = contents.iter().flat_map(|x| x.to_le_bytes()).collect();
    let about = wgpu::util::BufferInitDescriptor {
        label: None,
        contents: &contents,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
    };
    own.device.create_buffer_init(&about)
}

/// Reads the number that the shader counted.
fn read(own: &OwnDevice, near: &wgpu::Buffer) -> Result<u32, Box<dyn Error>> {
    let (sender, receiver) = std::sync::mpsc::channel();
    let OwnDevice { device, queue, .. } = own;
    wgpu::util::DownloadBuffer::read_buffer(device, queue, &near.slice(..), move |bytes| {
        let count = bytes.map(|b| bytemuck::pod_read_unaligned::<u32>(&b));
        sender.send(count).expect("the receiver exists");
    });
    device.poll(wgpu::PollType::wait_indefinitely())?;
    Ok(receiver.recv()??)
}

fn main() -> Result<(), Box<dyn Error>> {
    let sheet = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
    let mut scene = Scene::new();
    let mesh = scene.add(Mesh::streamed(&sheet, &[[0, 1, 2]])?);
    let own = open(required_limits(&scene, (SIZE[0] * SIZE[1]) as usize)?)?;
    let device = Device::from(own.clone());
    let mut tracer = Tracer::builder().device(device).build(scene)?;
    tracer.warm_up(0.0)?;
    let pose = CameraPose::new([0.0, 5.0, 0.1], [0.0; 3]).with_fov(60.0);
    let camera = Camera::look_at(pose.with_up([0.0, 0.0, 1.0]), SIZE).ok_or("no picture")?;
    let vertices = buffer(&own, sheet.as_flattened());
    for lift in 1..5 {
        let mut encoder = own.device.create_command_encoder(&Default::default());
        run(&mut encoder, &own.device, "lift", (&[&vertices], 1));
        let mut step = tracer.step(0.0);
        step.vertices(mesh, Source::Wgpu(vertices.slice(..)))?;
        let query = step.trace(&camera, Query::Closest)?;
        let done = step.encode(&mut encoder)?;
        let (hits, near) = (tracer.hits_buffer(done, query)?, buffer(&own, &[0.0]));
        let groups = (SIZE[0] * SIZE[1]).div_ceil(64);
        run(
            &mut encoder,
            &own.device,
            "count",
            (&[&hits, &near], groups),
        );
        own.queue.submit([encoder.finish()]);
        let near = read(&own, &near)?;
        let hits = tracer.hits(done, query)?;
        let nearer = hits.distances().filter(|&t| t < 4.0);
        assert_eq!(near as usize, nearer.count());
        println!("{lift}: {near} rays meet it nearer than 4");
    }
    Ok(())
}

#[test]
fn shader_reads_the_hits() {
    main().unwrap();
}
