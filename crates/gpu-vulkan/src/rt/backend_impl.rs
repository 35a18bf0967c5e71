//! The seam, carried out by the driver.

use super::scene::RtScene;
use super::tree::triangles_of;
use super::{DriverTreeBackend, Stale, rays_of};
use crate::clock::Stage;
use crate::commands::{KERNELS, RAYS};
use crate::memory::Buffer;
use crate::traces::{Trace, Traces, are_given};
use ash::vk;
use backend::{
    Backend, BackendError, Device, DeviceBytes, FrameReport, Generation, Hits, Inspect,
    Intersector, Method, Query, QueryKind, Rays, Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Point, Pose};
use shaders::work::{self, Work};
use shaders::{Params, Shape};
use std::sync::Arc;

impl Backend for DriverTreeBackend {
    fn device(&self) -> &Device {
        &self.device
    }

    fn makes_own_trees(&self) -> bool {
        true
    }

    fn supports(&self, method: Method) -> bool {
        super::method::driver_tree_supports(method)
    }

    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()> {
        super::method::check(self.device.backend, method)?;
        self.gpu.wait_idle()?;
        self.abandon();
        self.frames.forget();
        self.snapshots.forget();
        self.traces = Traces::default();
        (self.scene, self.position) = (None, 0);
        let scene = RtScene::new(&self.gpu, &mut self.upload, animation, self.prefer)?;
        self.scene = Some(scene);
        Ok(())
    }

    fn adopt(&mut self, _: &Topology, _: Generation) -> Result<()> {
        Err(BackendError::Unsupported {
            backend: self.device.backend,
            what: "trees made by others".to_owned(),
        })
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        let (position, busy_until) = self
            .snapshots
            .position_to_write(self.position, &self.readback.done)?;
        self.position = position;
        self.overwritten = self.overwritten.max(busy_until);
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let buffers = &scene.buffers;
        let params = Params {
            alpha: pose.alpha,
            ..params(scene)
        };
        let work = [work::interpolate(params, buffers.vertices())];
        let find = |name| match name {
            "earlier" => buffers.key(pose.key),
            "later" => buffers.key(pose.key.saturating_add(1)),
            "moving_rows" => &buffers.moving_rows,
            _ => &buffers.positions[position],
        };
        let slot = self.frames.record()?;
        slot.record(&self.kernels, Stage::Interpolate, &work, find)?;
        (self.stale, self.uncounted) = (Stale::Vertices, false);
        Ok(())
    }

    /// Has work only for scenes with vertices that are not finite.
    fn preprocess(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Vertices, "positions come first");
        if self.stale > Stale::Vertices {
            return Ok(());
        }
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let positions = &scene.buffers.positions[self.position];
        let triangles = scene.buffers.animation.triangle_count() as u32;
        let cleanse = scene.cleansed.as_ref();
        let work = cleanse.map(|_| work::cleanse(params(scene), triangles, scene.centre));
        let find = |name| match name {
            "cleansed" => cleanse.expect("there is something to cleanse"),
            "triangles" => &scene.buffers.triangles,
            _ => positions,
        };
        let slot = self.frames.record()?;
        slot.record(&self.kernels, Stage::Preprocess, work.as_slice(), find)?;
        slot.extents.uncounted = Some(0);
        (self.stale, self.uncounted) = (Stale::Tree, true);
        Ok(())
    }

    fn rebuild(&mut self, _: Generation) -> Result<()> {
        self.preprocess()?;
        self.make_tree(true)
    }

    /// Nothing after a [`Backend::rebuild`] at the same positions.
    fn refit(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Tree, "vertices come first");
        if self.stale == Stale::Fresh {
            return Ok(());
        }
        self.make_tree(false)
    }

    fn trace(&mut self, query: Query<'_>) -> Result<()> {
        let fresh = self.stale == Stale::Fresh;
        assert!(fresh, "a stale tree must not be traced");
        assert!(self.traces.pending.is_none(), "one trace a submission");
        let launch = self.launch_size(&query)?;
        let has_tree = self.scene().buffers.animation.live_count() > 0;
        let trace = self.traces.make(
            &self.gpu,
            &query,
            (Intersector::Watertight, has_tree),
            |_| false,
        )?;
        self.launch(&query, &trace, launch, has_tree)?;
        self.traces.pending = Some(trace);
        Ok(())
    }

    fn request_positions(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Vertices, "positions come first");
        let bytes = self.scene().buffers.position_bytes();
        self.snapshots.ask(&self.gpu, self.position, bytes)?;
        self.frames.record()?.split()
    }

    fn submit(&mut self) -> Result<Ticket> {
        let submitted = self.count().and_then(|()| self.submit_recording());
        if submitted.is_err() {
            self.abandon();
        }
        submitted
    }

    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        self.frames.retire(ticket)
    }

    fn hits(&mut self, ticket: Ticket, out: &mut Hits) -> Result<()> {
        self.frames.retire(ticket)?;
        let road = (&mut self.readback, &mut self.window);
        self.traces.get(ticket).fetch(&self.gpu, road, out)
    }

    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        let vertices = self.scene().buffers.animation.vertex_count();
        self.snapshots.take(&self.readback.done, vertices)
    }

    fn device_bytes(&self) -> Option<DeviceBytes> {
        let scene = self.scene.as_ref();
        let tree = scene.map_or([0; 2], RtScene::tree_held);
        let scene = scene.map_or(0, |s| s.buffers.held());
        Some(self.gpu.memory.parts(tree, scene))
    }

    fn free_device_bytes(&self) -> Option<u64> {
        self.gpu.memory.free_bytes(&self.gpu.host)
    }

    fn inspect(&mut self) -> &mut dyn Inspect {
        self
    }
}

/// What all kernels and rays share.
fn params(scene: &RtScene) -> Params {
    Params::of(scene.buffers.scale_exponent, &Shape::default())
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

/// What counts the hits of a trace.
fn counts(params: Params, trace: &Trace) -> Vec<Work> {
    let rays = trace.count as u32;
    let hits = work::count_hits(params, rays);
    match trace.kind {
        QueryKind::Any => vec![work::count_any(params, rays)],
        QueryKind::Closest => vec![hits],
        QueryKind::ClosestAndShadow { .. } => vec![hits, work::count_occluded(params, rays)],
    }
}

impl DriverTreeBackend {
    /// Records the driver's work on its tree: made anew, or updated.
    fn make_tree(&mut self, anew: bool) -> Result<()> {
        let scene = self.scene.as_mut().expect("a scene was loaded");
        let positions = &scene.buffers.positions[self.position];
        let from = triangles_of(&scene.buffers, positions, scene.cleansed.as_ref());
        let tree = &mut scene.tree;
        let slot = self.frames.record()?;
        slot.record_as(Stage::Refit, |commands| match anew {
            true => tree.rebuild(commands, from),
            false => tree.update(commands, from),
        })?;
        self.stale = Stale::Fresh;
        Ok(())
    }

    /// Columns and rows of a launch.
    fn launch_size(&self, query: &Query<'_>) -> Result<[u32; 2]> {
        let bounds = rays_of(&self.gpu).bounds;
        let size = match query.rays {
            Rays::Camera(c) if !are_given(query) => [u64::from(c.width), u64::from(c.height)],
            _ => {
                let count = query.rays.count() as u64;
                let rows = count.div_ceil(bounds.along[0]).max(1);
                [count.div_ceil(rows), rows]
            }
        };
        let limits = [bounds.along[0], bounds.along[1], bounds.rays];
        let needs = [size[0], size[1], size[0] * size[1]];
        for (need, limit) in needs.into_iter().zip(limits) {
            if need > limit {
                let what = "rays (of one launch, maxRayDispatchInvocationCount)".to_owned();
                return Err(BackendError::Limit { what, need, limit });
            }
        }
        Ok(size.map(|n| n as u32))
    }

    /// Records a query's rays. Nothing hits a scene without live triangles: then no ray is traced.
    fn launch(
        &mut self,
        query: &Query<'_>,
        trace: &Trace,
        size: [u32; 2],
        has_tree: bool,
    ) -> Result<()> {
        if size[0] == 0 || !has_tree {
            let slot = self.frames.record()?;
            return slot.record_as(Stage::TracePrimary, |_| ());
        }
        let place = self.frames.place();
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let params = work::rays(params(scene), query, are_given(query));
        let positions = &scene.buffers.positions[self.position];
        let find = |name: &'static str| match name {
            "nodes" => &scene.root,
            "triangles" => &scene.buffers.triangles,
            "positions" => positions,
            "rays" => trace.rays.as_ref().unwrap_or(&scene.root),
            "hits" => trace.hits.as_ref().unwrap_or(&scene.root),
            "occluded" => trace.blocked.as_ref().unwrap_or(&scene.root),
            other => panic!("no buffer named {other}"),
        };
        let (set, row) = self.sets.fill(place, scene.tree.top(), &params, find);
        let (vk, rays) = (&self.gpu.vk, &self.rays);
        let slot = self.frames.record()?;
        slot.record_as(Stage::TracePrimary, |commands| {
            let point = vk::PipelineBindPoint::RAY_TRACING_KHR;
            commands.barrier(KERNELS, RAYS);
            // SAFETY: the command buffer is being recorded; pipeline and set belong to the device and match.
            unsafe {
                let commands = commands.vk();
                vk.cmd_bind_pipeline(commands, point, rays.vk);
                vk.cmd_bind_descriptor_sets(commands, point, rays.layout, 0, &[set], &[row]);
            }
            rays.launch(commands.vk(), maker(query), size);
            commands.barrier(RAYS, KERNELS);
        })
    }

    /// Records what counts triangles and hits, after the end of the last stage.
    fn count(&mut self) -> Result<()> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let params = params(scene);
        let mut work = Vec::new();
        if self.uncounted {
            let triangles = scene.buffers.animation.triangle_count() as u32;
            work.push(work::count_triangles(params, triangles));
        }
        let trace = self.traces.pending.as_ref().filter(|t| t.has_tree);
        work.extend(trace.into_iter().flat_map(|t| counts(params, t)));
        let positions = &scene.buffers.positions[self.position];
        let found = |buffer: fn(&Trace) -> Option<&Buffer>| {
            let buffer = trace.and_then(buffer);
            buffer.expect("what is counted was traced")
        };
        let find = |name: &'static str| match name {
            "triangles" => &scene.buffers.triangles,
            "positions" => positions,
            "hits" => found(|t| t.hits.as_ref()),
            "occluded" => found(|t| t.blocked.as_ref()),
            other => panic!("no buffer named {other}"),
        };
        if !work.is_empty() {
            self.frames.record()?.dispatch(&self.kernels, &work, find)?;
        }
        self.uncounted = false;
        Ok(())
    }
}

impl Inspect for DriverTreeBackend {
    fn positions(&mut self) -> Result<Vec<Point>> {
        self.gpu.wait_idle()?;
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let buffers = &scene.buffers;
        let from = &buffers.positions[self.position];
        let count = buffers.animation.vertex_count();
        let (gpu, road) = (&self.gpu, &mut self.readback);
        Ok(self.window.look(gpu, road, from, count)?.to_vec())
    }

    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        Err(BackendError::Unsupported {
            backend: self.device.backend,
            what: "a look into the driver's tree".to_owned(),
        })
    }
}
