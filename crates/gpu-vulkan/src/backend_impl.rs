//! The seam, carried out.

use crate::VulkanBackend;
use crate::clock::Stage;
use crate::scene::SceneBuffers;
use crate::stages::Also;
use crate::traces::Traces;
use crate::tree::TreeBuffers;
use crate::vulkan::Stale;
use backend::{
    Backend, Device, DeviceBytes, FrameReport, Generation, Hits, Inspect, Layout, Method, Query,
    Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Animation, Pose, Ray};
use shaders::Kernel;
use shaders::work::{self, Progress};
use std::sync::Arc;

impl Backend for VulkanBackend {
    fn device(&self) -> &Device {
        &self.device
    }

    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()> {
        let limits = &self.gpu.limits;
        limits.admit_kernels(|k| !k.makes_trees() && k.serves(method))?;
        self.pipelines.prepare(&self.gpu, method)?;
        // What is under way or recorded belongs to the scene before.
        self.gpu.wait_idle()?;
        self.abandon();
        self.frames.forget();
        self.snapshots.forget();
        self.traces = Traces::default();
        (self.scene, self.tree, self.position) = (None, None, 0);
        let tree = TreeBuffers::new(&self.gpu, &animation, method)?;
        let scene = SceneBuffers::new(&self.gpu, &mut self.upload, animation)?;
        (self.scene, self.tree, self.method) = (Some(scene), Some(tree), method);
        Ok(())
    }

    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        let recording = self.frames.is_recording();
        assert!(!recording, "trees are adopted between submissions");
        let current = self.tree.as_mut().expect("a scene was loaded");
        assert!(generation > current.generation, "generations rise");
        let road = (&mut self.upload, &self.frames);
        current.adopt(&self.gpu, road, (tree, generation))?;
        self.progress = Progress::default();
        self.stale = self.stale.min(Stale::Records);
        Ok(())
    }

    fn wants_treelets(&self) -> bool {
        self.method.layout == Layout::Fast
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        let (position, busy_until) = self
            .snapshots
            .position_to_write(self.position, &self.readback.done)?;
        self.position = position;
        self.overwritten = self.overwritten.max(busy_until);
        let vertices = self.scene().vertices();
        self.pose = pose;
        let work = [work::interpolate(self.params(), vertices)];
        self.run(Stage::Interpolate, &work, Also::default())?;
        self.stale = Stale::Records;
        Ok(())
    }

    fn preprocess(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Records, "positions come first");
        assert!(self.tree().generation > Generation(0), "a tree comes first");
        if self.is_made_whole() {
            return Ok(());
        }
        let (work, uncounted) =
            self.progress
                .preprocess(self.method, self.params(), &self.tree().shape);
        self.run(Stage::Preprocess, &work, Also::default())?;
        self.frames.record()?.extents.uncounted = Some(uncounted);
        self.progress
            .preprocessed(&self.tree.as_ref().expect("a scene was loaded").shape);
        self.stale = Stale::Boxes;
        Ok(())
    }

    fn refit(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Boxes, "boxes of leaves come first");
        if self.is_made_whole() {
            return Ok(());
        }
        let (work, extent) = self
            .progress
            .refit(self.method, self.params(), &self.tree().shape);
        self.run(Stage::Refit, &work, Also::default())?;
        self.frames.record()?.extents.refitted(extent);
        self.progress.refitted();
        self.stale = Stale::Fresh;
        Ok(())
    }

    fn check_rebuild(&self) -> Result<()> {
        self.gpu.limits.admit_kernels(Kernel::makes_trees)
    }

    fn rebuild(&mut self, generation: Generation) -> Result<()> {
        assert!(self.stale >= Stale::Records, "positions come first");
        assert!(generation > self.tree().generation, "generations rise");
        self.check_rebuild()?;
        self.stale = self.stale.min(Stale::Records);
        self.make_tree(generation)?;
        self.stale = Stale::Fresh;
        Ok(())
    }

    fn trace(&mut self, query: Query<'_>) -> Result<()> {
        let fresh = self.stale == Stale::Fresh;
        assert!(fresh, "a stale tree must not be traced");
        assert!(self.traces.pending.is_none(), "one trace a submission");
        let has_tree = self.tree().shape.leaf_count > 0;
        let how = (self.method.intersector, has_tree);
        let (range, exponent) = self.reach();
        let is_extreme = |ray: &Ray| shaders::is_extreme(ray.origin, range, exponent);
        let trace = self.traces.make(&self.gpu, &query, how, is_extreme)?;
        self.trace_stages(&query, &trace)?;
        self.traces.pending = Some(trace);
        Ok(())
    }

    fn request_positions(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Records, "positions come first");
        let bytes = self.scene().position_bytes();
        self.snapshots.ask(&self.gpu, self.position, bytes)?;
        // They go as soon as they are made, beside what is recorded from here on.
        self.frames.record()?.split()
    }

    fn submit(&mut self) -> Result<Ticket> {
        let submitted = self.submit_recording();
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
        let vertices = self.scene().animation.vertex_count();
        self.snapshots.take(&self.readback.done, vertices)
    }

    fn device_bytes(&self) -> Option<DeviceBytes> {
        let tree = self.tree.as_ref().map_or([0; 2], TreeBuffers::held);
        let scene = self.scene.as_ref().map_or(0, SceneBuffers::held);
        Some(self.gpu.memory.parts(tree, scene))
    }

    fn free_device_bytes(&self) -> Option<u64> {
        self.gpu.memory.free_bytes(&self.gpu.host)
    }

    fn inspect(&mut self) -> &mut dyn Inspect {
        self
    }
}
