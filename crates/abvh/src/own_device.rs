//! Traces on a wgpu device that the program opened, and shares buffers with the program's shaders.
//!
//! Vertices and rays may come from the program's buffers: see [`Source::Wgpu`](crate::Source::Wgpu) and
//! [`Step::trace_buffers`].
//!
//! [`Step::encode`] records a step into the program's command encoder, which the program submits. The program's shaders
//! trace rays with [`shader_module`](crate::shader_module).
//!
//! The device needs the features [`required_features`] and the limits [`required_limits`], and is faster with
//! [`useful_features`]. The library and the program submit to the same queue, whose work runs in order. So a shader can
//! read a query's results without a wait on the host: see [`Tracer::hits_buffer`].

use crate::loaded::{Answer, Loaded, find};
use crate::motion::Joined;
use crate::step::{Deferred, apart, check};
use crate::tracer::State;
use crate::{Device, Error, MeshId, Query, QueryId, Ray, Result, Scene, Step, StepId, Tracer};
use backend::Backend;
use backend::Policy as Update;
use geom::Point;
use gpu_wgpu::{LentRays, WgpuBackend, from_device};
pub use gpu_wgpu::{required_features, useful_features};
use std::any::Any;
/// The version of wgpu that the library uses.
pub use wgpu;

/// A wgpu device with its queue and adapter information. Buffers and encoders must belong to the same wgpu instance:
/// wgpu panics otherwise, and also if the queue belongs to another device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnDevice {
    /// The device. Its error and device-lost callbacks are not changed.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Information about the adapter that the device was opened on.
    pub info: wgpu::AdapterInfo,
}

impl From<OwnDevice> for Device {
    fn from(device: OwnDevice) -> Self {
        Self::Own(Box::new(device))
    }
}

impl OwnDevice {
    pub(crate) fn open(&self) -> Result<Box<dyn Backend>> {
        let own = self.clone();
        let opened = from_device(own.device, own.queue, own.info);
        Ok(Box::new(opened.map_err(Error::of_backend)?))
    }
}

/// Returns the smallest limits that suffice for a scene and queries of up to `rays` rays. The program merges them with
/// its own limits.
///
/// # Errors
/// As for [`Builder::build`](crate::Builder::build), if the meshes are too large to be joined.
pub fn required_limits(scene: &Scene, rays: usize) -> Result<wgpu::Limits> {
    let joined = Joined::of(scene.meshes.clone())?;
    Ok(gpu_wgpu::required_limits(&joined.animation, rays))
}

impl Loaded {
    pub(crate) fn wgpu(&mut self) -> Option<&mut WgpuBackend> {
        let backend: &mut dyn Any = self.driver.backend();
        backend.downcast_mut()
    }

    /// Sets the program's buffer that the vertices of a streamed mesh are read from.
    pub(crate) fn bring_points(
        &mut self,
        (mesh, index): (MeshId, usize),
        from: wgpu::BufferSlice<'_>,
    ) -> Result<()> {
        let expected = self.joined.range_of(index).len() * size_of::<Point>();
        check(mesh, "bytes", expected, from.size() as usize)?;
        let is_copied = from.buffer().usage().contains(wgpu::BufferUsages::COPY_SRC);
        if !is_copied || from.offset() % wgpu::COPY_BUFFER_ALIGNMENT != 0 {
            let why = "a buffer of vertices needs the usage COPY_SRC and an offset of whole floats";
            return Err(Error::Misuse(why.into()));
        }
        self.take_points(index, from)
    }

    fn take_points(&mut self, mesh: usize, from: wgpu::BufferSlice<'_>) -> Result<()> {
        let first = self.joined.range_of(mesh).start;
        let backend = self.wgpu().ok_or_else(no_wgpu)?;
        backend.gpu_mut().bring_points(first, from);
        self.driver.forget_key_frames();
        self.joined.is_on_device(mesh);
        Ok(())
    }

    /// Drops the results of steps whose encoders were dropped, and of later steps, which depend on them.
    pub(crate) fn give_up_dropped(&mut self) {
        let dropped = self.wgpu().map(WgpuBackend::give_up_dropped);
        let dropped = dropped.unwrap_or_default();
        if let Some(&first) = dropped.first() {
            self.driver.give_up(&dropped);
            self.under_way.retain(|ticket| !dropped.contains(ticket));
            self.results.retain(|answer| answer.ticket < first);
            self.joined.on_device.lose();
        }
    }

    /// Passes the ray buffers of the queries that will be traced next to the backend, in the order of the queries.
    pub(crate) fn lend_rays(&mut self, all: &[(QueryId, Deferred, Query)]) {
        let lent = all.iter().filter_map(|(_, rays, _)| match rays {
            Deferred::Wgpu(lent, _) => Some(lent.clone()),
            Deferred::Camera(_) | Deferred::Nothing => None,
        });
        let lent: Vec<_> = lent.collect();
        if let Some(backend) = self.wgpu().filter(|_| !lent.is_empty()) {
            backend.gpu_mut().lend_rays(lent);
        }
    }

    /// Checks that a step with these queries can be encoded, as one submission.
    fn check_encode(&mut self, queries: &[(QueryId, Deferred, Query)]) -> Result<()> {
        let all = queries.iter().map(|(_, rays, query)| rays.query(*query));
        let all: Vec<_> = all.collect();
        let is_one = self.driver.can_batch(&all);
        self.wgpu().ok_or_else(no_wgpu)?;
        if !self.has_tree() {
            let why = "the first tree is built before a step is encoded";
            return Err(Error::Misuse(why.into()));
        }
        let why = match (self.update, is_one) {
            (Update::Rebuild, _) => "trees that steps wait for are not encoded",
            (_, false) => "such queries are encoded in a step each",
            _ => return Ok(()),
        };
        Err(Error::Unsupported(why.into()))
    }

    /// Lends the program's encoder to the backend, and leaves an empty one in its place until it is returned.
    fn lend_encoder(&mut self, encoder: &mut wgpu::CommandEncoder) -> Result<()> {
        let gpu = self.wgpu().ok_or_else(no_wgpu)?.gpu_mut();
        let none = gpu.encoder().map_err(Error::of_backend)?;
        let lent = gpu.lend_encoder(std::mem::replace(encoder, none));
        lent.map_err(Error::of_backend)
    }

    fn return_encoder(&mut self, encoder: &mut wgpu::CommandEncoder) {
        let backend = self.wgpu();
        if let Some(lent) = backend.and_then(|backend| backend.gpu_mut().take_encoder()) {
            *encoder = lent;
        }
    }

    /// Takes over the vertices that only the device has from `before`, a scene that differs in mesh `but` only.
    pub(crate) fn follow_on_device(&mut self, before: &mut Self, but: usize) -> Result<()> {
        before.give_up_dropped();
        let backend = before.wgpu();
        if backend.is_some_and(|backend| backend.gpu().has_encoded()) {
            // The program must have submitted the commands that write these vertices.
            before.finish_all(&mut None)?;
        }
        for mesh in (0..self.joined.meshes.len()).filter(|&mesh| mesh != but) {
            let run = before.joined.range_of(mesh);
            let Some(backend) = before.wgpu() else {
                return Ok(());
            };
            let points = backend.gpu_mut().brought_points(&run);
            if let Some((points, bytes)) = points.map_err(Error::of_backend)? {
                self.take_points(mesh, points.slice(bytes))?;
            }
        }
        if before
            .joined
            .on_device
            .check(&before.joined.meshes)
            .is_err()
        {
            self.joined.on_device.lose();
        }
        Ok(())
    }
}

/// A buffer of rays, and an optional buffer for their results, both created by the program.
#[derive(Clone, Copy, Debug)]
pub struct RayBuffers<'a> {
    /// Rays, with usage `STORAGE`. A ray is eight floats in the memory layout of [`Ray`]: origin, `t_min`, direction,
    /// `t_max`.
    pub rays: &'a wgpu::Buffer,
    /// Number of rays, from the start of the buffer.
    pub count: usize,
    /// Results, with usages `STORAGE` and `COPY_DST`, and also `COPY_SRC` for [`Tracer::hits`]. [`Query::Closest`]
    /// writes the format of [`Tracer::hits_buffer`], and [`Query::Any`] a `u32` per ray, which is not 0 for a hit.
    /// Without this buffer, the library uses its own.
    pub answers: Option<&'a wgpu::Buffer>,
}

impl RayBuffers<'_> {
    fn check(&self, query: Query) -> Result<()> {
        use wgpu::BufferUsages as Usage;
        apart(self.answers != Some(self.rays))?;
        let rays = (self.rays, size_of::<Ray>(), Usage::STORAGE);
        let written = Usage::STORAGE | Usage::COPY_DST;
        let answers = |buffer| (buffer, query.answer_bytes(), written);
        for (buffer, bytes, usage) in [rays].into_iter().chain(self.answers.map(answers)) {
            let is_large = (bytes as u64)
                .checked_mul(self.count as u64)
                .is_some_and(|all| all <= buffer.size());
            if !is_large || !buffer.usage().contains(usage) {
                let why = format!(
                    "a buffer of {} rays or answers needs {bytes} bytes each and the usage {usage:?}",
                    self.count
                );
                return Err(Error::Misuse(why));
            }
        }
        Ok(())
    }
}

impl Step<'_> {
    /// Traces rays from a buffer on the program's wgpu device. The device reads them in queue order after the step is
    /// submitted, and they are not copied to the host.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on other devices. [`Error::Misuse`] if a buffer is too small or lacks a usage.
    pub fn trace_buffers(&mut self, buffers: RayBuffers<'_>, query: Query) -> Result<QueryId> {
        buffers.check(query)?;
        self.tracer.current.wgpu().ok_or_else(no_wgpu)?;
        let lent = LentRays {
            rays: buffers.rays.clone(),
            answers: buffers.answers.cloned(),
        };
        Ok(self.defer(Deferred::Wgpu(lent, buffers.count), query))
    }

    /// Ends the step and records it into the program's encoder, after the commands that are already there. It runs when
    /// the program submits them. Earlier commands may write vertices ([`Source::Wgpu`](crate::Source::Wgpu)) and rays,
    /// and later commands may read the results ([`Tracer::hits_buffer`]).
    ///
    /// A step without queries updates the scene for the program's shaders ([`shader_module`](crate::shader_module)).
    ///
    /// The program must submit encoded steps in their order. Until a step is submitted, [`Tracer::hits`] of this step
    /// and the second step after it fail. If the encoder or its commands are dropped instead, this step has no results,
    /// nor do later steps that were begun before. Vertices that only the device had are then lost, and steps return
    /// [`Error::VerticesLost`] until they are passed again.
    ///
    /// wgpu validates commands only when the encoder is finished. It may refuse them, for example because the encoder
    /// belongs to another device or has an open pass. Then [`Tracer::hits`] of this step or the second step after it
    /// returns [`Error::Misuse`], and the tracer continues as if the encoder had been dropped.
    ///
    /// # Errors
    /// [`Error::TooLate`] if the step traced rays in host memory or rendered a picture, which are submitted at once.
    /// [`Error::Misuse`] before the first tree (see [`Tracer::warm_up`]), and while two encoded steps are not
    /// submitted. [`Error::Unsupported`] on other devices, with [`Update::Rebuild`](crate::Update::Rebuild), and for
    /// several queries with [`Intersector::Exact`](crate::Intersector::Exact). [`Error::Device`].
    pub fn encode(mut self, encoder: &mut wgpu::CommandEncoder) -> Result<StepId> {
        if self.deferred.len() < self.queries as usize {
            return Err(Error::TooLate);
        }
        if self.deferred.is_empty() {
            self.defer(Deferred::Nothing, Query::Any);
        }
        self.tracer.current.check_encode(&self.deferred)?;
        self.tracer.current.lend_encoder(encoder)?;
        let begun = self.begin_deferred();
        self.tracer.current.return_encoder(encoder);
        begun?;
        Ok(self.end())
    }
}

pub(crate) fn no_wgpu() -> Error {
    Error::Unsupported("it has no buffers of wgpu's".into())
}

impl Tracer {
    /// Returns the buffer of a query's closest hits on a wgpu device, which is filled once all submitted work is done.
    ///
    /// A hit has 16 bytes: `t`, `u` and `v` as in [`Hit`](crate::Hit), and the index of the triangle among the
    /// triangles of all meshes ([`Tracer::first_triangle`]), or 4294967295 for a miss. The buffer is reused when the
    /// query's results are dropped.
    ///
    /// # Errors
    /// [`Error::NoResult`] as for [`Tracer::hits`], and for a query without closest hits. [`Error::Unsupported`] on
    /// other devices.
    pub fn hits_buffer(&self, step: StepId, query: QueryId) -> Result<wgpu::Buffer> {
        let State {
            current, former, ..
        } = &mut *self.shared_state();
        let (loaded, at) = find(current, former, step, query)?;
        let Answer { ticket, place, .. } = loaded.results[at];
        let backend = loaded.wgpu().ok_or_else(no_wgpu)?;
        let found = backend.hits_buffer(ticket, place);
        found.cloned().ok_or(Error::NoResult)
    }
}
