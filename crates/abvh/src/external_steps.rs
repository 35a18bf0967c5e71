//! Steps with memory that another API of the GPU shares.

use crate::external_memory::{ExternalBuffer, ExternalRays, ExternalSemaphore};
use crate::loaded::ResidentScene;
use crate::{Error, Query, QueryId, Ray, Result, Step, Tracer};
use backend::Rays;
use geom::copy_in_parallel;
use gpu_common::GpuDevice;
use gpu_vulkan::external::ExternalMemory;
use gpu_vulkan::memory::Buffer;
use gpu_vulkan::timeline::Timeline;
use gpu_vulkan::{ExternalVertices, LentRays, VulkanDevice};
use std::sync::Arc;

impl ExternalRays<'_> {
    /// Passes the buffers to the device, for the next query.
    fn lend(&self, gpu: &mut VulkanDevice, query: Query) -> Result<()> {
        let lent = |buffer: &ExternalBuffer, each: usize| {
            let bytes = (each as u64).saturating_mul(self.count as u64);
            Buffer::external(&gpu.gpu, &buffer.0, bytes).map_err(Error::of_backend)
        };
        let is_same = |to: &ExternalBuffer| Arc::ptr_eq(&to.0, &self.rays.0);
        Error::check_separate(!self.results.is_some_and(is_same))?;
        let results = self.results.map(|to| lent(to, query.result_bytes()));
        gpu.set_external_rays(LentRays {
            rays: lent(self.rays, size_of::<Ray>())?,
            results: results.transpose()?,
        });
        Ok(())
    }
}

impl ResidentScene {
    fn exporter(&mut self) -> Result<&mut VulkanDevice> {
        let none = || Error::Unsupported("only a Vulkan device can export memory".into());
        self.vulkan().ok_or_else(none)
    }

    /// Sets the external buffer that the vertices of a streamed mesh are read from.
    pub(crate) fn set_external_vertices(
        &mut self,
        mesh: usize,
        buffer: &ExternalBuffer,
        offset: u64,
    ) -> Result<()> {
        let source = ExternalVertices {
            memory: &buffer.0,
            offset,
            range: self.joined.range_of(mesh),
            vertex_count: self.joined.animation.vertex_count(),
        };
        let set = self.exporter()?.set_external_points(source);
        set.map_err(Error::of_backend)?;
        self.driver.forget_key_frames();
        self.joined.set_on_device(mesh);
        Ok(())
    }

    /// Copies, from `before`, the vertices that only the device has. The scenes differ in mesh `replaced` only.
    pub(crate) fn take_external_vertices(
        &mut self,
        before: &mut Self,
        replaced: usize,
    ) -> Result<()> {
        for mesh in (0..self.joined.meshes.len()).filter(|&mesh| mesh != replaced) {
            let run = before.joined.range_of(mesh);
            let Some(gpu) = before.vulkan() else {
                return Ok(());
            };
            if let Some(points) = gpu.read_external_points(&run).map_err(Error::of_backend)? {
                copy_in_parallel(self.joined.vertices_of(mesh), &points);
            }
        }
        // No later step submits the pending signals of `before`.
        before.signal()?;
        if let (Some(gpu), Some(before)) = (self.vulkan(), before.vulkan()) {
            gpu.copy_signals(before);
        }
        Ok(())
    }

    /// Submits the pending signals of external semaphores, after all work submitted so far.
    pub(crate) fn signal(&mut self) -> Result<()> {
        match self.vulkan() {
            Some(gpu) => gpu.signal().map_err(Error::of_backend),
            None => Ok(()),
        }
    }
}

impl Tracer {
    /// Creates an exported buffer of at least `bytes` in device-local memory. Its content is undefined.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on devices other than Vulkan's, if the driver lacks an extension (which the message
    /// names), and for sizes beyond its limits. [`Error::OutOfMemory`].
    pub fn external_buffer(&mut self, bytes: u64) -> Result<ExternalBuffer> {
        let gpu = &self.state().current.exporter()?.gpu;
        let created = ExternalMemory::new(gpu, bytes).map_err(Error::of_backend)?;
        Ok(ExternalBuffer(Arc::new(created)))
    }

    /// Creates an exported timeline semaphore.
    ///
    /// # Errors
    /// As for [`Tracer::external_buffer`].
    pub fn external_semaphore(&mut self) -> Result<ExternalSemaphore> {
        let gpu = &self.state().current.exporter()?.gpu;
        let created = Timeline::exportable(gpu).map_err(Error::of_backend)?;
        Ok(ExternalSemaphore(Arc::new(created)))
    }
}

impl Step<'_> {
    /// Makes the step wait until `semaphore` reaches `wait` before it accesses external buffers. When the submitted
    /// step is done, the semaphore is signalled with `signal`.
    ///
    /// The device waits. The host also waits if it needs results of the device: for hits, pictures and
    /// [`Tracer::commit`], for a tree before the first query, with [`Update::Rebuild`](crate::Update::Rebuild) and
    /// [`Update::Lockstep`](crate::Update::Lockstep), and while too many steps are in flight. If `wait` is never
    /// reached, the device and these calls wait forever. If the step is dropped, the next step waits and signals in its
    /// place.
    ///
    /// # Errors
    /// [`Error::TooLate`] after a query. [`Error::Unsupported`] on devices other than Vulkan's. [`Error::Misuse`] if
    /// the semaphore belongs to another device, or if `wait`, the semaphore's value or an earlier step's
    /// signal is at least `signal`. Also if `signal` exceeds the semaphore's value by more than the device allows.
    pub fn synchronize(
        &mut self,
        semaphore: &ExternalSemaphore,
        wait: u64,
        signal: u64,
    ) -> Result<()> {
        if self.queries > 0 {
            return Err(Error::TooLate);
        }
        let gpu = self.tracer.current.exporter()?;
        let synchronized = gpu.synchronize(&semaphore.0, wait, signal);
        synchronized.map_err(Error::of_backend)
    }

    /// Traces rays from an external buffer. They are not copied to the host.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on other devices. [`Error::Misuse`] if a buffer is too small or belongs to another
    /// device. The other errors of [`Step::trace`].
    pub fn trace_external(&mut self, rays: ExternalRays<'_>, query: Query) -> Result<QueryId> {
        rays.lend(self.tracer.current.exporter()?, query)?;
        let traced = self.trace(Rays::OnDevice(rays.count), query);
        if traced.is_err() {
            // Otherwise a later query could trace these rays.
            self.tracer.current.exporter()?.lent().rays.clear();
        }
        traced
    }
}
