//! A wgpu device that the program opened for itself, and results that its own shaders read there.
//!
//! Vertices may come from its buffers, [`Source::Wgpu`](crate::Source::Wgpu), and so may rays: [`Step::trace_buffers`].
//!
//! [`Step::encode`] puts a step among commands of the program's, which it submits itself. Its shaders trace rays by
//! [`shader_module`](crate::shader_module).
//!
//! It needs the features [`required_features`] and the limits [`required_limits`], and is faster with
//! [`useful_features`]. What the library submits goes in order with what the program submits to the same queue, so a shader
//! reads a query's results without anyone waiting for them: see [`Tracer::hits_buffer`].

use crate::loaded::{Answer, Loaded, find};
use crate::motion::Joined;
use crate::step::{Deferred, apart, check};
use crate::tracer::State;
use crate::{Device, Error, MeshId, Query, QueryId, Ray, Result, Scene, Step, StepId, Tracer};
use backend::Backend;
use geom::Point;
use gpu_wgpu::{LentRays, WgpuBackend, from_device};
pub use gpu_wgpu::{required_features, useful_features};
use pipeline::Update;
use std::any::Any;
/// The version of wgpu that the library speaks.
pub use wgpu;

/// A device, its queue, and what its adapter says of itself. Buffers and encoders must be of the same wgpu instance: wgpu
/// panics if they are not, or if the queue is another device's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnDevice {
    /// The device. Its handlers of errors and of its loss stay as they are.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Of the adapter that it was opened on.
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

/// The limits that a device needs for a scene, traced by up to `rays` rays a query: the least that suffice, to be merged with
/// the program's own.
///
/// # Errors
/// As for [`Builder::build`](crate::Builder::build): the meshes are too large to be joined.
pub fn required_limits(scene: &Scene, rays: usize) -> Result<wgpu::Limits> {
    let joined = Joined::of(scene.meshes.clone())?;
    Ok(gpu_wgpu::required_limits(&joined.animation, rays))
}

impl Loaded {
    pub(crate) fn wgpu(&mut self) -> Option<&mut WgpuBackend> {
        let backend: &mut dyn Any = self.driver.backend();
        backend.downcast_mut()
    }

    /// Has a streamed mesh's vertices come from a buffer of the program's.
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

    /// Forgets steps whose encoders were dropped, and steps after them, which build on what those were to do.
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

    /// Tells of the rays on the device that queries are going to trace, in their order.
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

    /// Whether a step of such queries is one submission.
    fn check_encode(&mut self, queries: &[(QueryId, Deferred, Query)]) -> Result<()> {
        let asked = queries.iter().map(|(_, rays, query)| rays.asked(*query));
        let asked: Vec<_> = asked.collect();
        let is_one = asked.len() < 2 || self.driver.backend().traces_together(&asked);
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

    /// Exchanges the program's commands for none, until they are returned.
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

    /// Takes over what `before`, which differs by one mesh, has on the device alone.
    pub(crate) fn follow_on_device(&mut self, before: &mut Self, but: usize) -> Result<()> {
        before.give_up_dropped();
        let backend = before.wgpu();
        if backend.is_some_and(|backend| backend.gpu().has_encoded()) {
            // What it takes over must have been submitted.
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

/// Rays in a buffer of the program's, and where what they meet is to be written.
#[derive(Clone, Copy, Debug)]
pub struct RayBuffers<'a> {
    /// Eight floats a ray, as [`Ray`] lies in memory: origin, `t_min`, direction, `t_max`. It needs the usage `STORAGE`.
    pub rays: &'a wgpu::Buffer,
    /// How many of them there are, from the first on.
    pub count: usize,
    /// Of [`Query::Closest`] what [`Tracer::hits_buffer`] tells, of [`Query::Any`] a word a ray that is not 0 if it met
    /// anything. It needs the usages `STORAGE` and `COPY_DST`, and `COPY_SRC` for [`Tracer::hits`]. Without it the library
    /// has a buffer.
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
    /// As [`Step::trace`], of rays that lie on the program's wgpu device: they are read in the order of its queue after the
    /// step is submitted, and no host sees them.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on another device; [`Error::Misuse`] where a buffer is too small or lacks a usage.
    pub fn trace_buffers(&mut self, buffers: RayBuffers<'_>, query: Query) -> Result<QueryId> {
        buffers.check(query)?;
        self.tracer.current.wgpu().ok_or_else(no_wgpu)?;
        let lent = LentRays {
            rays: buffers.rays.clone(),
            answers: buffers.answers.cloned(),
        };
        Ok(self.defer(Deferred::Wgpu(lent, buffers.count), query))
    }

    /// As [`Step::submit`], but the step goes into commands of the program's, after those that are there: it is done in their
    /// order once the program submits them. Vertices ([`Source::Wgpu`](crate::Source::Wgpu)) and rays may be written by
    /// commands before it, and what it finds be read by commands after it ([`Tracer::hits_buffer`]).
    ///
    /// A step without queries brings the scene up to date for shaders of the program's ([`shader_module`](crate::shader_module)).
    ///
    /// Steps are submitted in their order, before [`Tracer::hits`] of them and before the second step after them: both fail
    /// until then. If the encoder or its commands are dropped instead, the step has no results, nor have steps after it that
    /// were begun before. Vertices that only the device had are lost then: [`Error::VerticesLost`] until they come again.
    ///
    /// wgpu checks commands only when they are finished. If it refuses them, for one because the encoder is another device's
    /// or has a pass open, [`Tracer::hits`] of the step or the second step after it returns [`Error::Misuse`]. The tracer then
    /// goes on as if the encoder had been dropped.
    ///
    /// # Errors
    /// [`Error::TooLate`] if rays of the host's memory were traced in the step, or a picture rendered: they do not wait for
    /// the program.
    /// [`Error::Misuse`] before the first tree is there, see [`Tracer::warm_up`], and where two steps wait to be submitted.
    /// [`Error::Unsupported`] on another device, with [`Update::Rebuild`](crate::Update::Rebuild), and with
    /// [`Intersector::Exact`](crate::Intersector::Exact) and several queries. [`Error::Device`].
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
    /// Where a query's closest hits lie on a device of wgpu's, or will when the work submitted so far is done. One a ray, 16
    /// bytes each: `t`, `u` and `v` as in [`Hit`](crate::Hit), and the triangle's number among those of all meshes
    /// ([`Tracer::first_triangle`]) or 4294967295 for a miss. It is used again when the query's results are dropped.
    ///
    /// # Errors
    /// [`Error::NoResult`] as for [`Tracer::hits`], or if closest hits were not asked for; [`Error::Unsupported`] on another
    /// device.
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
