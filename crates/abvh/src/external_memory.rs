//! Memory on a Vulkan device that another interface to the same GPU shares, CUDA for one: vertices, rays and answers stay there.
//!
//! The library allocates and exports, by opaque file descriptors (`VK_KHR_external_memory_fd`,
//! `VK_KHR_external_semaphore_fd`); the other interface imports. That needs Linux, [`Device::Vulkan`](crate::Device::Vulkan),
//! and a driver that has these extensions. Which work comes first is for a timeline semaphore to say:
//! [`Step::synchronize`]. Without one, the program waits for the other interface before a step's first query, and for that
//! step's [`Tracer::hits`] before it has a buffer written again.
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
//! What CUDA's driver has to be told is in the trials of the repository, `tests/tests/devices/cuda.rs`, which NVIDIA's driver
//! 580 passes on an H100. Buffers and semaphores stay valid when a mesh is [replaced](Tracer::replace).

use crate::loaded::Loaded;
use crate::step::apart;
use crate::vertices::copy;
use crate::{Error, Query, QueryId, Ray, Result, Step, Tracer};
use backend::Rays;
use gpu_vulkan::external::ExternalMemory;
use gpu_vulkan::memory::Buffer;
use gpu_vulkan::timeline::Timeline;
use gpu_vulkan::{LentRays, VulkanBackend, VulkanDevice};
use std::any::Any;
use std::fmt;
#[cfg(unix)]
use std::os::fd::OwnedFd;
use std::sync::Arc;

/// A buffer in device-local memory that is exported: [`Tracer::external_buffer`]. Its allocation is a dedicated one
/// (`cudaExternalMemoryDedicated`), it begins there at 0, and its usages are `STORAGE_BUFFER`, `TRANSFER_SRC` and
/// `TRANSFER_DST`. Clones are the same buffer.
#[derive(Clone)]
pub struct ExternalBuffer(Arc<ExternalMemory>);

impl ExternalBuffer {
    /// Bytes that it holds: those asked for, or a few more.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.0.bytes
    }

    /// Bytes of its allocation, which whoever imports it has to name.
    #[must_use]
    pub fn allocation_size(&self) -> u64 {
        self.0.allocation_bytes
    }

    /// The index of its memory type, which another device of Vulkan's has to name.
    #[must_use]
    pub fn memory_type(&self) -> u32 {
        self.0.memory_type
    }

    /// The GPU's UUID, as Vulkan and CUDA have it.
    #[must_use]
    pub fn device_uuid(&self) -> [u8; 16] {
        self.0.device_uuid()
    }

    /// A new opaque file descriptor of the allocation. An import takes it over.
    ///
    /// # Errors
    /// [`Error::Device`], if the process may have no more.
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

/// A timeline semaphore that is exported, at 0 when made: [`Tracer::external_semaphore`]. Clones are the same semaphore.
#[derive(Clone)]
pub struct ExternalSemaphore(Arc<Timeline>);

impl ExternalSemaphore {
    /// A new opaque file descriptor of it. An import takes it over.
    ///
    /// # Errors
    /// [`Error::Device`], if the process may have no more.
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

/// Rays in an external buffer, and where what they meet is to be written.
#[derive(Clone, Copy, Debug)]
pub struct ExternalRays<'a> {
    /// Eight floats a ray, as [`Ray`] lies in memory: origin, `t_min`, direction, `t_max`.
    pub rays: &'a ExternalBuffer,
    /// How many of them there are, from the first on.
    pub count: usize,
    /// Another buffer. [`Query::Closest`] writes 16 bytes a ray: `t`, `u` and `v` as in [`Hit`](crate::Hit), and the
    /// triangle's number among those of all meshes ([`Tracer::first_triangle`]) or 4294967295 for a miss. [`Query::Any`]
    /// writes a word a ray that is not 0 if the ray met anything. Without this buffer the library uses its own.
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

    /// Has a streamed mesh's vertices come from external memory.
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

    /// Takes over what `before`, which differs by one mesh, has on its device alone.
    pub(crate) fn follow_external(&mut self, before: &mut Self, but: usize) -> Result<()> {
        for mesh in (0..self.joined.meshes.len()).filter(|&mesh| mesh != but) {
            let run = before.joined.range_of(mesh);
            let Some(gpu) = before.vulkan() else {
                return Ok(());
            };
            if let Some(points) = gpu.read_points(&run).map_err(Error::of_backend)? {
                copy(self.joined.vertices_of(mesh), &points);
            }
        }
        before.signal()
    }

    /// Has semaphores signal what was submitted so far.
    pub(crate) fn signal(&mut self) -> Result<()> {
        match self.vulkan() {
            Some(gpu) => gpu.signal().map_err(Error::of_backend),
            None => Ok(()),
        }
    }
}

impl Tracer {
    /// Device-local memory that is exported, of at least so many bytes. Nothing is written there yet.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on another device than Vulkan's, where the driver does not export, with the extension's name, and
    /// beyond its limits; [`Error::OutOfMemory`].
    pub fn external_buffer(&mut self, bytes: u64) -> Result<ExternalBuffer> {
        let gpu = &self.state().current.exporter()?.gpu;
        let made = ExternalMemory::new(gpu, bytes).map_err(Error::of_backend)?;
        Ok(ExternalBuffer(Arc::new(made)))
    }

    /// A timeline semaphore that is exported.
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
    /// Has the step wait until `semaphore` reaches `wait`, before it reads or writes any external buffer, and has it reach
    /// `signal` once the submitted step is done. The device waits. So does the host where it needs the device: for hits, for a
    /// tree before the first query or with [`Update::Rebuild`](crate::Update::Rebuild), and while many steps are under way.
    /// It waits for ever if the value is never reached. What a step was to wait for and to signal, and was dropped, the next
    /// one does.
    ///
    /// # Errors
    /// [`Error::TooLate`] after a query; [`Error::Misuse`] if the semaphore is another device's, or `signal` is not above
    /// `wait`, above the semaphore's value and above those of steps before.
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

    /// As [`Step::trace`], of rays that lie in an external buffer, which no host sees.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on another device; [`Error::Misuse`] where a buffer is too small or another device's.
    pub fn trace_external(&mut self, rays: ExternalRays<'_>, query: Query) -> Result<QueryId> {
        rays.lend(self.tracer.current.exporter()?, query)?;
        self.trace(Rays::OnDevice(rays.count), query)
    }
}
