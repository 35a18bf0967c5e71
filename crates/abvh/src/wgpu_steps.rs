//! Steps with buffers and encoders of the program's wgpu device.

use crate::loaded::{QueryResult, ResidentScene, no_wgpu};
use crate::own_device::RayBuffers;
use crate::query::{DeferredQuery, DeferredRays, QueryId, StepId};
use crate::{Error, MeshId, Point, Query, Result, Step, Tracer, Update};
use gpu_wgpu::{LentRays, WgpuBackend};

impl ResidentScene {
    /// Sets the program's buffer that the vertices of a streamed mesh are read from.
    pub(crate) fn set_wgpu_vertices(
        &mut self,
        mesh: MeshId,
        from: wgpu::BufferSlice<'_>,
    ) -> Result<()> {
        // First handles encoders that were dropped before this call. Otherwise the new vertices would be marked as lost
        // too.
        self.abandon_dropped();
        let index = mesh.index();
        let expected = self.joined.range_of(index).len() * size_of::<Point>();
        Error::check_count(mesh, "bytes", expected, from.size() as usize)?;
        let can_copy = from.buffer().usage().contains(wgpu::BufferUsages::COPY_SRC);
        if !can_copy || from.offset() % wgpu::COPY_BUFFER_ALIGNMENT != 0 {
            let why = "a buffer of vertices needs the usage COPY_SRC and an offset of whole floats";
            return Err(Error::Misuse(why.into()));
        }
        self.set_points(index, from)
    }

    fn set_points(&mut self, mesh: usize, from: wgpu::BufferSlice<'_>) -> Result<()> {
        let first = self.joined.range_of(mesh).start;
        let backend = self.wgpu().ok_or_else(no_wgpu)?;
        backend.gpu_mut().set_buffer_points(first, from);
        self.driver.forget_key_frames();
        self.joined.set_on_device(mesh);
        Ok(())
    }

    /// Drops the results of steps whose encoders were dropped, and of later steps, which depend on them.
    pub(crate) fn abandon_dropped(&mut self) {
        let dropped = self.wgpu().map(WgpuBackend::remove_dropped);
        let dropped = dropped.unwrap_or_default();
        if let Some(&first) = dropped.first() {
            self.driver.abandon(&dropped);
            self.results.retain(|result| result.ticket < first);
            self.joined.on_device.mark_lost();
        }
    }

    /// Waits for encoded steps if the next step is not encoded and would overtake them.
    ///
    /// # Errors
    /// [`Error::Misuse`] if the program has not submitted them.
    pub(crate) fn finish_encoded(&mut self) -> Result<()> {
        self.abandon_dropped();
        let backend = self.wgpu();
        if backend.is_some_and(|backend| backend.gpu().overtakes_encoded()) {
            self.finish_all()?;
        }
        Ok(())
    }

    /// Passes the ray buffers of the queries that will be traced next to the backend, in the order of the queries.
    pub(crate) fn lend_rays(&mut self, queries: &[DeferredQuery]) {
        let lent = queries.iter().filter_map(|query| match &query.rays {
            DeferredRays::Wgpu { buffers, .. } => Some(buffers.clone()),
            DeferredRays::Camera(_) | DeferredRays::Empty => None,
        });
        let lent: Vec<_> = lent.collect();
        if let Some(backend) = self.wgpu().filter(|_| !lent.is_empty()) {
            backend.gpu_mut().set_ray_buffers(lent);
        }
    }

    /// Drops the ray buffers of queries that failed. Otherwise a later query could trace them.
    pub(crate) fn drop_rays(&mut self) {
        if let Some(backend) = self.wgpu() {
            backend.gpu_mut().set_ray_buffers(Vec::new());
        }
    }

    /// Checks that a step with these queries can be encoded, as one submission.
    fn check_encode(&mut self, queries: &[DeferredQuery]) -> Result<()> {
        let all: Vec<_> = queries.iter().map(DeferredQuery::query).collect();
        let is_one_submission = self.driver.can_batch(&all);
        self.wgpu().ok_or_else(no_wgpu)?;
        if !self.has_tree() {
            let why = "there is no tree yet: call `Tracer::warm_up` before `Step::encode`";
            return Err(Error::Misuse(why.into()));
        }
        let why = match (self.update, is_one_submission) {
            // The builder may need positions that the device computes only after the program has submitted the encoder.
            (Update::Rebuild | Update::Lockstep(_), _) => {
                "steps that wait for a tree from the host cannot be encoded"
            }
            (_, false) => "each of these queries needs its own encoded step",
            _ => return Ok(()),
        };
        Err(Error::Unsupported(why.into()))
    }

    /// Lends the program's encoder to the backend, and leaves an empty one in its place until it is returned.
    fn lend_encoder(&mut self, encoder: &mut wgpu::CommandEncoder) -> Result<()> {
        let gpu = self.wgpu().ok_or_else(no_wgpu)?.gpu_mut();
        let none = gpu.encoder().map_err(Error::of_backend)?;
        let lent = gpu.set_encoder(std::mem::replace(encoder, none));
        lent.map_err(Error::of_backend)
    }

    fn return_encoder(&mut self, encoder: &mut wgpu::CommandEncoder) {
        let backend = self.wgpu();
        if let Some(lent) = backend.and_then(|backend| backend.gpu_mut().take_encoder()) {
            *encoder = lent;
        }
    }

    /// Takes over, from `before`, the vertices that only the device has. The scenes differ in mesh `replaced` only.
    pub(crate) fn take_wgpu_vertices(&mut self, before: &mut Self, replaced: usize) -> Result<()> {
        // Encoded commands, and the recorded commands of a refused query, may write these vertices.
        before.finish_encoded()?;
        if let Err(e) = before.driver.submit_refused() {
            before.joined.on_device.mark_lost();
            return Err(Error::of_driver(e));
        }
        for mesh in (0..self.joined.meshes.len()).filter(|&mesh| mesh != replaced) {
            let run = before.joined.range_of(mesh);
            let Some(backend) = before.wgpu() else {
                return Ok(());
            };
            let found = backend.gpu_mut().points_buffer(&run);
            if let Some(points) = found.map_err(Error::of_backend)? {
                let end = points.offset + (run.len() * size_of::<Point>()) as u64;
                self.set_points(mesh, points.buffer.slice(points.offset..end))?;
            }
        }
        self.joined.on_device.copy_lost(&before.joined.on_device);
        Ok(())
    }
}

impl Step<'_> {
    /// Traces rays from a buffer on the program's wgpu device. The device reads them in queue order after the step is
    /// submitted, and they are not copied to the host.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on other devices. [`Error::Misuse`] if a buffer is too small or lacks a usage, or if rays
    /// or results exceed the device's `max_storage_buffer_binding_size`.
    pub fn trace_buffers(&mut self, buffers: RayBuffers<'_>, query: Query) -> Result<QueryId> {
        let backend = self.tracer.current.wgpu().ok_or_else(no_wgpu)?;
        buffers.check(query, backend.gpu())?;
        let count = buffers.count;
        if count == 0 {
            // Empty buffers cannot be bound.
            return Ok(self.defer(DeferredRays::Empty, query));
        }
        let buffers = LentRays {
            rays: buffers.rays.clone(),
            results: buffers.results.cloned(),
        };
        Ok(self.defer(DeferredRays::Wgpu { buffers, count }, query))
    }

    /// Ends the step and records it into the program's encoder, after the commands that are already there. It runs when
    /// the program submits them. Earlier commands may write vertices ([`Source::Wgpu`](crate::Source::Wgpu)) and rays,
    /// and later commands may read the results ([`Tracer::hits_buffer`]).
    ///
    /// A step without queries updates the scene for the program's shaders ([`shader_module`](crate::shader_module)).
    ///
    /// The program must submit encoded steps in their order. A step that is not encoded waits on the host for all
    /// encoded steps, and returns [`Error::Misuse`] while an encoded step is not submitted.
    ///
    /// Until the program submits this step, [`Tracer::hits`] of this step fails, and only one more step can be encoded.
    /// That step counts even if its encoder is dropped. If the encoder or the commands of this step are dropped
    /// instead, this step has no results, nor do later steps that were begun before the drop. Vertices that only the
    /// device had are then lost, and steps return [`Error::VerticesLost`] until they are passed again.
    ///
    /// wgpu validates commands only when the encoder is finished. It may refuse them, for example because the encoder
    /// belongs to another device or has an open pass. Then the first call that waits for this step, such as
    /// [`Tracer::hits`] or a call of the second step after it, returns [`Error::Misuse`]. The tracer continues as if
    /// the encoder had been dropped.
    ///
    /// # Errors
    /// [`Error::TooLate`] if the step traced rays in host memory or rendered a picture, which are submitted at once.
    /// [`Error::Misuse`] before the first tree (see [`Tracer::warm_up`]), and while the step before the previous one is
    /// encoded but not submitted. [`Error::Unsupported`] on other devices, with
    /// [`Update::Rebuild`](crate::Update::Rebuild) and [`Update::Lockstep`](crate::Update::Lockstep), and for several
    /// queries with [`Intersector::Exact`](crate::Intersector::Exact). The other errors of [`Step::trace`].
    pub fn encode(mut self, encoder: &mut wgpu::CommandEncoder) -> Result<StepId> {
        if self.deferred.len() < self.queries as usize {
            return Err(Error::TooLate);
        }
        if self.deferred.is_empty() {
            self.defer(DeferredRays::Empty, Query::Any);
        }
        self.tracer.current.check_encode(&self.deferred)?;
        let lent = self.tracer.current.lend_encoder(encoder);
        let begun = lent.and_then(|()| self.begin_deferred());
        self.tracer.current.return_encoder(encoder);
        begun?;
        Ok(self.end())
    }
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
        let mut state = self.shared_state();
        let (loaded, index) = state.find(step, query)?;
        let QueryResult { ticket, place, .. } = loaded.results[index];
        let backend = loaded.wgpu().ok_or_else(no_wgpu)?;
        let found = backend.hits_buffer(ticket, place);
        found.cloned().ok_or(Error::NoResult)
    }
}
