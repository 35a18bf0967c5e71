//! Tests rays that the caller's own shaders trace.

use crate::lent::{Sheets, all_kinds, sheet, triangles, two_sheets};
use crate::wgpu_lent::{bytes_of, filled};
use crate::wgpu_points::SheetsOnCallerDevice;
use abvh::own_device::RayBuffers;
use abvh::shader_module::{SceneBuffers, wgsl};
use abvh::{Device, Error, Intersector, Mesh, Query, Ray, Source, Tracer, Update};
use integration::stage::vast_camera;
use wgpu::{BindGroupEntry, Buffer, BufferUsages, CommandEncoder};

/// A shader with its own bind group and with names that the library's WGSL (`shader_module::wgsl`) might use, too.
const SHADER: &str = "
struct Ray { origin: vec3f, t_min: f32, direction: vec3f, t_max: f32 }
@group(0) @binding(0) var<storage, read> rays: array<Ray>;
@group(0) @binding(1) var<storage, read_write> hits: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> occluded: array<u32>;
@compute @workgroup_size(64)
fn trace_rays(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&rays) { return; }
    let ray = rays[id.x];
    let hit = abvh_closest(ray.origin, ray.t_min, ray.direction, ray.t_max);
    hits[id.x] = vec4u(bitcast<u32>(hit.t), bitcast<u32>(hit.u), bitcast<u32>(hit.v), hit.triangle);
    occluded[id.x] = abvh_any(ray.origin, ray.t_min, ray.direction, ray.t_max);
}";
const MISS: u32 = u32::MAX;
const EXTREME: u32 = u32::MAX - 1;

/// Closest hits and any-hit results.
type Results = (Vec<[u32; 4]>, Vec<u32>);

struct Shader {
    pipeline: wgpu::ComputePipeline,
    rays: Buffer,
    hits: Buffer,
    occluded: Buffer,
}

impl Shader {
    fn new(caller: &SheetsOnCallerDevice, rays: &[Ray]) -> Self {
        let device = &caller.device.device;
        let source = format!("{}{SHADER}", wgsl(1));
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            cache: None,
        });
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let results = |bytes| filled(&caller.device, &vec![7; bytes * rays.len()], usage);
        Self {
            pipeline,
            rays: filled(&caller.device, bytemuck::cast_slice(rays), usage),
            hits: results(16),
            occluded: results(4),
        }
    }

    fn record(
        &self,
        caller: &SheetsOnCallerDevice,
        scene: &SceneBuffers,
        commands: &mut CommandEncoder,
    ) {
        let own_buffers = [&self.rays, &self.hits, &self.occluded].into_iter();
        let entries = own_buffers
            .zip(0..)
            .map(|(buffer, binding)| BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            });
        let mut pass = commands.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        for (group, entries) in [(0, &entries.collect::<Vec<_>>()[..]), (1, &scene.entries())] {
            let bound = wgpu::BindGroupDescriptor {
                label: None,
                layout: &self.pipeline.get_bind_group_layout(group),
                entries,
            };
            let bound = caller.device.device.create_bind_group(&bound);
            pass.set_bind_group(group, &bound, &[]);
        }
        let rays = self.rays.size() as u32 / size_of::<Ray>() as u32;
        pass.dispatch_workgroups(rays.div_ceil(64), 1, 1);
    }

    fn results(&self, caller: &SheetsOnCallerDevice) -> Results {
        let [hits, occluded] = [&self.hits, &self.occluded].map(|b| bytes_of(&caller.device, b));
        (
            bytemuck::cast_slice(&hits).to_vec(),
            bytemuck::cast_slice(&occluded).to_vec(),
        )
    }

    /// Returns the results of the library's queries, with the sheets in their current positions.
    fn queried(&self, caller: &mut SheetsOnCallerDevice) -> Results {
        for query in [Query::Closest, Query::Any] {
            let results = match query {
                Query::Closest => &self.hits,
                _ => &self.occluded,
            };
            let asked = RayBuffers {
                rays: &self.rays,
                count: self.rays.size() as usize / size_of::<Ray>(),
                results: Some(results),
            };
            let mut step = caller.tracer.step(0.0);
            step.trace_buffers(asked, query).unwrap();
            step.submit().unwrap();
        }
        self.results(caller)
    }
}

/// Moves sheets by the caller's commands, traces with its shader, and compares with queries. Only extreme rays differ.
pub(crate) fn shader_hits_match_queries() {
    let mut list = all_kinds();
    // Hits may have negative distances.
    for ray in list.iter_mut().skip(1).step_by(3) {
        ray.t_min = -2.0;
    }
    let starts_far = |ray: &Ray| ray.origin.iter().any(|x| x.abs() > 1e15 && x.is_finite());
    let mut caller = SheetsOnCallerDevice::open(Update::Async);
    caller.tracer.warm_up(0.0).unwrap();
    let shader = Shader::new(&caller, &list);
    // In the last case, one vertex is outlying.
    for (height, is_outlying) in [(0.2, false), (0.4, false), (0.3, false), (0.5, true)] {
        let mut commands = caller
            .device
            .device
            .create_command_encoder(&Default::default());
        let mut points = sheet(height);
        if is_outlying {
            points[7][1] = 1e30;
        }
        let vertices = caller.buffer(&points, BufferUsages::COPY_SRC);
        let (first, second) = (caller.sheets[0], caller.sheets[1]);
        let mut step = caller.tracer.step(0.0);
        step.vertices(first, Source::Wgpu(vertices.slice(12..)))
            .unwrap();
        step.vertices(second, Source::Host(&sheet(1.5 * height)))
            .unwrap();
        step.encode(&mut commands).unwrap();
        let scene = caller.tracer.scene_buffers().unwrap();
        shader.record(&caller, &scene, &mut commands);
        caller.device.queue.submit([commands.finish()]);
        let (hits, occluded) = shader.results(&caller);
        let (expected, expected_any) = shader.queried(&mut caller);
        let met = expected.iter().filter(|hit| hit[3] != MISS).count();
        assert!(met > 100, "{met} rays hit");
        for (i, ray) in list.iter().enumerate() {
            if ray.is_valid() && (is_outlying || starts_far(ray)) {
                assert_eq!((hits[i][3], occluded[i]), (EXTREME, EXTREME), "{ray:?}");
            } else {
                assert_eq!(hits[i], expected[i], "{ray:?} at {height}");
                assert_eq!(occluded[i], expected_any[i], "{ray:?} at {height}");
            }
        }
    }
}

pub(crate) fn untraceable_scene_is_an_error() {
    let caller = SheetsOnCallerDevice::open(Update::Async);
    let refused = |builder: abvh::TracerBuilder, warm: bool| {
        let device = Device::from(caller.device.clone());
        let builder = builder.device(device).threads(2);
        let mut tracer = builder.build(two_sheets().0).unwrap();
        if warm {
            tracer.warm_up(0.0).unwrap();
        }
        matches!(tracer.scene_buffers(), Err(Error::Misuse(_)))
    };
    assert!(refused(Tracer::builder(), false));
    assert!(!refused(Tracer::builder(), true));
    let woop = Tracer::builder().intersector(Intersector::Woop);
    assert!(refused(woop, true));
    let host = Tracer::builder().device(Device::Cpu).build(two_sheets().0);
    assert!(host.unwrap().scene_buffers().is_err());
}

/// The positions are those of the newest vertices only after a step.
pub(crate) fn replaced_or_refused_scene_needs_a_step() {
    let mut caller = SheetsOnCallerDevice::open(Update::Async);
    let is_refused = |tracer: &mut Tracer| {
        let refused = matches!(tracer.scene_buffers(), Err(Error::Misuse(_)));
        tracer.step(0.0).trace(&[], Query::Any).unwrap();
        tracer.scene_buffers().unwrap();
        refused
    };
    caller.tracer.warm_up(0.0).unwrap();
    let mesh = Mesh::streamed(&sheet(0.5), &triangles()).unwrap();
    let replacement = caller.tracer.replace(caller.sheets[0], mesh).unwrap();
    caller.tracer.commit(replacement).unwrap();
    assert!(is_refused(&mut caller.tracer));
    let mut step = caller.moved([Some((0.75, true)), None]);
    step.trace(&vast_camera(), Query::Closest).unwrap();
    step.submit().unwrap_err();
    assert!(is_refused(&mut caller.tracer));
}
