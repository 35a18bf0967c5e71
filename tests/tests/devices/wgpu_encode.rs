//! Tests steps that are recorded into the caller's command encoder.

use crate::lent::{Found, OnHost, Sheets, bits, nothing, sheet, triangles, two_sheets};
use crate::scenes::{
    SHADOWED, camera, hits, interpolate_and_refit, open, submit_trace, swarm, trace, tree_at,
};
use crate::wgpu_lent::{backend_on, bytes_of, filled, own_device};
use crate::wgpu_points::SheetsOnCallerDevice;
use abvh::own_device::{
    OwnDevice, RayBuffers, required_features, required_limits, useful_features,
};
use abvh::{
    Device, Error, Intersector, Mesh, Query, QueryId, Ray, Scene, Source, StepId, Tracer, Update,
};
use backend::{Backend, Generation, Rays};
use conformance::uneven_tree;
use integration::is_full;
use integration::stage::own_device_with;
use std::iter::zip;
use wgpu::{Buffer, BufferUsages, CommandEncoder};

/// A scene of two sheets. The caller's commands move the first one.
struct Encoded {
    caller: SheetsOnCallerDevice,
    vertices: Buffer,
    rays: Buffer,
    results: Buffer,
}

/// A step in commands that are not submitted yet, and the buffer into which they copy the results.
struct Step {
    commands: CommandEncoder,
    id: StepId,
    queries: [QueryId; 2],
    copied: Buffer,
}

impl Encoded {
    fn new(update: Update) -> Self {
        let mut caller = SheetsOnCallerDevice::open(update);
        caller.tracer.warm_up(0.0).unwrap();
        let rays: Vec<Ray> = camera().rays().collect();
        let copied = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let results = vec![0; 16 * rays.len()];
        Self {
            vertices: caller.buffer(&sheet(7.0), copied | BufferUsages::STORAGE),
            rays: filled(
                &caller.device,
                bytemuck::cast_slice(&rays),
                BufferUsages::STORAGE,
            ),
            results: filled(&caller.device, &results, BufferUsages::STORAGE | copied),
            caller,
        }
    }

    fn commands(&self) -> CommandEncoder {
        let desc = Default::default();
        self.caller.device.device.create_command_encoder(&desc)
    }

    /// Encodes two queries of a camera's rays, with sheets at these heights. The first sheet's vertices are copied on
    /// the device when the commands run.
    fn encode(&mut self, [on_device, on_host]: [f32; 2]) -> Step {
        let mut commands = self.commands();
        let from = self
            .caller
            .buffer(&sheet(on_device), BufferUsages::COPY_SRC);
        commands.copy_buffer_to_buffer(&from, 0, &self.vertices, 0, None);
        let sheets = self.caller.sheets;
        let mut step = self.caller.tracer.step(0.0);
        let vertices = Source::Wgpu(self.vertices.slice(12..));
        step.vertices(sheets[0], vertices).unwrap();
        let vertices = sheet(on_host);
        step.vertices(sheets[1], Source::Host(&vertices)).unwrap();
        let buffers = RayBuffers {
            rays: &self.rays,
            count: camera().pixels(),
            results: Some(&self.results),
        };
        let queries = [
            step.trace(&camera(), Query::Closest).unwrap(),
            step.trace_buffers(buffers, Query::Closest).unwrap(),
        ];
        let id = step.encode(&mut commands).unwrap();
        let usage = BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let copied = vec![0; self.results.size() as usize];
        let copied = filled(&self.caller.device, &copied, usage);
        commands.copy_buffer_to_buffer(&self.results, 0, &copied, 0, None);
        Step {
            commands,
            id,
            queries,
            copied,
        }
    }

    fn submit(&self, commands: CommandEncoder) {
        self.caller.device.queue.submit([commands.finish()]);
    }

    /// Checks all results of a step against the host's.
    fn check(
        &mut self,
        (id, queries, copied): (StepId, [QueryId; 2], &Buffer),
        expected: &[Found],
    ) {
        // `copied` has the results of the second query, which the next step overwrites in `results`.
        assert!(bits(self.caller.tracer.hits(id, queries[0]).unwrap()) == expected);
        let bytes = bytes_of(&self.caller.device, copied);
        let words: &[[u32; 4]] = bytemuck::cast_slice(&bytes);
        for (&[t, u, v, triangle], met) in zip(words, expected) {
            let found = (triangle != u32::MAX).then_some([t, u, v]);
            assert_eq!(found, met.map(|[t, u, v, _]| [t, u, v]));
        }
    }
}

/// Tests two steps in flight at a time.
pub(crate) fn steps_keep_the_command_order() {
    for update in [Update::Async, Update::Refit] {
        let mut found = Encoded::new(update);
        let mut expected = OnHost::open(update);
        for i in 0..8 {
            let moved = [2 * i, 2 * i + 1].map(|i| [0.1 * i as f32, 1.0 + 0.2 * i as f32]);
            let steps = moved.map(|to| found.encode(to));
            let ids = steps.map(|step| {
                found.submit(step.commands);
                (step.id, step.queries, step.copied)
            });
            for ((id, queries, copied), to) in zip(ids, moved) {
                let expected = expected.see(to.map(|height| Some((height, false))));
                found.check((id, queries, &copied), &expected);
            }
        }
    }
}

pub(crate) fn unsubmitted_step_has_no_results() {
    let mut encoded = Encoded::new(Update::Async);
    let steps = [0.25, 0.5].map(|height| encoded.encode([height, 1.0]));
    for step in &steps {
        let is_done = encoded.caller.tracer.is_done(step.id, step.queries[0]);
        assert_eq!(is_done, Ok(false));
        let said = encoded.caller.tracer.hits(step.id, step.queries[0]).err();
        assert!(matches!(said, Some(Error::Misuse(_))), "{said:?}");
    }
    // A third step cannot be encoded.
    let mut commands = encoded.commands();
    let mut step = encoded.caller.tracer.step(0.0);
    let count = camera().pixels();
    let buffers = RayBuffers {
        rays: &encoded.rays,
        count,
        results: None,
    };
    step.trace_buffers(buffers, Query::Closest).unwrap();
    let said = step.encode(&mut commands);
    assert!(matches!(said, Err(Error::Misuse(_))), "{said:?}");
    let mut expected = OnHost::open(Update::Async);
    for (step, height) in zip(steps, [0.25, 0.5]) {
        encoded.submit(step.commands);
        let expected = expected.see([Some((height, false)), Some((1.0, false))]);
        encoded.check((step.id, step.queries, &step.copied), &expected);
        let is_done = encoded.caller.tracer.is_done(step.id, step.queries[0]);
        assert_eq!(is_done, Ok(true));
    }
    // Failed waits have not removed the steps from the queue.
    let statistics = encoded.caller.tracer.statistics().unwrap();
    assert_eq!((statistics.generation, statistics.age), (1, 2));
    // The rays of the third step are not traced later.
    let mut step = encoded.caller.tracer.step(0.0);
    let said = step.trace(abvh::Rays::OnDevice(count), Query::Closest);
    assert!(matches!(said, Err(Error::Unsupported(_))), "{said:?}");
}

/// Checks that the next step has the host's results, with vertices from device and host memory.
fn check_next(encoded: &mut Encoded, [on_device, on_host]: [f32; 2]) {
    let step = encoded.encode([on_device, on_host]);
    encoded.submit(step.commands);
    let moved = [Some((on_device, false)), Some((on_host, false))];
    let expected = OnHost::open(Update::Async).see(moved);
    encoded.check((step.id, step.queries, &step.copied), &expected);
}

/// Checks that earlier steps keep their results, and that later ones are as if the step had never existed.
pub(crate) fn step_with_dropped_commands_is_abandoned() {
    let drop_encoder: fn(CommandEncoder) = drop;
    let drop_finished: fn(CommandEncoder) = |commands| drop(commands.finish());
    let cases = [
        (Update::Async, drop_encoder),
        (Update::Async, drop_finished),
        (Update::Refit, drop_encoder),
        (Update::DeviceRebuild, drop_finished),
        (Update::Refit, drop_finished),
        (Update::DeviceRebuild, drop_encoder),
    ];
    // How commands are discarded does not depend on the policy.
    let count = if is_full() { cases.len() } else { 4 };
    for (update, drop_commands) in cases.into_iter().take(count) {
        let mut encoded = Encoded::new(update);
        check_next(&mut encoded, [0.5, 1.0]);
        let before = encoded.encode([0.75, 1.25]);
        let dropped = encoded.encode([0.25, 1.5]);
        encoded.submit(before.commands);
        drop_commands(dropped.commands);
        let expected = OnHost::open(Update::Async);
        let expected = { expected }.see([Some((0.75, false)), Some((1.25, false))]);
        let found = (before.id, before.queries, &before.copied);
        encoded.check(found, &expected);
        let tracer = &mut encoded.caller.tracer;
        let said = tracer.hits(dropped.id, dropped.queries[0]).err();
        assert_eq!(said, Some(Error::NoResult));
        // The commands would have copied vertices that the host does not have.
        let lost = Err(Error::VerticesLost(encoded.caller.sheets[0]));
        assert_eq!(encoded.caller.tracer.step(0.0).trace(&[], Query::Any), lost);
        for height in [0.5, 0.25, 1.0] {
            check_next(&mut encoded, [height, 1.75]);
        }
        // A step that passes all vertices again is not affected.
        let dropped = encoded.encode([0.75, 1.5]);
        drop_commands(dropped.commands);
        check_next(&mut encoded, [0.5, 1.75]);
    }
    check_replacement_of_lost_vertices();
}

/// Checks that a replacement does not lose the vertices of another mesh that were passed again.
fn check_replacement_of_lost_vertices() {
    let mut encoded = Encoded::new(Update::Async);
    let [first, second] = encoded.caller.sheets;
    drop(encoded.encode([0.75, 1.25]).commands);
    let tracer = &mut encoded.caller.tracer;
    let vertices = Source::Wgpu(encoded.vertices.slice(12..));
    tracer.step(0.0).vertices(second, vertices).unwrap();
    let mesh = Mesh::streamed(&sheet(0.5), &triangles()).unwrap();
    let replacement = tracer.replace(first, mesh).unwrap();
    tracer.commit(replacement).unwrap();
    tracer.step(0.0).trace(&[], Query::Any).unwrap();
}

/// Drops many steps with vertices in host memory, then tests steps, a replacement and a rebuilt tracer.
pub(crate) fn tracer_recovers_from_dropped_commands() {
    let vertices = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
    let mesh = || Mesh::streamed(&vertices, &[[0, 1, 2]]).unwrap();
    let mut scene = Scene::new();
    let id = scene.add(mesh());
    let own = own_device(required_limits(&scene, 1).unwrap());
    let builder = || Tracer::builder().device(own.clone().into()).threads(2);
    let mut tracer = builder().build(scene.clone()).unwrap();
    tracer.warm_up(0.0).unwrap();
    let discard_steps = |tracer: &mut Tracer, steps: usize| {
        for i in 0..steps {
            let mut commands = own.device.create_command_encoder(&Default::default());
            let mut step = tracer.step(0.0);
            let moved = vertices.map(|p| [p[0], i as f32, p[2]]);
            step.vertices(id, Source::Host(&moved)).unwrap();
            step.encode(&mut commands).unwrap();
        }
    };
    let see = |tracer: &mut Tracer, height: f32| {
        let mut step = tracer.step(0.0);
        let moved = vertices.map(|p| [p[0], height, p[2]]);
        step.vertices(id, Source::Host(&moved)).unwrap();
        let ray = Ray::new([0.0, 9.0, 0.0], [0.0, -1.0, 0.0]);
        let query = step.trace(&[ray], Query::Closest).unwrap();
        let done = step.submit().unwrap();
        let hit = tracer.hits(done, query).unwrap().closest(0).unwrap();
        assert_eq!(hit.t, 9.0 - height);
    };
    for steps in [1, 2, 9] {
        discard_steps(&mut tracer, steps);
        see(&mut tracer, 2.0);
        // The same position, which must be uploaded again.
        discard_steps(&mut tracer, steps);
        see(&mut tracer, 2.0);
    }
    discard_steps(&mut tracer, 2);
    let replacement = tracer.replace(id, mesh()).unwrap();
    discard_steps(&mut tracer, 1);
    tracer.commit(replacement).unwrap();
    see(&mut tracer, 3.0);
    // Both encoders are dropped after both steps.
    let encode = |tracer: &mut Tracer| {
        let mut commands = own.device.create_command_encoder(&Default::default());
        tracer.step(0.0).encode(&mut commands).unwrap();
        commands
    };
    drop([encode(&mut tracer), encode(&mut tracer)]);
    see(&mut tracer, 4.0);
    discard_steps(&mut tracer, 2);
    let mut tracer = builder().build_in_place_of(tracer, scene).unwrap();
    tracer.warm_up(0.0).unwrap();
    assert!(tracer.statistics().is_none());
}

/// wgpu refuses these commands only when they are finished. The step then has no results.
pub(crate) fn refused_commands_have_no_results() {
    let mut encoded = Encoded::new(Update::Async);
    let other = own_device(encoded.caller.device.device.limits());
    let refused = |device: &OwnDevice, commands: CommandEncoder| {
        let scope = (device.device).push_error_scope(wgpu::ErrorFilter::Validation);
        device.queue.submit([commands.finish()]);
        assert!(pollster::block_on(scope.pop()).is_some());
    };
    for is_foreign in [true, false, true] {
        let device = match is_foreign {
            true => &other,
            false => &encoded.caller.device,
        };
        let mut commands = (device.device).create_command_encoder(&Default::default());
        let desc = wgpu::ComputePassDescriptor::default();
        let pass = (!is_foreign).then(|| commands.begin_compute_pass(&desc).forget_lifetime());
        let mut step = encoded.caller.tracer.step(0.0);
        let vertices = sheet(4.0);
        (step.vertices(encoded.caller.sheets[1], Source::Host(&vertices))).unwrap();
        let query = step.trace(&camera(), Query::Closest).unwrap();
        let id = step.encode(&mut commands).unwrap();
        drop(pass);
        refused(device, commands);
        let said = encoded.caller.tracer.hits(id, query).err();
        let is_rejected =
            matches!(&said, Some(Error::Misuse(why)) if why.starts_with("wgpu rejected"));
        assert!(is_rejected, "{said:?}");
        let said = encoded.caller.tracer.hits(id, query).err();
        assert_eq!(said, Some(Error::NoResult));
        check_next(&mut encoded, [0.5, 1.0]);
    }
}

/// Also checks that commands recorded before the refused step are kept.
pub(crate) fn unencodable_steps_are_refused() {
    let camera = camera();
    let refused = |tracer: &mut Tracer, encoded: &Encoded, queries: usize| {
        let mut commands = encoded.commands();
        let from = encoded.caller.buffer(&sheet(3.0), BufferUsages::COPY_SRC);
        let usage = BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let to = encoded.caller.buffer(&sheet(4.0), usage);
        commands.copy_buffer_to_buffer(&from, 0, &to, 0, None);
        let mut step = tracer.step(0.0);
        for _ in 0..queries {
            step.trace(&camera, Query::Closest).unwrap();
        }
        let said = step.encode(&mut commands);
        encoded.submit(commands);
        let copied = bytes_of(&encoded.caller.device, &to);
        let points: &[f32] = bytemuck::cast_slice(&copied);
        assert_eq!(points[3..], *sheet(3.0).as_flattened());
        said.err()
    };
    let mut encoded = Encoded::new(Update::Async);
    let device = |encoded: &Encoded| Device::from(encoded.caller.device.clone());
    let on = |device| Tracer::builder().device(device).threads(2);
    let build = |builder: abvh::TracerBuilder| builder.build(two_sheets().0).unwrap();
    let is_unsupported = |said| matches!(said, Some(Error::Unsupported(_)));
    // There is no tree yet.
    let mut first = build(on(device(&encoded)));
    let said = refused(&mut first, &encoded, 1);
    assert!(matches!(said, Some(Error::Misuse(_))), "{said:?}");
    for update in [Update::Rebuild, Update::Lockstep(0), Update::Lockstep(2)] {
        let mut waiting = build(on(device(&encoded)).update(update));
        waiting.warm_up(0.0).unwrap();
        let said = refused(&mut waiting, &encoded, 1);
        assert!(is_unsupported(said), "{update:?}");
    }
    let mut exact = build(on(device(&encoded)).intersector(Intersector::Exact));
    exact.warm_up(0.0).unwrap();
    assert!(is_unsupported(refused(&mut exact, &encoded, 2)));
    assert_eq!(refused(&mut exact, &encoded, 1), None);
    let mut host = build(on(Device::Cpu));
    host.warm_up(0.0).unwrap();
    assert!(is_unsupported(refused(&mut host, &encoded, 1)));
    // Rays in host memory are traced immediately, so the step can no longer be encoded.
    let mut commands = encoded.commands();
    let mut step = encoded.caller.tracer.step(0.0);
    step.trace(&[Ray::new([0.0; 3], [1.0; 3])], Query::Any)
        .unwrap();
    assert_eq!(step.encode(&mut commands), Err(Error::TooLate));
}

/// Writes of the queue run before the commands, so they must not overwrite the tree that the commands read.
pub(crate) fn tree_outlives_commands_that_read_it() {
    let (animation, camera) = (swarm(300), camera());
    let limits = gpu_wgpu::required_limits(&animation, camera.pixels());
    let features = required_features() | useful_features();
    let own = own_device_with(features, limits);
    let mut backend = backend_on(&own).unwrap();
    open(&mut backend, &animation);
    interpolate_and_refit(&mut backend, &animation, 0.3);
    let expected = trace(&mut backend, Rays::Camera(&camera), SHADOWED);
    interpolate_and_refit(&mut backend, &animation, 0.3);
    let commands = own.device.create_command_encoder(&Default::default());
    backend.gpu_mut().set_encoder(commands).unwrap();
    let ticket = submit_trace(&mut backend, Rays::Camera(&camera), SHADOWED);
    let commands = backend.gpu_mut().take_encoder().unwrap();
    let second = Generation(2);
    backend.adopt(&tree_at(&animation, 0.0), second).unwrap();
    let all = 0..animation.triangle_count() as u32;
    let leaves: Vec<u32> = all.rev().filter(|&t| animation.is_live(t)).collect();
    let third = uneven_tree(animation.triangle_count(), &leaves, 8);
    backend.upload_tree(&third, Generation(3)).unwrap();
    own.queue.submit([commands.finish()]);
    assert!(hits(&mut backend, ticket) == expected);
}

/// A step that is not encoded must not run before encoded steps.
pub(crate) fn submitted_step_follows_encoded_steps() {
    let mut encoded = Encoded::new(Update::Async);
    let step = encoded.encode([0.25, 1.5]);
    let said = encoded.caller.tracer.step(0.0).trace(&[], Query::Any);
    assert!(matches!(said, Err(Error::Misuse(_))), "{said:?}");
    encoded.submit(step.commands);
    let moved = [Some((0.25, false)), Some((1.5, false))];
    let expected = OnHost::open(Update::Async).see(moved);
    assert!(encoded.caller.see([None, None]) == expected);
}

/// Without live triangles, kernels still write the results.
pub(crate) fn results_without_triangles_keep_the_command_order() {
    let device = own_device(required_limits(&nothing(), 1).unwrap());
    let builder = Tracer::builder().device(Device::from(device.clone()));
    let mut tracer = builder.threads(2).build(nothing()).unwrap();
    tracer.warm_up(0.0).unwrap();
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
    let [earlier, rays, results] = [7, 0, 0].map(|byte| filled(&device, &[byte; 32], usage));
    let mut commands = device.device.create_command_encoder(&Default::default());
    commands.copy_buffer_to_buffer(&earlier, 0, &results, 0, None);
    let mut step = tracer.step(0.0);
    let buffers = RayBuffers {
        rays: &rays,
        count: 1,
        results: Some(&results),
    };
    let query = step.trace_buffers(buffers, Query::Closest).unwrap();
    let done = step.encode(&mut commands).unwrap();
    device.queue.submit([commands.finish()]);
    assert_eq!(tracer.hits_buffer(done, query).as_ref(), Ok(&results));
    let miss = [f32::INFINITY.to_bits(), 0, 0, u32::MAX];
    let written = bytes_of(&device, &results);
    assert_eq!(written[..16], *bytemuck::cast_slice::<u32, u8>(&miss));
}

/// A dropped step does not free the resources of the step before it, which the caller may still submit.
pub(crate) fn dropped_step_keeps_resources_of_earlier_step() {
    let mut encoded = Encoded::new(Update::Async);
    let first = encoded.encode([0.5, 1.0]);
    drop(encoded.encode([0.25, 1.5]).commands);
    let mut commands = encoded.commands();
    let mut step = encoded.caller.tracer.step(0.0);
    let vertices = Source::Wgpu(encoded.vertices.slice(12..));
    step.vertices(encoded.caller.sheets[0], vertices).unwrap();
    let said = step.encode(&mut commands);
    assert!(matches!(said, Err(Error::Misuse(_))), "{said:?}");
    encoded.submit(first.commands);
    let moved = [Some((0.5, false)), Some((1.0, false))];
    let expected = OnHost::open(Update::Async).see(moved);
    encoded.check((first.id, first.queries, &first.copied), &expected);
    check_next(&mut encoded, [0.75, 1.25]);
}
