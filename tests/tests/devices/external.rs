//! Vertices, rays and answers in memory that another device shares, and a semaphore that tells when they are there.

use crate::other_device::{Bytes, Exported, OtherDevice};
use crate::scenes::camera;
use crate::sheets::{self, Met, Moved, bits, see_as_of_the_host, sheet, triangles};
use crate::wgpu_rays::{all_kinds, scene as swarm};
use abvh::external_memory::{ExternalBuffer, ExternalRays};
use abvh::{
    Device, Error, Mesh, MeshId, Point, Query, QueryId, Ray, Scene, Source, Step, StepId, Tracer,
    Update,
};

fn tracer(scene: Scene, update: Update) -> Tracer {
    let builder = Tracer::builder().device(Device::Vulkan(None)).threads(2);
    builder.update(update).build(scene).unwrap()
}

/// Why memory, and why a semaphore, cannot be shared here.
pub(crate) fn lacks() -> [Option<String>; 2] {
    let mut tracer = tracer(Scene::new(), Update::Auto);
    let (memory, semaphore) = (tracer.external_buffer(16), tracer.external_semaphore());
    [memory.err(), semaphore.err()].map(|lack| lack.map(|e| e.to_string()))
}

fn import(other: &OtherDevice, buffer: &ExternalBuffer) -> Bytes {
    other.import(Exported {
        fd: buffer.fd().unwrap(),
        size: buffer.size(),
        allocation_size: buffer.allocation_size(),
        memory_type: buffer.memory_type(),
    })
}

/// Two sheets, and memory that another device shares: for the vertices of each, after some bytes that are none.
struct Shared {
    other: OtherDevice,
    tracer: Tracer,
    sheets: [MeshId; 2],
    memory: [(ExternalBuffer, Bytes); 2],
}

const OFFSET: u64 = 20;

impl Shared {
    fn new(update: Update) -> Self {
        let (scene, sheets) = sheets::scene();
        let mut tracer = tracer(scene, update);
        let first = tracer.external_buffer(16).unwrap();
        let other = OtherDevice::open(first.device_uuid());
        let memory = [0, 1].map(|_| {
            let buffer = tracer.external_buffer(OFFSET + 12 * 400).unwrap();
            let bytes = import(&other, &buffer);
            (buffer, bytes)
        });
        Self {
            other,
            tracer,
            sheets,
            memory,
        }
    }

    /// Begins a step after each sheet was moved, by the other device or by the host, or not at all.
    fn begin(&mut self, moved: Moved) -> (StepId, QueryId) {
        let mut step = self.tracer.step(0.0);
        for i in [0, 1] {
            let Some((height, is_shared)) = moved[i] else {
                continue;
            };
            let (points, (buffer, bytes)) = (sheet(height), &self.memory[i]);
            let source = match is_shared {
                true => {
                    self.other.write(*bytes, OFFSET, words(&points), None);
                    let offset = OFFSET;
                    Source::External { buffer, offset }
                }
                false => Source::Host(&points),
            };
            step.vertices(self.sheets[i], source).unwrap();
        }
        let query = step.trace(&camera(), Query::Closest);
        let query = query.unwrap();
        (step.submit().unwrap(), query)
    }

    fn step(&mut self, moved: Moved) -> Vec<Met> {
        let (done, query) = self.begin(moved);
        bits(self.tracer.hits(done, query).unwrap())
    }
}

pub(crate) fn words(points: &[Point]) -> &[u8] {
    bytemuck::cast_slice(points)
}

pub(crate) fn vertices_may_lie_in_external_memory() {
    let (shared, host) = (true, false);
    let steps = [
        [Some((0.5, shared)), None],
        [None, None],
        [Some((0.75, shared)), Some((1.5, host))],
        [Some((0.25, host)), Some((1.75, shared))],
        [None, Some((2.0, host))],
        [Some((1.25, shared)), Some((0.75, shared))],
        [None, Some((2.25, shared))],
        // One vertex is outlying.
        [Some((-1e9, shared)), None],
        [Some((f32::NAN, shared)), Some((1.0, shared))],
        [Some((0.5, host)), None],
    ];
    see_as_of_the_host(Shared::new, Shared::step, &steps);
}

/// Even where no query has seen them yet.
pub(crate) fn vertices_of_external_memory_stay_while_another_mesh_is_replaced() {
    let [mut found, mut expected] = [true, false].map(|is_shared| {
        let mut own = Shared::new(Update::Auto);
        own.step([Some((0.5, is_shared)), Some((1.0, is_shared))]);
        let with = Mesh::streamed(&sheet(1.25)[..60], &triangles()[..76]).unwrap();
        let replacement = own.tracer.replace(own.sheets[0], with).unwrap();
        let moved = sheet(2.0);
        let (buffer, bytes) = &own.memory[1];
        own.other.write(*bytes, OFFSET, words(&moved), None);
        let offset = OFFSET;
        let source = match is_shared {
            true => Source::External { buffer, offset },
            false => Source::Host(&moved),
        };
        let mut dropped = own.tracer.step(0.0);
        dropped.vertices(own.sheets[1], source).unwrap();
        own.tracer.commit(replacement).unwrap();
        own
    });
    assert!(found.step([None, None]) == expected.step([None, None]));
    let next = [None, Some((0.25, false))];
    assert!(found.step(next) == expected.step(next));
    // The device is another one now.
    let (buffer, offset) = (&found.memory[1].0, OFFSET);
    let mut step = found.tracer.step(0.0);
    let said = step.vertices(found.sheets[1], Source::External { buffer, offset });
    assert!(matches!(said, Err(Error::Device(_))), "{said:?}");
}

pub(crate) fn rays_and_answers_may_lie_in_external_memory() {
    let list = all_kinds();
    let nowhere = [[f32::NAN; 3]; 3];
    let mut nothing = Scene::new();
    nothing.add(Mesh::fixed(&nowhere, &[[0, 1, 2]]).unwrap());
    for (scene, hits_some) in [(swarm(), true), (nothing, false)] {
        let mut tracer = tracer(scene, Update::Auto);
        let size = 32 * list.len() as u64;
        let [rays, room] = [0; 2].map(|_| tracer.external_buffer(size).unwrap());
        let other = OtherDevice::open(rays.device_uuid());
        let [given, answers] = [&rays, &room].map(|buffer| import(&other, buffer));
        other.write(given, 0, bytemuck::cast_slice(&list), None);
        for query in [Query::Closest, Query::Any] {
            let expected = found(&mut tracer, query, |step| step.trace(&list, query));
            assert_eq!(expected.iter().any(Option::is_some), hits_some);
            other.write(answers, 0, &vec![7; size as usize], None);
            for answers in [None, Some(&room)] {
                let (rays, count) = (&rays, list.len());
                let asked = ExternalRays {
                    rays,
                    count,
                    answers,
                };
                let seen = found(&mut tracer, query, |step| step.trace_external(asked, query));
                assert!(seen == expected, "{query:?} {}", answers.is_some());
            }
            let each = if query == Query::Any { 1 } else { 4 };
            let written = other.read(answers, 4 * each * list.len());
            let written: &[u32] = bytemuck::cast_slice(&written);
            let seen = written.chunks(each).map(|answer| match *answer {
                [t, u, v, triangle] if triangle != u32::MAX => Some([t, u, v, triangle]),
                [word] if word != 0 => Some([0; 4]),
                _ => None,
            });
            assert!(seen.eq(expected), "{query:?}");
        }
    }
}

/// What a query of a step finds, as it is written to answers.
fn found(
    tracer: &mut Tracer,
    query: Query,
    ask: impl FnOnce(&mut Step<'_>) -> abvh::Result<QueryId>,
) -> Vec<Option<[u32; 4]>> {
    let mut step = tracer.step(0.5);
    let asked = ask(&mut step).unwrap();
    let done = step.submit().unwrap();
    let hits = tracer.hits(done, asked).unwrap();
    let answer = |ray| match query {
        Query::Any => hits.is_hit(ray).then_some([0; 4]),
        _ => hits.closest(ray).map(|hit| {
            let [t, u, v] = [hit.t, hit.u, hit.v].map(f32::to_bits);
            [t, u, v, hit.triangle]
        }),
    };
    (0..hits.len()).map(answer).collect()
}

pub(crate) fn misuse_of_external_memory_is_an_error() {
    let [mut own, other] = [0; 2].map(|_| Shared::new(Update::Auto));
    let (mesh, (buffer, _)) = (own.sheets[0], &own.memory[0]);
    let foreign = &other.memory[0].0;
    let small = own.tracer.external_buffer(64).unwrap();
    for (buffer, offset) in [
        (foreign, 0),
        (&small, 0),
        (buffer, OFFSET + 2),
        (buffer, buffer.size() - 12 * 400 + 4),
        (buffer, u64::MAX - 3),
    ] {
        let source = Source::External { buffer, offset };
        let said = own.tracer.step(0.0).vertices(mesh, source);
        assert!(matches!(said, Err(Error::Device(_))), "{offset} {said:?}");
    }
    for (rays, count, answers) in [
        (foreign, 2, None),
        (&small, 3, None),
        (&small, usize::MAX, None),
        (buffer, 5, Some(&small)),
        (buffer, 2, Some(foreign)),
        (buffer, 2, Some(buffer)),
    ] {
        let asked = ExternalRays {
            rays,
            count,
            answers,
        };
        let said = own.tracer.step(0.0).trace_external(asked, Query::Closest);
        assert!(matches!(said, Err(Error::Device(_))), "{count} {said:?}");
    }
    for bytes in [1 << 60, u64::MAX] {
        let said = own.tracer.external_buffer(bytes);
        assert!(matches!(said, Err(Error::Device(_))), "{said:?}");
    }
    let mut host = Tracer::builder().device(Device::Cpu);
    host = host.threads(2);
    let mut host = host.build(Scene::new()).unwrap();
    let said = host.external_buffer(64);
    assert!(matches!(said, Err(Error::Device(_))), "{said:?}");
    let said = host.external_semaphore();
    assert!(matches!(said, Err(Error::Device(_))), "{said:?}");
    // Where there is no semaphore, its extension is named.
    if let Err(e) = own.tracer.external_semaphore() {
        assert!(
            e.to_string().contains("VK_KHR_external_semaphore_fd"),
            "{e}"
        );
    }
    let moved = [Some((0.5, false)), None];
    assert!(own.step(moved) == Shared::new(Update::Auto).step(moved));
}

/// Neither waits on the host: what one writes is spoilt before, and read before it is spoilt again.
pub(crate) fn steps_and_another_device_wait_for_each_other() {
    let [mut shared, mut expected] = [0; 2].map(|_| Shared::new(Update::Async));
    let semaphore = shared.tracer.external_semaphore().unwrap();
    let imported = shared.other.import_semaphore(semaphore.fd().unwrap());
    let height = |frame: u64| 0.25 + 0.05 * frame as f32;
    let mut before = None;
    for frame in 0..20 {
        let (buffer, bytes) = &shared.memory[0];
        let (points, offset) = (sheet(height(frame)), OFFSET);
        let when = (imported, [2 * frame, 2 * frame + 1]);
        shared
            .other
            .write(*bytes, OFFSET, words(&points), Some(when));
        let mut step = shared.tracer.step(0.0);
        step.vertices(shared.sheets[0], Source::External { buffer, offset })
            .unwrap();
        step.synchronize(&semaphore, 2 * frame + 1, 2 * frame + 2)
            .unwrap();
        let query = step.trace(&camera(), Query::Closest);
        let query = query.unwrap();
        let done = step.submit().unwrap();
        assert!(shared.other.reaches(imported, 2 * frame));
        if let Some((done, query)) = before.replace((done, query)) {
            let seen = bits(shared.tracer.hits(done, query).unwrap());
            let host = expected.step([Some((height(frame - 1), false)), None]);
            assert!(seen == host, "{frame}");
        }
    }
    assert!(shared.other.reaches(imported, 40));
    let mut step = shared.tracer.step(0.0);
    for values in [[39, 40], [41, 41], [42, 41]] {
        let said = step.synchronize(&semaphore, values[0], values[1]);
        assert!(matches!(said, Err(Error::Device(_))), "{values:?} {said:?}");
    }
    step.trace(&[Ray::new([0.0; 3], [1.0; 3])], Query::Any)
        .unwrap();
    let said = step.synchronize(&semaphore, 41, 42);
    assert_eq!(said, Err(Error::TooLate));
}
