//! Vertices, rays and answers in memory that another device shares, and a semaphore that tells when they are there.

use crate::lent_rays::{Found, LentRays, find_what_the_hosts_do, found};
use crate::other_device::{Exported, Importer, OtherDevice};
use crate::scenes::camera;
use crate::sheets::{
    self, Moved, Sheets, bits, see_as_of_the_host, sheet, stay_while_another_is_replaced,
};
use abvh::external_memory::{ExternalBuffer, ExternalRays};
use abvh::{Device, Error, MeshId, Point, Query, Ray, Scene, Source, Step, Tracer, Update};

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

fn import<O: Importer>(other: &O, buffer: &ExternalBuffer) -> O::Memory {
    other.import(Exported {
        fd: buffer.fd().unwrap(),
        size: buffer.size(),
        allocation_size: buffer.allocation_size(),
        memory_type: buffer.memory_type(),
    })
}

/// Two sheets, and memory that another device shares: for the vertices of each, after some bytes that are none.
pub(crate) struct Shared<O: Importer> {
    other: O,
    tracer: Tracer,
    sheets: [MeshId; 2],
    memory: [(ExternalBuffer, O::Memory); 2],
}

const OFFSET: u64 = 20;

impl<O: Importer> Sheets for Shared<O> {
    fn open(update: Update) -> Self {
        let (scene, sheets) = sheets::scene();
        let mut tracer = tracer(scene, update);
        let first = tracer.external_buffer(16).unwrap();
        let other = O::open(first.device_uuid());
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

    fn traced(&mut self) -> (&mut Tracer, [MeshId; 2]) {
        (&mut self.tracer, self.sheets)
    }

    /// By the other device or by the host.
    fn moved(&mut self, moved: Moved) -> Step<'_> {
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
        step
    }
}

pub(crate) fn words(points: &[Point]) -> &[u8] {
    bytemuck::cast_slice(points)
}

pub(crate) fn vertices_may_lie_in_external_memory() {
    see_as_of_the_host::<Shared<OtherDevice>>();
}

pub(crate) fn vertices_of_external_memory_stay_while_another_mesh_is_replaced() {
    let [mut found, mut expected] = stay_while_another_is_replaced::<Shared<OtherDevice>>();
    let next = [None, Some((0.25, false))];
    assert!(found.see(next) == expected.see(next));
    // The device is the same, and so is its memory.
    let [theirs, hosts] = [true, false].map(|on_device| [None, Some((0.75, on_device))]);
    assert!(found.see(theirs) == expected.see(hosts));
}

/// Rays and answers in memory that another device shares.
pub(crate) struct SharedRays<O: Importer> {
    other: O,
    tracer: Tracer,
    count: usize,
    /// For rays, and for answers.
    memory: [(ExternalBuffer, O::Memory); 2],
}

impl<O: Importer> SharedRays<O> {
    pub(crate) fn new(scene: Scene, rays: &[Ray]) -> Self {
        let mut tracer = tracer(scene, Update::Auto);
        let made = [0; 2].map(|_| tracer.external_buffer(size_of_val(rays) as u64));
        let made = made.map(Result::unwrap);
        let other = O::open(made[0].device_uuid());
        let memory = made.map(|buffer| {
            let bytes = import(&other, &buffer);
            (buffer, bytes)
        });
        other.write(memory[0].1, 0, bytemuck::cast_slice(rays), None);
        Self {
            other,
            tracer,
            count: rays.len(),
            memory,
        }
    }
}

impl<O: Importer> LentRays for SharedRays<O> {
    fn tracer(&mut self) -> &mut Tracer {
        &mut self.tracer
    }

    fn ask(&mut self, query: Query, has_room: bool) -> Found {
        let [(rays, _), (room, _)] = &self.memory;
        let asked = ExternalRays {
            rays,
            count: self.count,
            answers: has_room.then_some(room),
        };
        found(&mut self.tracer, query, |step| {
            step.trace_external(asked, query)
        })
    }

    fn fill_room(&mut self, byte: u8) {
        let (room, bytes) = &self.memory[1];
        let all = vec![byte; room.size() as usize];
        self.other.write(*bytes, 0, &all, None);
    }

    fn room(&mut self, words: usize) -> Vec<u32> {
        let read = self.other.read(self.memory[1].1, 4 * words);
        bytemuck::cast_slice(&read).to_vec()
    }
}

pub(crate) fn rays_and_answers_may_lie_in_external_memory() {
    find_what_the_hosts_do(SharedRays::<OtherDevice>::new);
}

pub(crate) fn misuse_of_external_memory_is_an_error() {
    let open = || Shared::<OtherDevice>::open(Update::Auto);
    let (mut own, other) = (open(), open());
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
        assert!(matches!(said, Err(Error::Unsupported(_))), "{said:?}");
    }
    let host = Tracer::builder().device(Device::Cpu).build(Scene::new());
    let mut host = host.unwrap();
    let said = [
        host.external_buffer(64).err(),
        host.external_semaphore().err(),
    ];
    assert!(matches!(
        said,
        [Some(Error::Unsupported(_)), Some(Error::Unsupported(_))]
    ));
    // Where there is no semaphore, its extension is named.
    if let Err(e) = own.tracer.external_semaphore() {
        assert!(
            e.to_string().contains("VK_KHR_external_semaphore_fd"),
            "{e}"
        );
    }
    let moved = [Some((0.5, false)), None];
    assert!(own.see(moved) == open().see(moved));
}

/// Neither waits on the host: what one writes is spoilt before, and read before it is spoilt again.
pub(crate) fn wait_for_each_other<O: Importer>() {
    let [mut shared, mut expected] = [0; 2].map(|_| Shared::<O>::open(Update::Async));
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
            let host = expected.see([Some((height(frame - 1), false)), None]);
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

pub(crate) fn steps_and_another_device_wait_for_each_other() {
    wait_for_each_other::<OtherDevice>();
}
