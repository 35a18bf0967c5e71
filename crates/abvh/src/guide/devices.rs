//! Devices: selection, sharing, threads.
//!
//! | [`Device`](crate::Device) | traces with |
//! |---|---|
//! | `Auto` | the first GPU that Vulkan lists, else the first that wgpu lists, else the host's cores |
//! | `Cpu` | the host's cores |
//! | `CpuRef` | the scalar reference on the host's cores, which is slow |
//! | `Vulkan(adapter)` | compute shaders through Vulkan; feature `vulkan` |
//! | `Wgpu(adapter)` | compute shaders through wgpu; feature `wgpu` |
//! | `Own(device)` | compute shaders on a wgpu device that the program opened: see `own_device` |
//!
//! Both features are enabled by default. The host is always available. GPUs need no ray-tracing hardware. An adapter is
//! an index or a part of a name. `None` selects the first GPU or, without a GPU, the first adapter.
//!
//! `Auto` prefers the host to a driver that runs shaders on the host's cores, and takes the host if no GPU can be
//! opened. A device that the program names is never replaced by another: if it cannot run, the error is
//! [`Error::NoDevice`](crate::Error::NoDevice), or [`Error::Unsupported`](crate::Error::Unsupported) if the limits of
//! `Own(device)` are too low. [`Tracer::device`](crate::Tracer::device) returns the device in use.
//! [`doctor`](crate::doctor()) reports why no GPU can be used, and how to fix it.
//!
//! Opening a device takes longer than loading a scene.
//! [`TracerBuilder::build_in_place_of`](crate::TracerBuilder::build_in_place_of) loads another scene on an open device.
//!
//! ```
//! use abvh::{Device, Mesh, Scene, Tracer};
//!
//! let mut scene = Scene::new();
//! scene.add(Mesh::fixed(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?);
//! # #[cfg(feature = "vulkan")] {
//! let named = Device::Vulkan(Some("no such adapter".to_owned()));
//! let refused = Tracer::builder().device(named).build(scene.clone());
//! assert!(matches!(refused, Err(abvh::Error::NoDevice(_))));
//! # }
//!
//! let tracer = Tracer::builder().device(Device::Cpu).threads(2).build(scene)?;
//! assert!(tracer.device().starts_with("cpu"));
//! let found = abvh::doctor();
//! for problem in &found.problems {
//!     println!("{}: {}", problem.what, problem.fix);
//! }
//! assert!(!found.gpus.is_empty() || !found.problems.is_empty());
//! # Ok::<_, abvh::Error>(())
//! ```
//!
//! # A program's own device
//!
//! With `Own(device)`, vertices ([`Source`](crate::Source)) and rays may come from the program's wgpu buffers, and
//! results can be written to the program's buffers (`own_device::RayBuffers`). The work runs in the order of the
//! program's queue or, with `Step::encode`, in the order of its commands. The program's shaders trace rays with the
//! WGSL source from `shader_module`.
//!
//! # Memory that CUDA shares
//!
//! On `Vulkan(adapter)`, vertices, rays and results may be in memory that the library exports and another API on the
//! same GPU imports: see `external_memory`. A timeline semaphore orders the work, without copies or waits on the host.
//!
//! # Threads
//!
//! [`TracerBuilder::threads`](crate::TracerBuilder::threads) and
//! [`TracerBuilder::builder_threads`](crate::TracerBuilder::builder_threads) set the numbers of threads, and describe
//! the defaults. A [`Tracer`](crate::Tracer) can be sent to another thread, and a program can have several tracers.
//! Each has its own device and trees.
//!
//! Tracers can be used from tasks of rayon, tokio and other runtimes. A call blocks its thread, which runs no other
//! task meanwhile. Parallel work runs in the library's own thread pools, never in rayon's global pool. If the caller is
//! a rayon worker, each parallel part of a call starts a short-lived thread, which takes some tens of microseconds.
//!
//! # First run
//!
//! Compiled shaders are stored in the folder `abvh` of the user's cache, so the second run starts faster.
