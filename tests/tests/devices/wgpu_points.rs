//! Vertices that lie in buffers of a program's own.

use crate::scenes::camera;
use crate::sheets::{Met, Moved, bits, scene, see_as_of_the_host, sheet, triangles};
use crate::wgpu_lent::adapter;
use crate::wgpu_own::{filled, own_device};
use abvh::own_device::{OwnDevice, required_limits};
use abvh::{Device, Error, Mesh, MeshId, Point, Query, Source, Tracer, Update};
use wgpu::{Buffer, BufferUsages};

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
        let device = own_device(adapter, limits);
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
        filled(&self.device, contents, usage)
    }

    /// What a camera sees after each sheet was moved, from a buffer or from the host, or not at all.
    pub(crate) fn step(&mut self, moved: Moved) -> Vec<Met> {
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
    see_as_of_the_host(Own::new, Own::step, &steps);
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
