//! Shares device memory of Vulkan with another API on the same GPU, such as CUDA. Vertices, rays and results remain on
//! the device.
//!
//! The library allocates and exports memory and semaphores as opaque file descriptors (`VK_KHR_external_memory_fd`,
//! `VK_KHR_external_semaphore_fd`), and the other API imports them. This needs Linux,
//! [`Device::Vulkan`](crate::Device::Vulkan), and a driver with these extensions. A timeline semaphore orders the work
//! of both APIs: see [`Step::synchronize`]. Without one, the program must wait for the other API before a step's first
//! query, and for [`Tracer::hits`] of that step before the other API writes a buffer again.
//!
//! ```no_run
//! # #[cfg(unix)] {
//! use abvh::{Device, Mesh, Query, Ray, Scene, Source, Tracer};
//!
//! let points = [[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [0.0, 1.0, 1.0]];
//! let mut scene = Scene::new();
//! let sheet = scene.add(Mesh::streamed(&points, &[[0, 1, 2]])?);
//! let mut tracer = Tracer::builder().device(Device::Vulkan(None)).build(scene)?;
//! let buffer = tracer.external_buffer(size_of_val(&points) as u64)?;
//! let semaphore = tracer.external_semaphore()?;
//! // For `cudaImportExternalMemory` and `cudaImportExternalSemaphore`, which take the descriptors over.
//! let (memory, moment) = (buffer.fd()?, semaphore.fd()?);
//! for frame in 0..100 {
//!     // CUDA waits for 2 * frame, writes vertices, and signals 2 * frame + 1.
//!     let mut step = tracer.step(0.0);
//!     step.synchronize(&semaphore, 2 * frame + 1, 2 * frame + 2)?;
//!     step.vertices(sheet, Source::External { buffer: &buffer, offset: 0 })?;
//!     let query = step.trace(&[Ray::new([0.0, 5.0, 0.0], [0.0, -1.0, 0.0])], Query::Closest)?;
//!     let done = step.submit()?;
//!     let hits = tracer.hits(done, query)?;
//! }
//! # }
//! # Ok::<_, abvh::Error>(())
//! ```
//!
//! The test `tests/tests/devices/cuda.rs` of the repository shows the calls of CUDA's driver API. It passes with
//! NVIDIA's driver 580 on an H100. Buffers and semaphores remain valid when a mesh is [replaced](Tracer::replace).

use crate::loaded::Loaded;
use crate::step::apart;
use crate::{Error, Query, QueryId, Ray, Result, Step, Tracer};
use backend::Rays;
use geom::copy_in_parallel;
use gpu_vulkan::external::ExternalMemory;
use gpu_vulkan::memory::Buffer;
use gpu_vulkan::timeline::Timeline;
use gpu_vulkan::{LentRays, VulkanBackend, VulkanDevice};
use std::any::Any;
use std::fmt;
#[cfg(unix)]
use std::os::fd::OwnedFd;
use std::sync::Arc;

/// An exported buffer in device-local memory, created by [`Tracer::external_buffer`].
///
/// It has a dedicated allocation (`cudaExternalMemoryDedicated`) and starts at its offset 0. Its usages are
/// `STORAGE_BUFFER`, `TRANSFER_SRC` and `TRANSFER_DST`. Clones refer to the same buffer.
#[derive(Clone)]
pub struct ExternalBuffer(Arc<ExternalMemory>);

impl ExternalBuffer {
    /// Returns the size in bytes: the requested size, or slightly more.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.0.bytes
    }

    /// Returns the size of the allocation in bytes, which an import must specify.
    #[must_use]
    pub fn allocation_size(&self) -> u64 {
        self.0.allocation_bytes
    }

    /// Returns the index of the memory type, which an import by another Vulkan device must specify.
    #[must_use]
    pub fn memory_type(&self) -> u32 {
        self.0.memory_type
    }

    /// Returns the UUID of the GPU, which is the same in Vulkan and CUDA.
    #[must_use]
    pub fn device_uuid(&self) -> [u8; 16] {
        self.0.device_uuid()
    }

    /// Creates an opaque file descriptor of the allocation. An import takes ownership of the descriptor.
    ///
    /// # Errors
    /// [`Error::Device`] if the process has too many open descriptors.
    #[cfg(unix)]
    pub fn fd(&self) -> Result<OwnedFd> {
        self.0.fd().map_err(Error::of_backend)
    }
}

impl fmt::Debug for ExternalBuffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ExternalBuffer of {} bytes", self.size())
    }
}

/// An exported timeline semaphore with initial value 0, created by [`Tracer::external_semaphore`]. Clones refer to the
/// same semaphore.
#[derive(Clone)]
pub struct ExternalSemaphore(Arc<Timeline>);

impl ExternalSemaphore {
    /// Creates an opaque file descriptor of the semaphore. An import takes ownership of the descriptor.
    ///
    /// # Errors
    /// [`Error::Device`] if the process has too many open descriptors.
    #[cfg(unix)]
    pub fn fd(&self) -> Result<OwnedFd> {
        self.0.fd().map_err(Error::of_backend)
    }
}

impl fmt::Debug for ExternalSemaphore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ExternalSemaphore")
    }
}

/// An external buffer of rays, and an optional external buffer for their results.
#[derive(Clone, Copy, Debug)]
pub struct ExternalRays<'a> {
    /// Rays of eight floats in the memory layout of [`Ray`]: origin, `t_min`, direction, `t_max`.
    pub rays: &'a ExternalBuffer,
    /// Number of rays, from the start of the buffer.
    pub count: usize,
    /// Results, in a different buffer than the rays. [`Query::Closest`] writes 16 bytes per ray: `t`, `u` and `v` as in
    /// [`Hit`](crate::Hit), and the index of the triangle among the triangles of all meshes
    /// ([`Tracer::first_triangle`]), or 4294967295 for a miss. [`Query::Any`] writes a `u32` per ray, which is not 0
    /// for a hit. Without this buffer, the library uses its own.
    pub answers: Option<&'a ExternalBuffer>,
}

impl ExternalRays<'_> {
    fn lend(&self, gpu: &mut VulkanDevice, query: Query) -> Result<()> {
        let lent = |buffer: &ExternalBuffer, each: usize| {
            let bytes = (each as u64).saturating_mul(self.count as u64);
            Buffer::lent(&gpu.gpu, &buffer.0, bytes).map_err(Error::of_backend)
        };
        let is_same = |to: &ExternalBuffer| Arc::ptr_eq(&to.0, &self.rays.0);
        apart(!self.answers.is_some_and(is_same))?;
        let answers = self.answers.map(|to| lent(to, query.answer_bytes()));
        gpu.lend_rays(LentRays {
            rays: lent(self.rays, size_of::<Ray>())?,
            answers: answers.transpose()?,
        });
        Ok(())
    }
}

impl Loaded {
    pub(crate) fn vulkan(&mut self) -> Option<&mut VulkanDevice> {
        let backend: &mut dyn Any = self.driver.backend();
        let backend = backend.downcast_mut::<VulkanBackend>();
        backend.map(VulkanBackend::gpu_mut)
    }

    fn exporter(&mut self) -> Result<&mut VulkanDevice> {
        let none =
            || Error::Unsupported("it is no device of Vulkan's, which alone exports memory".into());
        self.vulkan().ok_or_else(none)
    }

    /// Sets the external buffer that the vertices of a streamed mesh are read from.
    pub(crate) fn bring_external(
        &mut self,
        mesh: usize,
        (buffer, offset): (&ExternalBuffer, u64),
    ) -> Result<()> {
        let run = (
            self.joined.range_of(mesh),
            self.joined.animation.vertex_count(),
        );
        let brought = self.exporter()?.bring_points(run, (&buffer.0, offset));
        brought.map_err(Error::of_backend)?;
        self.driver.forget_key_frames();
        self.joined.is_on_device(mesh);
        Ok(())
    }

    /// Takes over the vertices that only the device has from `before`, a scene that differs in mesh `but` only.
    pub(crate) fn follow_external(&mut self, before: &mut Self, but: usize) -> Result<()> {
        for mesh in (0..self.joined.meshes.len()).filter(|&mesh| mesh != but) {
            let run = before.joined.range_of(mesh);
            let Some(gpu) = before.vulkan() else {
                return Ok(());
            };
            if let Some(points) = gpu.read_points(&run).map_err(Error::of_backend)? {
                copy_in_parallel(self.joined.vertices_of(mesh), &points);
            }
        }
        before.signal()
    }

    /// Submits the semaphore signals that follow the work submitted so far.
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
        let made = ExternalMemory::new(gpu, bytes).map_err(Error::of_backend)?;
        Ok(ExternalBuffer(Arc::new(made)))
    }

    /// Creates an exported timeline semaphore.
    ///
    /// # Errors
    /// As for [`Tracer::external_buffer`].
    pub fn external_semaphore(&mut self) -> Result<ExternalSemaphore> {
        let gpu = &self.state().current.exporter()?.gpu;
        let made = Timeline::exportable(gpu).map_err(Error::of_backend)?;
        Ok(ExternalSemaphore(Arc::new(made)))
    }
}

impl Step<'_> {
    /// Makes the step wait until `semaphore` reaches `wait` before it accesses external buffers. When the submitted
    /// step is done, the semaphore is signalled with `signal`.
    ///
    /// The device waits. The host also waits if it needs results of the device: for hits, for a tree before the first
    /// query or with [`Update::Rebuild`](crate::Update::Rebuild), and while too many steps are in flight. If the value
    /// is never reached, it waits forever. If the step is dropped, the next step waits and signals in its place.
    ///
    /// # Errors
    /// [`Error::TooLate`] after a query. [`Error::Misuse`] if the semaphore belongs to another device, or if `signal`
    /// is not above `wait`, the semaphore's value and the signals of earlier steps.
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
        let said = gpu.synchronize(&semaphore.0, [wait, signal]);
        said.map_err(Error::of_backend)
    }

    /// Traces rays from an external buffer. They are not copied to the host.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on other devices. [`Error::Misuse`] if a buffer is too small or belongs to another
    /// device.
    pub fn trace_external(&mut self, rays: ExternalRays<'_>, query: Query) -> Result<QueryId> {
        rays.lend(self.tracer.current.exporter()?, query)?;
        self.trace(Rays::OnDevice(rays.count), query)
    }
}
