//! Meshes that a simulation moves.
//!
//! [`Step::vertices`](crate::Step::vertices) takes all vertices of a mesh in their original order. It copies vertices
//! in host memory before it returns. The triangles do not change. [`Step::poses`](crate::Step::poses) takes a
//! [`Matrix`](crate::Matrix) for each part. A matrix maps the part's initial positions to the current ones, so matrices
//! of successive steps are independent.
//!
//! With Vulkan, [`Step::vertices_mut`](crate::Step::vertices_mut) returns memory that the GPU reads: the simulation
//! writes there, and nothing is copied. Fixed meshes are uploaded once, so the cost of a step depends only on the
//! moving vertices. Vertices that the program computed on its own wgpu device need not be passed through the host:
//! `Source::Wgpu` takes their buffer. The same holds for vertices that CUDA computed in memory of the library's Vulkan
//! device: `Source::External`. The library reads vertices back only to build trees, for pictures and, on Vulkan, to
//! replace a mesh.
//!
//! All meshes must be moved before the step's first query, otherwise the error is
//! [`Error::TooLate`](crate::Error::TooLate). A mesh that a step does not move keeps its positions.
//!
//! # Overlap
//!
//! On a GPU, [`Step::submit`](crate::Step::submit) returns while its queries run. [`Tracer::hits`](crate::Tracer::hits)
//! waits for a query, and [`Tracer::is_done`](crate::Tracer::is_done) polls. To keep the GPU busy, simulate and submit
//! the next step before reading the hits of the last one. [`Hits`](crate::Hits) remain valid while further steps are
//! prepared. At most two submissions are in flight. A call that would submit a third first waits for the oldest. On the
//! host, the call that submits rays traces them before it returns.
//!
//! ```
//! use abvh::{Device, Mesh, Query, Ray, Scene, Source, Tracer};
//!
//! let at = |height: f32| [[0.0, height, 0.0], [4.0, height, 0.0], [0.0, height, 4.0]];
//! let mut scene = Scene::new();
//! let sheet = scene.add(Mesh::streamed(&at(0.0), &[[0, 1, 2]])?);
//! let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
//! let down = [Ray::new([1.0, 9.0, 1.0], [0.0, -1.0, 0.0])];
//! let (mut last, mut read) = (None, Vec::new());
//! for i in 0..4 {
//!     let vertices = at(i as f32); // The simulation.
//!     let mut step = tracer.step(0.0);
//!     step.vertices(sheet, Source::Host(&vertices))?;
//!     let depth = step.trace(&down, Query::Closest)?;
//!     let next = (step.submit()?, depth);
//!     if let Some((step, depth)) = last.replace(next) {
//!         read.extend(tracer.hits(step, depth)?.distances());
//!     }
//! }
//! assert_eq!(read, [9.0, 8.0, 7.0]);
//! # Ok::<_, abvh::Error>(())
//! ```
//!
//! # New topology
//!
//! [`Tracer::replace`](crate::Tracer::replace) replaces the vertices and triangles of a mesh, for example when it tears
//! or grows. The new scene is loaded in parallel with steps, and the builder threads build its first tree. The program
//! commits it between two steps with [`Tracer::commit`](crate::Tracer::commit). From then on,
//! [`Step::vertices`](crate::Step::vertices) takes the new number of vertices.
//!
//! [`Replacement::is_ready`](crate::Replacement::is_ready) returns whether the preparation is finished. A commit then
//! does not wait for it, unless another mesh was replaced in the meantime. Other meshes keep their positions, and all
//! meshes keep their [`MeshId`](crate::MeshId). Hits of earlier steps can still be read. Until they are dropped, both
//! scenes take memory.
//!
//! Several meshes can be replaced at the same time. Each replacement is prepared for the current scene, so after the
//! first commit, `commit` prepares each of the others again and waits for that.
//!
//! # Trees ahead of the motion
//!
//! [`Update::Async`](crate::Update::Async) is the default for scenes that can move. The next tree is then built for
//! predicted positions, on the line through the last two positions of each vertex. If the motion turns or jumps, the
//! tree fits worse and queries take longer, but no hit changes. For motion that jumps in every step,
//! [`Update::DeviceRebuild`](crate::Update::DeviceRebuild) makes the GPU build a tree in each step.
//!
//! The tree that a step uses depends on the speed of the machine. [`Update::Lockstep`](crate::Update::Lockstep) fixes
//! it, so that each run does the same work.
//!
//! # Numbers that are not finite
//!
//! A vertex may be NaN or infinite. Its triangles are then inactive: they are never hit, and
//! [`Statistics::inactive`](crate::Statistics::inactive) counts them. This can be used to hide triangles.
