//! Shares device memory of Vulkan with another API on the same GPU, such as CUDA. Vertices, rays and results need not
//! be passed through the host. The library reads vertices back only to build trees, for pictures and to replace a mesh.
//!
//! The library allocates and exports memory and semaphores as opaque file descriptors (`VK_KHR_external_memory_fd`,
//! `VK_KHR_external_semaphore_fd`), and the other API imports them. This needs Linux,
//! [`Device::Vulkan`](crate::Device::Vulkan), and a driver with these extensions. A timeline semaphore orders the work
//! of both APIs: see [`Step::synchronize`](crate::Step::synchronize). Without a semaphore, the program must wait for
//! the other API before a step's first query. It must also wait for [`Tracer::hits`](crate::Tracer::hits) of that step
//! before the other API writes a buffer again.
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
//! let (memory, timeline) = (buffer.fd()?, semaphore.fd()?);
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
//! NVIDIA's driver 580 on an H100. Buffers and semaphores remain valid when a mesh is
//! [replaced](crate::Tracer::replace).

use crate::{Error, Result};
use gpu_vulkan::external::ExternalMemory;
use gpu_vulkan::timeline::Timeline;
use std::fmt;
#[cfg(unix)]
use std::os::fd::OwnedFd;
use std::sync::Arc;

/// An exported buffer in device-local memory, created by [`Tracer::external_buffer`](crate::Tracer::external_buffer).
///
/// It has a dedicated allocation (`cudaExternalMemoryDedicated`) and starts at offset 0 of the allocation. Its usages
/// are `STORAGE_BUFFER`, `TRANSFER_SRC` and `TRANSFER_DST`. Clones refer to the same buffer.
#[derive(Clone)]
pub struct ExternalBuffer(pub(crate) Arc<ExternalMemory>);

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

/// An exported timeline semaphore with initial value 0, created by
/// [`Tracer::external_semaphore`](crate::Tracer::external_semaphore). Clones refer to the same semaphore.
#[derive(Clone)]
pub struct ExternalSemaphore(pub(crate) Arc<Timeline>);

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
    /// Rays of eight floats in the memory layout of [`Ray`](crate::Ray): origin, `t_min`, direction, `t_max`.
    pub rays: &'a ExternalBuffer,
    /// Number of rays, from the start of the buffer.
    pub count: usize,
    /// Results, in a different buffer than the rays. [`Query::Closest`](crate::Query::Closest) writes 16 bytes per ray:
    /// `t`, `u` and `v` as in [`Hit`](crate::Hit), and the index of the triangle among the triangles of all meshes
    /// ([`Tracer::first_triangle`](crate::Tracer::first_triangle)), or 4294967295 for a miss.
    /// [`Query::Any`](crate::Query::Any) writes a `u32` per ray, which is not 0 for a hit. Without this buffer, the
    /// library uses its own.
    pub results: Option<&'a ExternalBuffer>,
}
