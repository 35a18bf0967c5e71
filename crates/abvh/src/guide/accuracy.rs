//! What a hit promises.
//!
//! | [`Intersector`](crate::Intersector) | which triangle is hit | on every device |
//! |---|---|---|
//! | `Watertight`, the default | rounded, with exact signs at edges: no ray leaks through a shared edge, or hits both of its triangles | the same bits |
//! | `Exact` | that of exact arithmetic, for every ray | the same bits |
//! | `MollerTrumbore`, `Woop` | the textbook's, in single precision: rays leak near edges | within rounding |
//!
//! `Watertight` follows Woop, Benthin and Wald (2013). It computes `t`, `u` and `v` in single precision, and `t` lies
//! within the triangle's bounding box. Triangles that the ray meets at a small angle lose digits.
//!
//! With `Exact`, triangles include their edges, and a ray in a triangle's plane misses it. `t`, `u` and `v` are the exact
//! values, each rounded once to the nearest float.
//!
//! A hit depends on the ray, the triangle and the intersector alone. A vertex that flies off changes no hit of another
//! triangle, and only rays that meet its own triangles take notably longer.
//!
//! # Far away
//!
//! `Watertight` is exact for a ray within rounding of the given one, in single precision of the distance to the triangle.
//! From `1e12` away the spacing of floats is 65,536, so such a ray may hit a triangle that it passes a few units away.
//! A component of a direction below `2^-37` of the largest counts as 0. `Exact` has no such error.
//!
//! Rays are *extreme* that start `2^40` (`1.1e12`) or more from the origin along some axis, or while some vertex is beyond
//! that. Single precision cannot bound its own error there. Both intersectors answer these in exact arithmetic, slowly: from
//! very far away a ray tries all triangles. Rays that start within `2^-24` of the origin are extreme if vertices lie within
//! `2^-32` of it, other than at the origin itself.
//! So `Watertight` may hit from just below `1.1e12` what it rightly misses from just above.
//!
//! Where the largest coordinate of all key frames, or of what meshes begin with, lies outside `2^-10..=2^30`, all are
//! scaled by a power of two, and what is then below `2^-64` counts as 0. So coordinates of one scene should not
//! differ by 18 orders of magnitude. Scenes that are scaled otherwise may round the last bits of `t`, `u` and `v`
//! otherwise.
//!
//! No hit depends on a tree: not on its age, on [`Update`](crate::Update) or on [`Layout`](crate::Layout).
//! So a run can be repeated, with another number of threads too.
//!
//! ```
//! use abvh::{Device, Intersector, Mesh, Query, Ray, Scene, Tracer};
//!
//! let corners = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.1, 1.0, 0.0], [1.1, 1.1, 0.0]];
//! let mut scene = Scene::new();
//! scene.add(Mesh::fixed(&corners, &[[0, 1, 2], [2, 1, 3]])?);
//! // Rays from odd places to the edge that both triangles share, from corner 1 to corner 2.
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
//! # What misses
//!
//! - A ray whose direction is zero, whose origin or direction is not finite, or whose interval is empty.
//! - A triangle whose reported `t` is not strictly between `t_min` and `t_max`. Nothing is added to `t_min`: a ray that
//!   starts on a surface needs one above 0 to leave it.
//! - A triangle with a vertex that is not finite, or without area. [`Statistics`](crate::Statistics) counts both.
//!
//! Both sides of a triangle are hit.
//!
//! # All hits along a ray
//!
//! A ray that continues with `t_min` equal to the reported `t` never meets the same triangle again. With `Exact`, such a
//! walk visits all crossings in the order of their exact `t`. It skips only triangles that report the same `t` as the
//! one before, such as the second triangle at a shared edge.
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
