//! Scenes, steps, queries, hits, trees.
//!
//! A [`Scene`](crate::Scene) is a list of meshes. [`TracerBuilder::build`](crate::TracerBuilder::build) moves it into a
//! [`Tracer`](crate::Tracer), which uploads it to a [`Device`](crate::Device). After that no mesh can be added, but
//! each can be [replaced](crate::Tracer::replace).
//!
//! | mesh | is moved by | if a step does not move it |
//! |---|---|---|
//! | [`Mesh::fixed`](crate::Mesh::fixed) | nothing | |
//! | [`Mesh::keyframes`](crate::Mesh::keyframes) | the step's time, in key frames: at 2.5, halfway from key 2 to key 3 | |
//! | [`Mesh::sequence`](crate::Mesh::sequence) | the step's time, with key frames that are read while they are played | |
//! | [`Mesh::streamed`](crate::Mesh::streamed) | [`Step::vertices`](crate::Step::vertices) | keeps its positions |
//! | [`Mesh::rigid`](crate::Mesh::rigid) | [`Step::poses`](crate::Step::poses), a matrix for each part | keeps its positions |
//!
//! With the feature `files`, `Mesh::open` reads OBJ, PLY and glTF files, with their motion and colours.
//!
//! A [`Step`](crate::Step) first moves meshes, then traces any number of queries, and is then submitted.
//! [`Tracer::hits`](crate::Tracer::hits) waits for a query and returns a handle to its results, without a copy.
//! [`Tracer::is_done`](crate::Tracer::is_done) polls. A step's results can be read until two more steps are submitted.
//! [`Hits`](crate::Hits) that were read before remain valid. A step that is dropped instead of submitted frees its
//! results at once and is not one of the two.
//!
//! ```
//! use abvh::{Device, Mesh, Query, Ray, Scene, Tracer};
//!
//! let (square, halves) = ([[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.]], [[0, 1, 2], [2, 1, 3]]);
//! let raised = square.map(|p| [p[0], p[1], 2.0]);
//! let mut scene = Scene::new();
//! let ground = scene.add(Mesh::fixed(&square, &halves)?);
//! let lift = scene.add(Mesh::keyframes(vec![square.to_vec(), raised.to_vec()], &halves)?);
//! let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
//!
//! let down = Ray::new([0.75, 0.75, 3.0], [0.0, 0.0, -2.0]);
//! let mut step = tracer.step(0.5);
//! let closest = step.trace(&[down], Query::Closest)?;
//! let any = step.trace(&[Ray { t_max: 0.9, ..down }], Query::Any)?;
//! let done = step.submit()?;
//! let hit = tracer.hits(done, closest)?.closest(0).unwrap();
//! assert_eq!((hit.mesh, hit.triangle, hit.t), (lift, 1, 1.0));
//! assert!(!tracer.hits(done, any)?.is_hit(0));
//! assert_eq!([ground, lift].map(|mesh| mesh.index()), [0, 1]);
//! # Ok::<_, abvh::Error>(())
//! ```
//!
//! # Pictures
//!
//! [`Step::render`](crate::Step::render) traces a camera with shadows of a point light and shades the hits, on the GPU
//! or, without a GPU, on the host. [`Tracer::pixels`](crate::Tracer::pixels) copies the picture, four bytes per pixel.
//! With the default intersector, every device produces the same bytes. Meshes are grey unless they
//! [have colours](crate::Mesh::with_colours). [`Tracer::render_frames`](crate::Tracer::render_frames) renders a
//! sequence of pictures and passes each to a closure: see [`frames`](crate::frames).
//!
//! # Units
//!
//! Positions may have any unit. `t` is in units of the length of the ray's direction, which is 2 in the example above.
//! For a direction of length 1, it is a distance. For rays of [`Camera::look_at`](crate::Camera::look_at), it is the
//! depth along the direction from the eye to the middle of the image. In a triangle with vertices `a`, `b`, `c`, the
//! hit point is `(1 - u - v) a + u b + v c`. Of hits with equal `t`, the mesh that was added first wins, then the
//! triangle of lowest index.
//!
//! # Trees
//!
//! Rays are traced through a bounding volume hierarchy. The device refits it to each step's vertices, while host
//! threads build the next one. So only the first step waits for a build, except with
//! [`Update::Rebuild`](crate::Update::Rebuild) or [`Update::Lockstep`](crate::Update::Lockstep). Trees affect the speed
//! of queries, never their results. [`Tracer::statistics`](crate::Tracer::statistics) returns the age and the cost of
//! the tree.
