//! Meshes that a simulation moves.
//!
//! [`Step::vertices`](crate::Step::vertices) takes all vertices of a mesh, in the order in which it was made, and copies
//! them before it returns. The triangles stay those it was made with. [`Step::poses`](crate::Step::poses) takes a
//! [`Matrix`](crate::Matrix) for each part, from where the part was made to where it is: matrices do not add up.
//!
//! [`Step::vertices_mut`](crate::Step::vertices_mut) lends the memory that the GPU reads instead: a simulation writes there,
//! and nothing is copied. Meshes that are fixed are sent once; a step costs what its moving vertices cost.
//! Vertices that the program computed on its own wgpu device never pass through the host: `Source::Wgpu` names their buffer.
//! Nor do those that CUDA computed in memory which the library's Vulkan device shares: `Source::External`.
//!
//! All come before the step's first query, else they are [`Error::TooLate`](crate::Error::TooLate). A mesh that
//! a step does not move stays where it is.
//!
//! # Overlap
//!
//! On a GPU, [`Step::submit`](crate::Step::submit) returns while its queries run; [`Tracer::hits`](crate::Tracer::hits)
//! waits, and [`Tracer::is_done`](crate::Tracer::is_done) polls. Simulate and submit the next step before you read the hits
//! of the last one, and the GPU works meanwhile. [`Hits`](crate::Hits) may be held while further steps are prepared.
//! Two queries may be under way: [`Step::trace`](crate::Step::trace) waits for the first before it begins a third. On the
//! host it does the work itself.
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
//! A mesh that tears, or grows, gets other vertices and triangles by [`Tracer::replace`](crate::Tracer::replace).
//! A scene with them is loaded beside the steps, and its first tree built by the threads that build trees anyway. It
//! counts once the program hands it to [`Tracer::commit`](crate::Tracer::commit), between two steps: from then on
//! [`Step::vertices`](crate::Step::vertices) takes the new number.
//!
//! [`Replacement::is_ready`](crate::Replacement::is_ready) tells when that need not wait. Other meshes stay where they are,
//! and all keep their [`MeshId`](crate::MeshId). Hits of earlier steps can still be read. Until they are dropped,
//! both scenes take memory.
//!
//! Replacements of several meshes may be prepared at a time. They are prepared for the scene as it is, so all but the first
//! to be committed are prepared once more by `commit`, which waits for that.
//!
//! # Trees ahead of the motion
//!
//! [`Update::Auto`](crate::Update::Auto) takes [`Update::Async`](crate::Update::Async) for whatever moves. Then the next
//! tree is built for where vertices are going, on the line through their last two places.
//! Motion may turn or jump all the same. A tree that fits badly costs time, and no hit changes.
//! Where it jumps in every step, [`Update::DeviceRebuild`](crate::Update::DeviceRebuild) has the GPU make a tree for each.
//!
//! Which step gets which tree depends on how fast the machine is. [`Update::Lockstep`](crate::Update::Lockstep) fixes it, so
//! that each run does the same work.
//!
//! # Numbers that are not finite
//!
//! A vertex may be NaN or infinite: its triangles are then inactive, never hit, and counted by
//! [`Statistics::inactive`](crate::Statistics::inactive). That also hides triangles that are not needed at the moment.
