//! Rays that lie in buffers of a program's own, and answers that are written there.

use crate::scenes::{rays, swarm};
use crate::wgpu_lent::adapter;
use crate::wgpu_own::{bytes_of, filled, own_device};
use abvh::own_device::{OwnDevice, RayBuffers, required_limits};
use abvh::{Device, Error, Intersector, Layout, Mesh, Query, Ray, Scene, Tracer};
use wgpu::{Buffer, BufferUsages};

const HOW: [(Intersector, Layout); 3] = [
    (Intersector::Watertight, Layout::Fast),
    (Intersector::Exact, Layout::Bvh2),
    (Intersector::Woop, Layout::Fast),
];

/// Triangles that fly about, on a device of the program's.
struct Own {
    device: OwnDevice,
    tracer: Tracer,
}

impl Own {
    fn new(scene: Scene, rays: usize, how: (Intersector, Layout)) -> Self {
        Self::on(&adapter(), scene, rays, how)
    }

    fn on(
        adapter: &wgpu::Adapter,
        scene: Scene,
        rays: usize,
        (intersector, layout): (Intersector, Layout),
    ) -> Self {
        let limits = required_limits(&scene, rays).unwrap();
        let device = own_device(adapter, limits);
        let builder = Tracer::builder().intersector(intersector).layout(layout);
        let builder = builder.device(Device::from(device.clone())).threads(2);
        let tracer = builder.build(scene).unwrap();
        Self { device, tracer }
    }

    fn buffer(&self, contents: &[u8], usage: BufferUsages) -> Buffer {
        filled(&self.device, contents, usage)
    }

    fn bytes(&self, buffer: &Buffer) -> Vec<u8> {
        bytes_of(&self.device, buffer)
    }

    /// What rays meet that the host gives: by the library's word, and as `answers` are to be.
    fn given(&mut self, rays: &[Ray], query: Query) -> (Vec<Option<[u32; 4]>>, Vec<u8>) {
        let mut step = self.tracer.step(0.5);
        let asked = step.trace(rays, query).unwrap();
        let done = step.submit().unwrap();
        let answers = match query {
            Query::Closest => {
                let buffer = self.tracer.hits_buffer(done, asked).unwrap().clone();
                self.bytes(&buffer)[..16 * rays.len()].to_vec()
            }
            _ => Vec::new(),
        };
        (self.found(done, asked, rays.len()), answers)
    }

    fn found(
        &mut self,
        done: abvh::StepId,
        asked: abvh::QueryId,
        count: usize,
    ) -> Vec<Option<[u32; 4]>> {
        let hits = self.tracer.hits(done, asked).unwrap();
        assert_eq!(hits.len(), count);
        let hit = |ray| match hits.closest(ray) {
            Some(hit) => Some([hit.t, hit.u, hit.v, hit.triangle as f32].map(f32::to_bits)),
            None => hits.is_hit(ray).then_some([0; 4]),
        };
        (0..count).map(hit).collect()
    }
}

pub(crate) fn scene() -> Scene {
    let swarm = swarm(300);
    let keys = (0..3).map(|key| swarm.key(key).unwrap().to_vec());
    let mut scene = Scene::new();
    scene.add(Mesh::keyframes(keys.collect::<Vec<_>>(), swarm.triangles()).unwrap());
    scene
}

/// Some of which can hit nothing, and some that start far away.
pub(crate) fn all_kinds() -> Vec<Ray> {
    let mut all = rays(1000);
    let spoil: [fn(&mut Ray); 12] = [
        |ray| ray.direction = [0.0, -0.0, 0.0],
        |ray| ray.direction[1] = f32::NAN,
        |ray| ray.direction[2] = f32::INFINITY,
        |ray| ray.origin[0] = f32::NAN,
        |ray| ray.origin[1] = f32::NEG_INFINITY,
        |ray| ray.t_min = f32::NAN,
        |ray| ray.t_max = -f32::NAN,
        |ray| (ray.t_min, ray.t_max) = (1.5, 0.5),
        |ray| (ray.t_min, ray.t_max) = (-0.0, 0.0),
        |ray| (ray.t_min, ray.t_max) = (f32::INFINITY, f32::NEG_INFINITY),
        // Valid, and seen by exact arithmetic alone.
        |ray| (ray.origin, ray.direction) = ([-1e30, 0.01, 0.02], [1.0, 0.0, 0.0]),
        |ray| (ray.origin, ray.direction) = ([0.1, 3e38, 0.0], [0.0, -1.0, 1e-30]),
    ];
    for (i, ray) in all.iter_mut().enumerate() {
        if i % 3 == 0 {
            spoil[i / 3 % spoil.len()](ray);
        }
    }
    all
}

pub(crate) fn rays_may_lie_in_a_buffer_of_the_programs() {
    let list = all_kinds();
    let bytes: &[u8] = bytemuck::cast_slice(&list);
    for how in HOW {
        let mut own = Own::new(scene(), list.len(), how);
        let rays = own.buffer(bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        for query in [Query::Closest, Query::Any] {
            let (expected, written) = own.given(&list, query);
            assert!(expected.iter().flatten().count() > 100);
            let room = own.buffer(&vec![7; 16 * list.len()], usage);
            for answers in [None, Some(&room)] {
                let mut step = own.tracer.step(0.5);
                let asked = RayBuffers {
                    rays: &rays,
                    count: list.len(),
                    answers,
                };
                let asked = step.trace_buffers(asked, query).unwrap();
                let done = step.submit().unwrap();
                let found = own.found(done, asked, list.len());
                assert!(found == expected, "{how:?} {query:?} {}", answers.is_some());
            }
            match query {
                Query::Closest => assert!(own.bytes(&room) == written, "{how:?}"),
                _ => {
                    let words = own.bytes(&room);
                    let words: &[u32] = bytemuck::cast_slice(&words[..4 * list.len()]);
                    let met = words.iter().map(|&word| word != 0);
                    assert!(met.eq(expected.iter().map(Option::is_some)), "{how:?}");
                }
            }
            // What is given by the host next does not go there.
            own.given(&[Ray::new([9.0; 3], [1.0; 3])], query);
            own.given(&[Ray::new([9.0; 3], [1.0; 3])], query);
            own.given(&[Ray::new([9.0; 3], [1.0; 3])], query);
            own.given(&[Ray::new([9.0; 3], [1.0; 3])], query);
            assert!(own.bytes(&rays) == bytes, "{how:?}");
        }
    }
}

/// A program may have others in every step.
pub(crate) fn buffers_of_rays_are_let_go_of() {
    const BYTES: usize = 8 << 20;
    let list = all_kinds();
    let mut own = Own::new(scene(), BYTES / size_of::<Ray>(), HOW[0]);
    let mut all = bytemuck::cast_slice(&list).to_vec();
    all.resize(BYTES, 0);
    let mut step = || {
        let rays = own.buffer(&all, BufferUsages::STORAGE);
        let asked = RayBuffers {
            rays: &rays,
            count: list.len(),
            answers: None,
        };
        let mut step = own.tracer.step(0.5);
        let asked = step.trace_buffers(asked, Query::Closest).unwrap();
        let done = step.submit().unwrap();
        own.found(done, asked, list.len());
        let report = own.device.device.generate_allocator_report();
        report.map(|report| report.total_allocated_bytes)
    };
    let held: Vec<_> = (0..40).filter_map(|_| step()).collect();
    let most = held.iter().skip(20).max();
    let grown = most.map(|most| most.saturating_sub(held[19]));
    assert!(
        grown.is_some_and(|grown| grown <= 2 * BYTES as u64),
        "{held:?}"
    );
}

/// Nor is what stood in the buffer taken for hits.
pub(crate) fn rays_in_a_buffer_miss_where_nothing_can_be_hit() {
    let mut nothing = Scene::new();
    let nowhere = [[f32::NAN; 3]; 3];
    nothing.add(Mesh::fixed(&nowhere, &[[0, 1, 2]]).unwrap());
    let list = all_kinds();
    let mut own = Own::new(nothing, list.len(), HOW[0]);
    let rays = own.buffer(bytemuck::cast_slice(&list), BufferUsages::STORAGE);
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
    for (query, miss) in [
        (Query::Closest, &[0x7f80_0000, 0, 0, u32::MAX][..]),
        (Query::Any, &[0]),
    ] {
        let room = own.buffer(&vec![7; 4 * miss.len() * list.len()], usage);
        let mut step = own.tracer.step(0.0);
        let asked = RayBuffers {
            rays: &rays,
            count: list.len(),
            answers: Some(&room),
        };
        let asked = step.trace_buffers(asked, query).unwrap();
        let done = step.submit().unwrap();
        assert!(
            own.found(done, asked, list.len())
                .iter()
                .all(Option::is_none)
        );
        let bytes = own.bytes(&room);
        let words: &[u32] = bytemuck::cast_slice(&bytes);
        assert!(words.chunks(miss.len()).all(|hit| hit == miss));
    }
}

pub(crate) fn a_buffer_of_rays_that_does_not_fit_is_an_error() {
    let (list, adapter) = (all_kinds(), adapter());
    let mut own = Own::on(&adapter, scene(), list.len(), HOW[0]);
    let rays = own.buffer(bytemuck::cast_slice(&list), BufferUsages::STORAGE);
    let copied = own.buffer(bytemuck::cast_slice(&list), BufferUsages::COPY_SRC);
    let other = Own::on(&adapter, scene(), list.len(), HOW[0]);
    let foreign = other.buffer(bytemuck::cast_slice(&list), BufferUsages::STORAGE);
    let count = list.len();
    let answers = Some(&copied);
    for asked in [
        (&rays, count + 1, None),
        (&copied, count, None),
        (&rays, count, answers),
        (&rays, count, Some(&rays)),
        (&rays, usize::MAX, None),
    ] {
        let (rays, count, answers) = asked;
        let asked = RayBuffers {
            rays,
            count,
            answers,
        };
        let said = own.tracer.step(0.0).trace_buffers(asked, Query::Closest);
        assert!(matches!(said, Err(Error::Device(_))), "{said:?}");
    }
    // Nothing but `trace_buffers` tells where rays lie.
    let nowhere = abvh::Rays::OnDevice(3);
    let said = own.tracer.step(0.0).trace(nowhere, Query::Closest);
    assert!(matches!(said, Err(Error::Device(_))), "{said:?}");
    let asked = RayBuffers {
        rays: &rays,
        count,
        answers: None,
    };
    let mut host = Tracer::builder()
        .device(Device::Cpu)
        .build(scene())
        .unwrap();
    let said = host.step(0.0).trace_buffers(asked, Query::Closest);
    assert!(matches!(said, Err(Error::Device(_))), "{said:?}");
    let asked = RayBuffers {
        rays: &foreign,
        ..asked
    };
    let mut step = own.tracer.step(0.0);
    step.trace_buffers(asked, Query::Closest).unwrap();
    let said = step.submit();
    assert!(matches!(said, Err(Error::Device(_))), "{said:?}");
    // What follows is none the worse.
    let expected = Own::new(scene(), count, HOW[0]).given(&list, Query::Closest);
    assert!(own.given(&list, Query::Closest) == expected);
}
