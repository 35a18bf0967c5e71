//! The seam, carried out by the driver.

use crate::scene::DriverScene;
use crate::tree::triangles_of;
use crate::{DriverTreeBackend, check};
use backend::{
    Backend, BackendError, Device, DeviceBytes, FrameReport, Generation, Hits, Inspect,
    Intersector, Layout, Method, Palette, Query, QueryKind, Rays, Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Point, PointBuffer, Pose};
use gpu_common::{GpuDevice, Stage, Stale, Trace, are_given, refuse_above};
use gpu_vulkan::VulkanDevice;
use gpu_vulkan::commands::{KERNELS, RAYS};
use gpu_vulkan::memory::Buffer;
use shaders::work;
use shaders::{BufferName, Params, Shape};
use std::sync::Arc;

impl Backend for DriverTreeBackend {
    fn device(&self) -> &Device {
        &self.engine.device
    }

    fn makes_own_trees(&self) -> bool {
        true
    }

    fn supports(&self, method: Method) -> bool {
        crate::supports(method)
    }

    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()> {
        check(self.prefer.backend(), method)?;
        self.abandon();
        self.engine.unload()?;
        self.scene = None;
        self.engine.load(animation)?;
        let scene = DriverScene::new(&mut self.engine, &self.rays.rays, self.prefer)?;
        self.scene = Some(scene);
        Ok(())
    }

    fn adopt(&mut self, _: &Topology, _: Generation) -> Result<()> {
        let (backend, what) = (self.prefer.backend(), "trees made by others");
        Err(BackendError::unsupported(backend, what))
    }

    fn point_buffer(&mut self, points: usize) -> Result<PointBuffer> {
        self.engine.gpu.point_buffer(points)
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        let params = Params {
            alpha: pose.alpha,
            ..self.params()
        };
        self.engine.interpolate(pose, params, None)?;
        self.uncounted = false;
        Ok(())
    }

    /// Has work only for scenes with vertices that are not finite.
    fn preprocess(&mut self) -> Result<()> {
        assert!(self.engine.stale >= Stale::Records, "positions come first");
        if self.engine.stale > Stale::Records {
            return Ok(());
        }
        let (params, triangles) = (self.params(), self.triangles());
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let cleansed = scene.cleansed.as_ref();
        let work = cleansed.map(|_| work::cleanse(params, triangles, scene.centre));
        let own = |name| cleansed.filter(|_| name == BufferName::Cleansed);
        let stage = Some(Stage::Preprocess);
        self.engine.run(stage, work.as_slice(), own)?;
        self.engine.frames.record()?.extents.uncounted = Some(0);
        (self.engine.stale, self.uncounted) = (Stale::Boxes, true);
        Ok(())
    }

    fn rebuild(&mut self, _: Generation) -> Result<()> {
        self.preprocess()?;
        self.make_tree(true)
    }

    /// Nothing after a [`Backend::rebuild`] at the same positions.
    fn refit(&mut self) -> Result<()> {
        assert!(self.engine.stale >= Stale::Boxes, "vertices come first");
        if self.engine.stale == Stale::Fresh {
            return Ok(());
        }
        self.make_tree(false)
    }

    fn trace(&mut self, query: Query<'_>) -> Result<()> {
        let fresh = self.engine.stale == Stale::Fresh;
        assert!(fresh, "a stale tree must not be traced");
        let is_first = self.engine.frames.pending.is_empty();
        assert!(is_first, "one trace a submission");
        let size = self.launch_size(&query)?;
        let has_tree = self.engine.scene().animation.live_count() > 0;
        let how = (Intersector::Watertight, has_tree);
        let engine = &mut self.engine;
        let old = engine.frames.expired();
        let trace = Trace::new(&mut engine.gpu, &query, how, old, |_| false)?;
        self.launch(&query, &trace, size)?;
        self.engine.frames.pending.push(trace);
        Ok(())
    }

    fn load_palette(&mut self, palette: &Palette) -> Result<bool> {
        self.engine.load_palette(palette)?;
        Ok(true)
    }

    fn shade(&mut self, query: Query<'_>) -> Result<()> {
        let params = self.params();
        self.engine.shade(&query, params)
    }

    fn pixels(&mut self, ticket: Ticket, out: &mut Vec<u8>) -> Result<bool> {
        self.engine.pixels(ticket, out)
    }

    fn request_positions(&mut self) -> Result<()> {
        self.engine.request_positions()
    }

    fn submit(&mut self) -> Result<Ticket> {
        // The kernel that counts sees every triangle, those that are never active too.
        let submitted = self.count().and_then(|()| self.engine.submit(0));
        if submitted.is_err() {
            self.abandon();
        }
        submitted
    }

    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        self.engine.wait(ticket)
    }

    fn hits(&mut self, ticket: Ticket) -> Result<&mut Hits> {
        self.engine.hits(ticket, 0)
    }

    fn take_hits(&mut self, ticket: Ticket, place: usize, into: &mut Hits) -> Result<()> {
        self.engine.take_hits(ticket, place, into)
    }

    fn is_done(&mut self, ticket: Ticket) -> Result<bool> {
        self.engine.is_done(ticket)
    }

    fn release(&mut self, ticket: Ticket) {
        self.engine.release(ticket);
    }

    fn keep(&mut self, traces: usize) {
        self.engine.keep(traces);
    }

    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        self.engine.take_positions()
    }

    fn device_bytes(&self) -> Option<DeviceBytes> {
        let scene = self.scene.as_ref();
        let [tree, scratch] = scene.map_or([0; 2], DriverScene::held);
        Some(self.engine.bytes([tree, scratch, 0]))
    }

    fn free_device_bytes(&self) -> Option<u64> {
        self.engine.gpu.free_bytes()
    }

    fn inspect(&mut self) -> &mut dyn Inspect {
        self
    }
}

/// The entry point that makes a query's rays.
fn maker(query: &Query<'_>) -> &'static str {
    match (query.kind, are_given(query)) {
        (QueryKind::Any, _) => "given_any",
        (QueryKind::Closest, true) => "given_closest",
        (QueryKind::Closest, false) => "camera_closest",
        (QueryKind::ClosestAndShadow { .. }, true) => "given_shadow",
        (QueryKind::ClosestAndShadow { .. }, false) => "camera_shadow",
    }
}

impl DriverTreeBackend {
    /// What all kernels and rays share.
    fn params(&self) -> Params {
        Params::of(
            self.engine.scene().scale_exponent,
            &Shape::none(Layout::Bvh2),
        )
    }

    fn triangles(&self) -> u32 {
        self.engine.scene().animation.triangle_count() as u32
    }

    /// What was recorded never ran.
    fn abandon(&mut self) {
        self.engine.abandon();
        self.uncounted = false;
        if let Some(scene) = &mut self.scene {
            scene.tree.forget();
        }
    }

    /// Records the driver's work on its tree: made anew, or updated.
    fn make_tree(&mut self, anew: bool) -> Result<()> {
        let (engine, scene) = (&mut self.engine, self.scene.as_mut());
        let scene = scene.expect("a scene was loaded");
        let positions = &engine.scene().positions[engine.position];
        let from = triangles_of(engine.scene(), positions, scene.cleansed.as_ref());
        let slot = engine.frames.record()?;
        slot.record_as(Stage::Refit, |slot| {
            scene.tree.make(&slot.commands, from, anew);
            Ok(())
        })?;
        self.engine.stale = Stale::Fresh;
        Ok(())
    }

    /// Columns and rows of a launch.
    fn launch_size(&self, query: &Query<'_>) -> Result<[u32; 2]> {
        let bounds = self.rays.rays.bounds;
        let size = match query.rays {
            Rays::Camera(c) if !are_given(query) => [u64::from(c.width), u64::from(c.height)],
            _ => {
                let count = query.rays.count() as u64;
                let rows = count.div_ceil(bounds.along[0]).max(1);
                [count.div_ceil(rows), rows]
            }
        };
        let what = || "rays (of one launch, maxRayDispatchInvocationCount)".to_owned();
        let [x, y] = bounds.along;
        for (need, most) in [(size[0], x), (size[1], y), (size[0] * size[1], bounds.rays)] {
            refuse_above(what, need, most)?;
        }
        Ok(size.map(|n| n as u32))
    }

    /// Records a query's rays. Nothing hits a scene without live triangles: then no ray is traced.
    fn launch(
        &mut self,
        query: &Query<'_>,
        trace: &Trace<VulkanDevice>,
        size: [u32; 2],
    ) -> Result<()> {
        let params = work::rays(self.params(), query, are_given(query));
        let engine = &mut self.engine;
        let slot = engine.frames.record()?;
        if size[0] == 0 || !trace.has_tree {
            return slot.record_as(Stage::TracePrimary, |_| Ok(()));
        }
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let buffers = engine.scene.as_ref().expect("a scene was loaded");
        let (key, position) = (engine.pose.key, engine.position);
        let find = |name: BufferName| -> &Buffer {
            let found = match name {
                BufferName::Nodes => None,
                name => trace.get(name).or_else(|| buffers.get(name, key, position)),
            };
            // What a query does not need is bound to something.
            found.unwrap_or(&scene.root)
        };
        let rays = &self.rays;
        slot.record_as(Stage::TracePrimary, |slot| {
            slot.commands.barrier(KERNELS, RAYS);
            let pipeline = (rays.vk, &rays.layouts);
            slot.bind_rays(pipeline, &params, scene.tree.top(), find)?;
            rays.launch(slot.commands.vk(), maker(query), size);
            slot.commands.barrier(RAYS, KERNELS);
            Ok(())
        })
    }

    /// Records what counts triangles and hits, after the end of the last stage.
    fn count(&mut self) -> Result<()> {
        let params = self.params();
        if std::mem::take(&mut self.uncounted) {
            let work = work::count_triangles(params, self.triangles());
            self.engine.run(None, &[work], |_| None)?;
        }
        let pending = std::mem::take(&mut self.engine.frames.pending);
        let counted = pending.iter().filter(|t| t.has_tree).try_for_each(|trace| {
            let mut all = work::count_answers(params, trace.kind, trace.count as u32).into_iter();
            all.try_for_each(|(work, buffer)| {
                let own = |name| (name == BufferName::Answers).then(|| trace.get(buffer))?;
                self.engine.run(None, &[work], own)
            })
        });
        self.engine.frames.pending = pending;
        counted
    }
}

impl Inspect for DriverTreeBackend {
    fn positions(&mut self) -> Result<Vec<Point>> {
        self.engine.positions()
    }

    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        let (backend, what) = (self.prefer.backend(), "a look into the driver's tree");
        Err(BackendError::unsupported(backend, what))
    }

    fn complaints(&mut self) -> Vec<String> {
        self.engine.gpu.complaints()
    }
}
