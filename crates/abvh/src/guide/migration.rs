//! Migration from Embree, `bvh` or `obvhs`: their functions, and the equivalents here.
//!
//! One call traces a list of rays. Triangles are the only primitives. Vertices are `[f32; 3]`, triangles `[u32; 3]`.
//!
//! # Embree 4, and `embree4-rs` 0.0.16
//!
//! | there | here |
//! |---|---|
//! | `rtcNewDevice`, `Device::try_new` | [`Tracer::builder`](crate::Tracer::builder), [`TracerBuilder::device`](crate::TracerBuilder::device), [`TracerBuilder::threads`](crate::TracerBuilder::threads) |
//! | `rtcNewScene`, `Scene::try_new` | [`Scene::new`](crate::Scene::new) |
//! | `rtcNewGeometry`, `rtcSetNewGeometryBuffer`, `TriangleMeshGeometry::try_new` | [`Mesh::fixed`](crate::Mesh::fixed), [`Mesh::streamed`](crate::Mesh::streamed) |
//! | `rtcAttachGeometry`, `Scene::attach_geometry` | [`Scene::add`](crate::Scene::add) |
//! | `rtcCommitScene`, `Scene::commit`: the first | [`TracerBuilder::build`](crate::TracerBuilder::build) |
//! | `rtcUpdateGeometryBuffer`, `rtcCommitGeometry`, `rtcCommitScene`: later ones | [`Step::vertices`](crate::Step::vertices); by default, later steps do not wait for a build |
//! | `rtcSetNewGeometryBuffer` of a geometry in use, `rtcCommitScene` | [`Tracer::replace`](crate::Tracer::replace), [`Tracer::commit`](crate::Tracer::commit) |
//! | `rtcSetGeometryTransform` of an instance | [`Step::poses`](crate::Step::poses) of a [`Mesh::rigid`](crate::Mesh::rigid); each instance has its own vertices |
//! | `rtcSetGeometryTimeStepCount`, `RTCRay::time` | [`Mesh::keyframes`](crate::Mesh::keyframes), with one time for all rays of a step |
//! | `RTC_BUILD_QUALITY_REFIT` | [`Update::Refit`](crate::Update::Refit) |
//! | `RTC_SCENE_FLAG_ROBUST` | [`Intersector::Watertight`](crate::Intersector::Watertight), the default |
//! | `rtcIntersect1`, `rtcIntersect16`, `CommittedScene::intersect_1` | [`Step::trace`](crate::Step::trace) with [`Query::Closest`](crate::Query::Closest) |
//! | `rtcOccluded1`, `rtcOccluded16` | [`Step::trace`](crate::Step::trace) with [`Query::Any`](crate::Query::Any) |
//! | `tnear`, `tfar`; `geomID`, `primID`, `u`, `v` | [`Ray`](crate::Ray)'s `t_min`, `t_max`; [`Hit`](crate::Hit)'s `mesh`, `triangle`, `u`, `v` |
//! | `Ng_x`, `Ng_y`, `Ng_z`; instances, filters, masks, `rtcPointQuery`, `rtcDetachGeometry` | not available |
//!
//! # `bvh` 0.13
//!
//! | there | here |
//! |---|---|
//! | `BHShape`, `Bounded` of your shapes; `Bvh::build`, `Bvh::build_par` | [`Mesh`](crate::Mesh), [`TracerBuilder::build`](crate::TracerBuilder::build) |
//! | `Ray::new`, which normalizes the direction | [`Ray::new`](crate::Ray::new), which does not: `t` is in units of its length |
//! | `Bvh::traverse`, then `Ray::intersects_triangle`, which misses back faces | [`Step::trace`](crate::Step::trace), which hits both faces |
//! | `Bvh::update_shapes` | [`Step::vertices`](crate::Step::vertices) |
//! | `Bvh::nearest_to`, `Bvh::add_shape`, `Bvh::remove_shape`, `Bvh::flatten` | not available |
//!
//! # `obvhs` 0.4
//!
//! | there | here |
//! |---|---|
//! | `build_bvh2_from_tris`, `build_cwbvh_from_tris`, `BvhBuildParams` | [`TracerBuilder::build`](crate::TracerBuilder::build) |
//! | `Ray::new(origin, direction, min, max)`, `Ray::new_inf` | [`Ray`](crate::Ray) with `t_min`, `t_max`; [`Ray::new`](crate::Ray::new) |
//! | `ray_traverse`, then `primitive_indices`; `ray_traverse_miss` | [`Query::Closest`](crate::Query::Closest); [`Query::Any`](crate::Query::Any) |
//! | `Bvh2Node::set_aabb`, `Bvh2::refit_all` | [`Step::vertices`](crate::Step::vertices) with [`Update::Refit`](crate::Update::Refit) |
//! | `PlocBuilder::full_rebuild`, `ReinsertionOptimizer` | [`Update::Async`](crate::Update::Async), on other threads |
//! | `ray_traverse_anyhit`, `aabb_traverse`, `insert_primitive`, `ray_traverse_tlas_blas` | not available |
//!
//! The equivalent of an Embree geometry update followed by `rtcOccluded1`:
//!
//! ```
//! use abvh::{Device, Mesh, Query, Ray, Scene, Source, Tracer};
//!
//! let gate = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
//! let mut scene = Scene::new();
//! let mesh = scene.add(Mesh::streamed(&gate(0.0), &[[0, 1, 2]])?);
//! let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
//! let ray = Ray { t_max: 2.0, ..Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]) };
//! let mut step = tracer.step(0.0);
//! step.vertices(mesh, Source::Host(&gate(-0.1)))?;
//! let (any, done) = (step.trace(&[ray], Query::Any)?, step.submit()?);
//! assert!(tracer.hits(done, any)?.is_hit(0));
//! # Ok::<_, abvh::Error>(())
//! ```
