//! Vertices that lie in buffers of a program's own.

use crate::scenes::camera;
use crate::wgpu_lent::{adapter, device_on};
use abvh::own_device::{OwnDevice, required_features, required_limits};
use abvh::{Device, Error, Hits, Mesh, MeshId, Point, Query, Scene, Source, Tracer, Update};
use wgpu::util::DeviceExt;
use wgpu::{Buffer, BufferUsages};

/// A sheet of triangles, at some height and somewhat bent.
pub(crate) fn sheet(height: f32) -> Vec<Point> {
    let at = |i: u32| (i % 20) as f32 - 9.5;
    let bend = |i: u32| height + 0.1 * (i as f32 * height).sin();
    let point = |i: u32| [at(i), bend(i), at(i / 20)];
    (0..400).map(point).collect()
}

pub(crate) fn triangles() -> Vec<[u32; 3]> {
    let corners = (0..380).filter(|i| i % 20 != 19);
    let both = |i: u32| [[i, i + 1, i + 20], [i + 1, i + 21, i + 20]];
    corners.flat_map(both).collect()
}

/// Two sheets.
pub(crate) fn scene() -> (Scene, [MeshId; 2]) {
    let mut scene = Scene::new();
    let sheets = [0.0, 1.0].map(|height| {
        let mesh = Mesh::streamed(&sheet(height), &triangles());
        scene.add(mesh.unwrap())
    });
    (scene, sheets)
}

/// A scene of two sheets, traced on a device of its own.
pub(crate) struct Own {
    pub(crate) device: OwnDevice,
    pub(crate) tracer: Tracer,
    pub(crate) sheets: [MeshId; 2],
}

impl Own {
    pub(crate) fn new(update: Update) -> Self {
        Self::on(&adapter(), update)
    }

    fn on(adapter: &wgpu::Adapter, update: Update) -> Self {
        let (scene, sheets) = scene();
        let limits = required_limits(&scene, camera().pixels()).unwrap();
        let (device, queue, info) = device_on(adapter, required_features(), limits);
        let device = OwnDevice {
            device,
            queue,
            info,
        };
        let builder = Tracer::builder().device(Device::from(device.clone()));
        let tracer = builder.update(update).threads(2).build(scene).unwrap();
        Self {
            device,
            tracer,
            sheets,
        }
    }

    /// A buffer that holds points after one that is no vertex.
    pub(crate) fn buffer(&self, points: &[Point], usage: BufferUsages) -> Buffer {
        let all = [&[[9.0; 3]], points].concat();
        self.bytes(bytemuck::cast_slice(&all), usage)
    }

    pub(crate) fn bytes(&self, contents: &[u8], usage: BufferUsages) -> Buffer {
        let about = wgpu::util::BufferInitDescriptor {
            label: None,
            contents,
            usage,
        };
        self.device.device.create_buffer_init(&about)
    }

    /// What a camera sees after each sheet was moved, from a buffer or from the host, or not at all.
    pub(crate) fn step(&mut self, moved: [Option<(f32, bool)>; 2]) -> Vec<Option<(u32, [u32; 3])>> {
        let to = moved.map(|moved| moved.map(|(height, _)| sheet(height)));
        let buffers = to.each_ref().map(|points| {
            let points = points.as_deref().unwrap_or_default();
            self.buffer(points, BufferUsages::COPY_SRC)
        });
        let mut step = self.tracer.step(0.0);
        for i in [0, 1] {
            let (Some(points), Some((_, on_device))) = (&to[i], moved[i]) else {
                continue;
            };
            let source = match on_device {
                true => Source::Wgpu(buffers[i].slice(12..)),
                false => Source::Host(points),
            };
            step.vertices(self.sheets[i], source).unwrap();
        }
        let query = step.trace(&camera(), Query::Closest).unwrap();
        let done = step.submit().unwrap();
        bits(self.tracer.hits(done, query).unwrap())
    }
}

pub(crate) fn bits(hits: Hits<'_>) -> Vec<Option<(u32, [u32; 3])>> {
    let hit = |ray| {
        let hit = hits.closest(ray)?;
        let numbers = [hit.t, hit.u, hit.v].map(f32::to_bits);
        Some((hit.mesh.index() as u32 * 1000 + hit.triangle, numbers))
    };
    (0..hits.len()).map(hit).collect()
}

pub(crate) fn vertices_may_lie_in_a_buffer_of_the_programs() {
    let (device, host) = (true, false);
    let steps = [
        [Some((0.5, device)), None],
        [None, None],
        [Some((0.75, device)), Some((1.5, host))],
        [Some((0.25, host)), Some((1.75, device))],
        [None, Some((2.0, device))],
        // One vertex is outlying.
        [Some((-1e9, device)), None],
        [Some((f32::NAN, device)), Some((1.0, device))],
        [Some((0.5, host)), None],
    ];
    for update in [Update::Async, Update::Rebuild] {
        let [mut found, mut expected] = [0; 2].map(|_| Own::new(update));
        for moved in steps {
            let seen = found.step(moved);
            let hosts = moved.map(|m| m.map(|(height, _)| (height, host)));
            assert!(seen == expected.step(hosts), "{update:?} {moved:?}");
        }
    }
}

pub(crate) fn a_buffer_that_does_not_fit_is_an_error() {
    let adapter = adapter();
    let mut own = Own::on(&adapter, Update::Auto);
    let buffer = own.buffer(&sheet(0.0), BufferUsages::COPY_SRC);
    let stored = own.buffer(&sheet(0.0), BufferUsages::STORAGE);
    let foreign = Own::on(&adapter, Update::Auto).buffer(&sheet(0.0), BufferUsages::COPY_SRC);
    let mesh = own.sheets[0];
    let mut ask = |from| own.tracer.step(0.0).vertices(mesh, Source::Wgpu(from));
    assert!(matches!(ask(buffer.slice(..)), Err(Error::Count { .. })));
    assert!(matches!(ask(stored.slice(12..)), Err(Error::Device(_))));
    assert!(matches!(ask(buffer.slice(2..4802)), Err(Error::Device(_))));
    ask(buffer.slice(12..)).unwrap();
    // Of another device's the submission tells; what follows is none the worse.
    let mut step = own.tracer.step(0.0);
    let said = step.vertices(mesh, Source::Wgpu(foreign.slice(12..)));
    let traced = step.trace(&camera(), Query::Closest);
    let submitted = traced.and_then(|_| step.submit());
    assert!(said.is_err() || submitted.is_err());
    let hits = own.step([Some((0.5, true)), None]);
    assert!(hits == Own::new(Update::Auto).step([Some((0.5, false)), None]));
}

/// Even where no query has seen them yet.
pub(crate) fn vertices_of_a_buffer_stay_while_another_mesh_is_replaced() {
    let [mut found, mut expected] = [true, false].map(|on_device| {
        let mut own = Own::new(Update::Auto);
        own.step([Some((0.5, on_device)), Some((1.0, on_device))]);
        let with = Mesh::streamed(&sheet(1.25)[..60], &triangles()[..76]).unwrap();
        let replacement = own.tracer.replace(own.sheets[0], with).unwrap();
        let moved = sheet(2.0);
        let buffer = own.buffer(&moved, BufferUsages::COPY_SRC);
        let source = match on_device {
            true => Source::Wgpu(buffer.slice(12..)),
            false => Source::Host(&moved),
        };
        let mut dropped = own.tracer.step(0.0);
        dropped.vertices(own.sheets[1], source).unwrap();
        own.tracer.commit(replacement).unwrap();
        own
    });
    assert!(found.step([None, None]) == expected.step([None, None]));
    let next = |on_device| [None, Some((0.25, on_device))];
    assert!(found.step(next(true)) == expected.step(next(false)));
}
