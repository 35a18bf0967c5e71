//! Tests vertices in the caller's own buffers.

use crate::lent::{
    Moved, OnHost, Sheets, check_vertices_match_host, check_vertices_survive_replacement, sheet,
    two_sheets,
};
use crate::scenes::camera;
use crate::wgpu_lent::{filled, own_device};
use abvh::own_device::{OwnDevice, required_limits};
use abvh::{Device, Error, MeshId, Point, Query, Source, Step, Tracer, Update};
use wgpu::{Buffer, BufferDescriptor, BufferUsages};

/// Usage of each sheet's vertex buffer. The first allows only copy commands. The second can also be read by a kernel.
const USAGES: [BufferUsages; 2] = [
    BufferUsages::COPY_SRC,
    BufferUsages::COPY_SRC.union(BufferUsages::STORAGE),
];

/// A scene of two sheets, traced on the caller's own device.
pub(crate) struct SheetsOnCallerDevice {
    pub(crate) device: OwnDevice,
    pub(crate) tracer: Tracer,
    pub(crate) sheets: [MeshId; 2],
}

impl SheetsOnCallerDevice {
    /// Creates a buffer of `points` after one unused point.
    pub(crate) fn buffer(&self, points: &[Point], usage: BufferUsages) -> Buffer {
        let all = [&[[9.0; 3]], points].concat();
        filled(&self.device, bytemuck::cast_slice(&all), usage)
    }
}

impl Sheets for SheetsOnCallerDevice {
    fn open(update: Update) -> Self {
        let (scene, sheets) = two_sheets();
        let limits = required_limits(&scene, camera().pixels()).unwrap();
        let device = own_device(limits);
        let builder = Tracer::builder().device(Device::from(device.clone()));
        let tracer = builder.update(update).threads(2).build(scene).unwrap();
        Self {
            device,
            tracer,
            sheets,
        }
    }

    fn traced(&mut self) -> (&mut Tracer, [MeshId; 2]) {
        (&mut self.tracer, self.sheets)
    }

    fn moved(&mut self, moved: Moved) -> Step<'_> {
        let to = moved.map(|moved| moved.map(|(height, on_device)| (sheet(height), on_device)));
        let buffers = [0, 1].map(|i| {
            let points = to[i].as_ref().map_or(&[][..], |(points, _)| points);
            self.buffer(points, USAGES[i])
        });
        let mut step = self.tracer.step(0.0);
        for i in [0, 1] {
            let source = match &to[i] {
                None => continue,
                Some((_, true)) => Source::Wgpu(buffers[i].slice(12..)),
                Some((points, false)) => Source::Host(points),
            };
            step.vertices(self.sheets[i], source).unwrap();
        }
        step
    }
}

pub(crate) fn reads_vertices_from_caller_buffers() {
    check_vertices_match_host::<SheetsOnCallerDevice>();
}

pub(crate) fn unsuitable_vertex_buffer_is_an_error() {
    let mut caller = SheetsOnCallerDevice::open(Update::Async);
    let buffer = caller.buffer(&sheet(0.0), BufferUsages::COPY_SRC);
    let stored = caller.buffer(&sheet(0.0), BufferUsages::STORAGE);
    let mesh = caller.sheets[0];
    let mut ask = |from| caller.tracer.step(0.0).vertices(mesh, Source::Wgpu(from));
    assert!(matches!(ask(buffer.slice(..)), Err(Error::Count { .. })));
    assert!(matches!(ask(stored.slice(12..)), Err(Error::Misuse(_))));
    assert!(matches!(ask(buffer.slice(2..4802)), Err(Error::Misuse(_))));
    ask(buffer.slice(12..)).unwrap();
    // A storage binding can cover only the whole words of this buffer.
    let bytes = buffer.size() - 12;
    let odd = caller.device.device.create_buffer(&BufferDescriptor {
        label: None,
        size: bytes + 2,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let mut step = caller.tracer.step(0.0);
    step.vertices(mesh, Source::Wgpu(odd.slice(..bytes)))
        .unwrap();
    step.trace(&camera(), Query::Closest).unwrap();
    step.submit().unwrap();
    let other = own_device(caller.device.device.limits());
    for usage in USAGES {
        let foreign = filled(&other, bytemuck::cast_slice(&sheet(0.0)), usage);
        // The trace or the submission detects another device's buffer.
        let mut step = caller.tracer.step(0.0);
        let said = step.vertices(mesh, Source::Wgpu(foreign.slice(..)));
        let traced = step.trace(&camera(), Query::Closest);
        let submitted = traced.and_then(|_| step.submit());
        assert!(said.is_err() || submitted.is_err());
        // The mesh's vertices are unknown until they are supplied again.
        let again = caller.tracer.step(0.0).trace(&[], Query::Any);
        assert_eq!(again, Err(Error::VerticesLost(mesh)));
        let hits = caller.see([Some((0.5, true)), None]);
        assert!(hits == OnHost::open(Update::Async).see([Some((0.5, false)), None]));
    }
}

pub(crate) fn buffer_vertices_survive_mesh_replacement() {
    check_vertices_survive_replacement::<SheetsOnCallerDevice>();
}
