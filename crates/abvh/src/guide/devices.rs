//! Where rays are traced.
//!
//! | [`Device`](crate::Device) | traces with |
//! |---|---|
//! | `Auto` | the first GPU that Vulkan lists, else the first that wgpu lists, else the host's cores |
//! | `Cpu` | the host's cores |
//! | `Vulkan(adapter)` | compute shaders through Vulkan; feature `vulkan` |
//! | `Wgpu(adapter)` | compute shaders through wgpu; feature `wgpu` |
//! | `Own(device)` | compute shaders on a wgpu device that the program opened: see `own_device` |
//!
//! Both features are on by default; the host is always there. No GPU needs ray-tracing hardware. An adapter is an index or
//! a part of a name; `None` takes the first GPU, else the first of all.
//!
//! `Auto` never takes a driver that runs shaders on the host's cores, and takes the host where a GPU cannot be opened.
//! A device that you name is never replaced: if it cannot run, the error is [`Error::NoDevice`](crate::Error::NoDevice).
//! [`Tracer::device`](crate::Tracer::device) tells what was taken, [`doctor`](crate::doctor()) why no GPU can be, and how
//! to mend that. To open a device takes longer than to load a scene:
//! [`Builder::build_in_place_of`](crate::Builder::build_in_place_of) loads another one on a device that is open,
//! [`Builder::build_on`](crate::Builder::build_on) a scene on a backend of the program's own.
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
//!     println!("{}: {}", problem.what, problem.mend);
//! }
//! assert!(!found.gpus.is_empty() || !found.problems.is_empty());
//! # Ok::<_, abvh::Error>(())
//! ```
//!
//! # A program's own device
//!
//! With `Own(device)`, vertices ([`Source`](crate::Source)) and rays may come from the program's wgpu buffers. Closest hits
//! can be written to one, too (`own_device::RayBuffers`). All of it runs in the order of the program's queue, or with
//! `Step::encode` in that of its commands. Its own shaders trace rays by the text that `shader_module` gives.
//!
//! # Memory that CUDA shares
//!
//! On `Vulkan(adapter)`, vertices, rays and answers may lie in memory that the library exports and another interface to the
//! same GPU imports: see `external_memory`. A timeline semaphore orders their work; no host copies anything or waits.
//!
//! # Threads
//!
//! [`Builder::threads`](crate::Builder::threads) limits the threads that build trees, and those that trace on the host;
//! [`Builder::builder_threads`](crate::Builder::builder_threads) sets the former alone.
//! Otherwise a quarter of four or more cores of the host builds while the others trace; beside a GPU, one for two cores
//! builds. A [`Tracer`](crate::Tracer) may be sent to another thread, and several may exist side by side. Each has its own
//! device and its own trees.
//!
//! Tracers may be used from tasks of rayon, tokio and other runtimes. A call blocks its thread, which runs no other task
//! meanwhile. Parallel work runs in pools of the library, never in rayon's global pool. A rayon worker starts a short-lived
//! thread for each parallel part of a call, which takes some tens of microseconds.
//!
//! # First run
//!
//! Compiled shaders are kept in the folder `abvh` of the user's cache, so a second run starts faster.
