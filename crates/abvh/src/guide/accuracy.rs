//! Accuracy of hits.
//!
//! | [`Intersector`](crate::Intersector) | accuracy | results on different devices |
//! |---|---|---|
//! | `Watertight`, the default | single precision, with exact signs at edges: no ray passes through a shared edge, or hits both of its triangles | equal bits |
//! | `Exact` | exact arithmetic, for every ray | equal bits |
//! | `MollerTrumbore`, `Woop` | textbook methods in single precision: rays may pass between triangles near edges | equal within rounding |
//!
//! `Watertight` is the method of Woop, Benthin and Wald (2013). It computes `t`, `u` and `v` in single precision. `t`
//! is clamped to the interval in which the ray is inside the triangle's bounding box. Results lose digits if the angle
//! between ray and triangle is small.
//!
//! With `Exact`, triangles include their edges, and a ray in a triangle's plane misses it. `t`, `u` and `v` are the
//! exact values, each rounded once to the nearest float.
//!
//! A hit depends only on the ray, the triangle and the intersector, except for extreme rays and the scale factor of the
//! scene (see the next section). A single distant vertex, up to `2^40` from the origin, affects hits of other triangles
//! only through this factor. In a list of rays on a GPU, it slows down only those that hit its triangles. Other queries
//! may take longer, because their rays are then traced one by one. The next section describes larger distances.
//!
//! # Far away
//!
//! The answer of `Watertight` is exact for a ray close to the given ray. At the triangle, the two rays are a few
//! rounding errors of single precision apart. At a distance of `1e12`, the spacing of floats is 65,536. So
//! `Watertight` may report a hit of a triangle that the ray misses by a few times 65,536. A direction component below
//! `2^-37` of the largest component counts as 0. `Exact` has no such error.
//!
//! A ray is *extreme* if it starts `2^40` (`1.1e12`) or more from the origin along some axis, or if some vertex is
//! farther away than this. A ray that starts within `2^-24` of the origin is also extreme if two vertices are within
//! `2^-32` of the origin but not at it. If the scene is scaled (see below), these limits apply to the scaled
//! coordinates.
//!
//! The error of single precision is unbounded for extreme rays. Both intersectors trace them in exact arithmetic, which
//! is slow: a ray from very far away is tested against all triangles. So results of `Watertight` may change where rays
//! become extreme: a ray from just below `1.1e12` may hit a triangle that a ray from just above correctly misses.
//!
//! If the largest coordinate of all key frames or initial positions is outside `2^-10..=2^30`, all coordinates are
//! scaled by a power of two. A scene is not scaled if a coordinate exceeds `2^16` times the typical size of the
//! vertices. `Watertight` treats scaled coordinates below `2^-64` as 0. If the largest scaled coordinate is at least
//! `2^-10`, this limit is 16 or more orders of magnitude below it. The last bits of `t`, `u` and `v` of `Watertight`
//! may depend on the scale factor of the scene.
//!
//! No hit depends on the tree: neither on its age nor on [`Update`](crate::Update). So a run can be repeated with the
//! same hits, also with another number of threads.
//!
//! ```
//! use abvh::{Device, Intersector, Mesh, Query, Ray, Scene, Tracer};
//!
//! let corners = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.1, 1.0, 0.0], [1.1, 1.1, 0.0]];
//! let mut scene = Scene::new();
//! scene.add(Mesh::fixed(&corners, &[[0, 1, 2], [2, 1, 3]])?);
//! // Rays from irregular positions to the edge between corners 1 and 2, which both triangles share.
//! let rays: Vec<Ray> = (1..1000).map(|i| {
//!     let (along, i) = (i as f32 / 1000.0, i as f32);
//!     let origin = [0.3 * i.sin(), 0.7 * i.cos(), 3.0];
//!     let target = [1.0 - 0.9 * along, 0.1 + 0.9 * along, 0.0];
//!     Ray::new(origin, [0, 1, 2].map(|axis| target[axis] - origin[axis]))
//! }).collect();
//! for intersector in [Intersector::Watertight, Intersector::Exact] {
//!     let builder = Tracer::builder().device(Device::Cpu).intersector(intersector);
//!     let mut tracer = builder.build(scene.clone())?;
//!     let mut step = tracer.step(0.0);
//!     let any = step.trace(&rays, Query::Any)?;
//!     let done = step.submit()?;
//!     let hits = tracer.hits(done, any)?;
//!     assert!((0..rays.len()).all(|ray| hits.is_hit(ray)));
//! }
//! # Ok::<_, abvh::Error>(())
//! ```
//!
//! # Rays and triangles that never hit
//!
//! - A ray whose direction is zero, whose origin or direction is not finite, or whose interval is empty.
//! - A triangle whose reported `t` is not strictly between `t_min` and `t_max`. No epsilon is added to `t_min`: a ray
//!   that starts on a surface needs a `t_min` above 0 to miss that surface.
//! - A triangle with a vertex that is not finite, or without area. [`Statistics`](crate::Statistics) counts both. With
//!   `Watertight`, a closed mesh may leak at a triangle without area that has three different vertices.
//!
//! Both sides of a triangle are hit.
//!
//! # All hits along a ray
//!
//! With `Exact`, a ray that continues with `t_min` equal to the reported `t` never hits the same triangle again. With
//! other intersectors, the same holds unless `t` is subnormal (between `-2^-126` and `2^-126`).
//!
//! With `Exact`, this loop visits all hits in the order of their exact `t`. It skips only triangles that report the
//! same `t` as the previous hit, such as the second triangle at a shared edge.
//!
//! ```
//! use abvh::{Device, Intersector, Mesh, Query, Ray, Scene, Tracer};
//!
//! let floor = |z: f32| Mesh::fixed(&[[-3.0, -2.0, z], [4.0, -1.0, z + 0.1], [0.0, 5.0, z - 0.3]], &[[0, 1, 2]]);
//! let mut scene = Scene::new();
//! for number in 0..10 {
//!     scene.add(floor(number as f32 / 7.0)?);
//! }
//! let builder = Tracer::builder().device(Device::Cpu).intersector(Intersector::Exact);
//! let mut tracer = builder.build(scene)?;
//! let mut ray = Ray::new([0.3, 0.1, 5.0], [-0.07, 0.11, -1.3]);
//! let mut crossings = 0;
//! loop {
//!     let mut step = tracer.step(0.0);
//!     let closest = step.trace(&[ray], Query::Closest)?;
//!     let done = step.submit()?;
//!     let Some(hit) = tracer.hits(done, closest)?.closest(0) else { break };
//!     (ray.t_min, crossings) = (hit.t, crossings + 1);
//! }
//! assert_eq!(crossings, 10);
//! # Ok::<_, abvh::Error>(())
//! ```
