//! Records a frame: positions, the driver's tree, rays, counts.

use super::VulkanRt;
use super::scene::VulkanScene;
use super::tree::{build_flags, triangles_of};
use crate::{Rival, TreeUpdate};
use backend::{
    Device, DeviceBytes, FrameReport, Hits, Intersector, Query, QueryKind, Rays, Result,
};
use geom::{Animation, Point, Pose};
use gpu_common::{GpuDevice, Stage, TraceBuffers, check_limit, reads_ray_buffer};
use gpu_vulkan::commands::{KERNELS, RAYS};
use gpu_vulkan::{NativeCommand, RayBindings, VulkanDevice};
use shaders::work;
use shaders::{BufferName, Params, RAYS as RAY_SHADERS, Shape};
use std::sync::Arc;

impl Rival for VulkanRt {
    fn device(&self) -> &Device {
        &self.engine.info.device
    }

    fn load(&mut self, animation: Arc<Animation>, tree_update: TreeUpdate) -> Result<()> {
        self.engine.unload()?;
        (self.scene, self.pose, self.traced) = (None, None, None);
        self.engine.load(animation)?;
        let flags = build_flags(self.name, tree_update);
        let scene = VulkanScene::new(&mut self.engine, &self.pipeline.ray_tracing, flags)?;
        self.scene = Some(scene);
        Ok(())
    }

    fn frame(&mut self, pose: Pose, rays: Rays<'_>, light: Option<Point>) -> Result<FrameReport> {
        let shadows = light.map(|light| QueryKind::ClosestAndShadow { light });
        let kind = shadows.unwrap_or(QueryKind::Closest);
        let query = Query { rays, kind };
        let recorded = self.record(pose, &query);
        let submitted = recorded.and_then(|()| self.engine.submit());
        if submitted.is_err() {
            // The recorded commands never run.
            self.engine.abandon();
            self.pose = None;
            self.scene.iter_mut().for_each(|scene| scene.tree.forget());
        }
        let ticket = submitted?;
        self.traced = Some(ticket);
        self.engine.wait(ticket)
    }

    fn hits(&mut self) -> Result<&Hits> {
        let ticket = self.traced.expect("a frame was traced");
        self.engine.take_hits(ticket, 0, &mut self.hits)?;
        Ok(&self.hits)
    }

    fn device_bytes(&self) -> Option<DeviceBytes> {
        let scene = self.scene.as_ref();
        let [tree, scratch] = scene.map_or([0; 2], VulkanScene::held);
        Some(self.engine.bytes([tree, scratch, 0]))
    }

    fn complaints(&self) -> Vec<String> {
        self.engine.gpu.info().complaints
    }
}

/// Vulkan's limits on the columns and the rows of a launch.
const AXIS_LIMITS: [&str; 2] = [
    "maxComputeWorkGroupCount[0] * maxComputeWorkGroupSize[0]",
    "maxComputeWorkGroupCount[1] * maxComputeWorkGroupSize[1]",
];
/// Vulkan's limit on the rays of a launch.
const RAY_LIMIT: &str = "maxRayDispatchInvocationCount";

/// Returns the ray generation shader of a query.
fn generation_shader(query: &Query<'_>) -> &'static str {
    match (query.kind.light(), reads_ray_buffer(query)) {
        (None, true) => "explicit_closest",
        (None, false) => "camera_closest",
        (Some(_), true) => "explicit_shadow",
        (Some(_), false) => "camera_shadow",
    }
}

impl VulkanRt {
    /// Returns the parameters that all kernels and rays share.
    fn params(&self) -> Params {
        Params::of(self.engine.scene().scale_exponent, &Shape::default())
    }

    /// Records all commands of a frame.
    fn record(&mut self, pose: Pose, query: &Query<'_>) -> Result<()> {
        if self.pose != Some(pose) {
            let params = Params {
                alpha: pose.alpha,
                ..self.params()
            };
            self.engine.interpolate(pose, params, None)?;
            self.copy_finite_triangles()?;
            self.make_tree()?;
            self.pose = Some(pose);
        }
        self.trace(query)?;
        self.count()
    }

    /// Records a copy of all triangles, if the scene may have vertices that are not finite. A triangle with such a vertex
    /// collapses to a point.
    fn copy_finite_triangles(&mut self) -> Result<()> {
        let params = self.params();
        let triangles = self.engine.scene().animation.triangle_count() as u32;
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let copy = scene.finite_triangles.as_ref();
        let work = copy.map(|_| work::collapse_non_finite(params, triangles, scene.centre));
        // Binds the copy, which is not a buffer of the engine's scene.
        let overrides = |name| copy.filter(|_| name == BufferName::FiniteTriangles);
        self.engine
            .run(Some(Stage::Preprocess), work.as_slice(), overrides)
    }

    /// Records the driver's build of its tree, or the update.
    fn make_tree(&mut self) -> Result<()> {
        let (engine, scene) = (&mut self.engine, self.scene.as_mut());
        let scene = scene.expect("a scene was loaded");
        // `engine.position` is the index of the current position buffer.
        let positions = &engine.scene().positions[engine.position];
        let from = triangles_of(engine.scene(), positions, scene.finite_triangles.as_ref());
        let build = scene.tree.make(from);
        engine
            .frames
            .recorder
            .record_native(Stage::Refit, Some(build));
        Ok(())
    }

    /// Records the rays of a query.
    fn trace(&mut self, query: &Query<'_>) -> Result<()> {
        let size = self.launch_size(query)?;
        let engine = &mut self.engine;
        // A finished trace, whose buffers are reused.
        let old = engine.frames.expired();
        // The intersector selects buffer sizes only: the driver intersects.
        let trace = TraceBuffers::new(&mut engine.gpu, query, Intersector::Watertight, old)?;
        self.launch(query, &trace, size);
        self.engine.frames.pending.push(trace);
        Ok(())
    }

    /// Returns the columns and rows of a launch.
    fn launch_size(&self, query: &Query<'_>) -> Result<[u32; 2]> {
        let bounds = self.pipeline.ray_tracing.bounds;
        let size = match query.rays {
            Rays::Camera(c) if !reads_ray_buffer(query) => {
                [u64::from(c.width), u64::from(c.height)]
            }
            _ => {
                let count = query.rays.count() as u64;
                let rows = count.div_ceil(bounds.rays_per_axis[0]).max(1);
                [count.div_ceil(rows), rows]
            }
        };
        let [x, y] = bounds.rays_per_axis;
        for (what, source, need, most) in [
            ("columns of rays", AXIS_LIMITS[0], size[0], x),
            ("rows of rays", AXIS_LIMITS[1], size[1], y),
            ("rays", RAY_LIMIT, size[0] * size[1], bounds.rays),
        ] {
            let what = || format!("{what} (of one launch, {source})");
            check_limit(what, need, most)?;
        }
        Ok(size.map(|n| n as u32))
    }

    /// Records a launch of rays, unless there are no rays.
    fn launch(&mut self, query: &Query<'_>, trace: &TraceBuffers<VulkanDevice>, size: [u32; 2]) {
        // The range of coordinates at this pose limits how far shadow rays start from the surface.
        let range = self.engine.scene().animation.range(self.engine.pose);
        let params = self.params().with_range(Some(range));
        let params = work::ray_params(params, query, reads_ray_buffer(query));
        let engine = &mut self.engine;
        if size[0] == 0 {
            // Ends the stage, so that its time is in the report.
            engine
                .frames
                .recorder
                .record_native(Stage::TracePrimary, None);
            return;
        }
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let buffers = engine.scene.as_ref().expect("a scene was loaded");
        let (key, position) = (engine.pose.key, engine.position);
        let bound = RAY_SHADERS.bindings.iter().map(|binding| {
            let found = match binding.name {
                BufferName::Nodes => None,
                name => trace.get(name).or_else(|| buffers.get(name, key, position)),
            };
            // `scene.root` is the buffer `nodes` of the shaders, which read only the box of the root. It also fills
            // bindings that the query does not use.
            found.unwrap_or(&scene.root).vk
        });
        let bound: Vec<_> = bound.collect();
        let (pipeline, layouts) = (self.pipeline.vk, Arc::clone(&self.pipeline.layouts));
        let tree = scene.tree.top();
        let launch = self.pipeline.launch(generation_shader(query), size);
        let command: NativeCommand = Box::new(move |encoder| {
            encoder.commands.barrier(KERNELS, RAYS);
            encoder.bind_rays(&RayBindings {
                pipeline,
                layouts: &layouts,
                params: &params,
                tree,
                buffers: &bound,
            })?;
            launch(encoder.commands.vk());
            encoder.commands.barrier(RAYS, KERNELS);
            Ok(())
        });
        engine
            .frames
            .recorder
            .record_native(Stage::TracePrimary, Some(command));
    }

    /// Records the kernels that count hits. They follow the trace, and their time belongs to no stage.
    fn count(&mut self) -> Result<()> {
        let params = self.params();
        let pending = std::mem::take(&mut self.engine.frames.pending);
        let counted = pending.iter().try_for_each(|trace| {
            let mut all = work::count_answers(params, trace.kind, trace.count as u32).into_iter();
            all.try_for_each(|(work, buffer)| {
                // Answers are the results of rays: here `buffer` of the trace, which holds hits or shadows.
                let overrides = |name| (name == BufferName::Answers).then(|| trace.get(buffer))?;
                self.engine.run(None, &[work], overrides)
            })
        });
        self.engine.frames.pending = pending;
        counted
    }
}
