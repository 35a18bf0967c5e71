//! Scenes, steps, queries, hits, trees.
//!
//! A [`Scene`](crate::Scene) is a list of meshes. [`Builder::build`](crate::Builder::build) hands it to a
//! [`Tracer`](crate::Tracer), which puts it on a [`Device`](crate::Device). From then on no mesh is added,
//! but any may be [replaced](crate::Tracer::replace).
//!
//! | mesh | moves by | in steps that do not move it |
//! |---|---|---|
//! | [`Mesh::fixed`](crate::Mesh::fixed) | nothing | |
//! | [`Mesh::keyframes`](crate::Mesh::keyframes) | the step's time, in key frames: at 2.5, halfway from key 2 to key 3 | follows the time |
//! | [`Mesh::sequence`](crate::Mesh::sequence) | likewise, by key frames that are read while they are played | follows the time |
//! | [`Mesh::streamed`](crate::Mesh::streamed) | [`Step::vertices`](crate::Step::vertices) | stays |
//! | [`Mesh::rigid`](crate::Mesh::rigid) | [`Step::poses`](crate::Step::poses), a matrix for each part | stays |
//!
//! With the feature `files`, `Mesh::open` makes a mesh of files: OBJ, PLY and glTF, with their motion and colours.
//!
//! A [`Step`](crate::Step) is one moment: first meshes are moved, then any number of queries is traced, then it is
//! submitted. [`Tracer::hits`](crate::Tracer::hits) waits for a query and returns a handle to its results, which keeps them
//! without a copy. [`Tracer::is_done`](crate::Tracer::is_done) polls.
//! A result can be read until the second step after its own is submitted, [`Hits`](crate::Hits) that were read for longer.
//! A step that is dropped instead of submitted frees its results at once and does not count.
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
//! [`Step::render`](crate::Step::render) traces a camera with shadows of a point light, and shades what it sees: on a GPU
//! there, else on the host.
//! [`Tracer::pixels`](crate::Tracer::pixels) copies the result, four bytes a pixel. Every device gives the same bytes.
//! Meshes are grey unless they [have colours](crate::Mesh::with_colours).
//! [`Tracer::render_frames`](crate::Tracer::render_frames) makes many, one after another, and lends each: see [`frames`](crate::frames).
//!
//! # Units
//!
//! Positions have whatever unit yours have. `t` counts lengths of the ray's direction, above 2 each: a distance where that
//! has length 1. For rays of a [`Camera`](crate::Camera) it is the depth along the line of sight.
//! Where a triangle has the vertices `a`, `b`, `c`, the point is `(1 - u - v) a + u b + v c`.
//! Of hits at the same `t`, the mesh that was added first wins, then the triangle with the least number.
//!
//! # Trees
//!
//! Rays are traced through a bounding volume hierarchy. The device refits it to each step's vertices, while threads of the
//! host build the next one. So only the first step waits for a build, unless you ask for
//! [`Update::Rebuild`](crate::Update::Rebuild) or [`Update::Lockstep`](crate::Update::Lockstep).
//! Trees decide how fast a hit is found, never which. [`Tracer::statistics`](crate::Tracer::statistics) tells their age and cost.
