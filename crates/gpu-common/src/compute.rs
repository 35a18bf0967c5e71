//! The backend that runs compute kernels.

mod trace;

use crate::traces::ray_source;
use crate::tree::TreeBuffers;
use crate::{Engine, GpuDevice, LastUse, NextStage, PendingWork, Stage, check_kernels};
use backend::{
    Backend, Capabilities, Device, FrameReport, Generation, Hits, Intersector, MemoryUse, Palette,
    Query, Result, Snapshot, Ticket, TreeFormat, TreeWriter,
};
use bvh_layout::Topology;
use geom::{Animation, CoordinateRange, Pose};
use shaders::rebuild;
use shaders::work::{self, TraceInput};
use shaders::{KERNELS, Kernel, Params, Shape, common};
use std::sync::Arc;

/// The backend that runs the kernels of crate `shaders` on a device.
pub struct ComputeBackend<D: GpuDevice> {
    pub(crate) engine: Engine<D>,
    pub(crate) trees: Option<TreeBuffers<D>>,
    /// The intersector of the loaded scene.
    intersector: Intersector,
    /// Range of the coordinates at the current pose, or `None` if the host has not computed it. A kernel then measures
    /// it where needed.
    range: Option<CoordinateRange>,
}

impl<D: GpuDevice> ComputeBackend<D> {
    /// Creates a backend on an open device.
    ///
    /// # Errors
    /// Those of [`Engine::new`].
    pub fn over(gpu: D) -> Result<Self> {
        let mut engine = Engine::new(gpu, [common("arithmetic")])?;
        engine.info.device.capabilities = Capabilities {
            tree_format: TreeFormat::Treelets,
            batches: true,
            device_rebuild: check_kernels(&engine.info.kernel_limits, Kernel::builds_trees),
        };
        Ok(Self::with(engine))
    }

    /// Returns a function that creates a backend for another scene on the same device. Any thread may call it. Both
    /// scenes can be loaded and traced at the same time.
    pub fn share_device(&self) -> impl FnOnce() -> Result<Self> + Send + use<D> {
        let open = self.engine.share_device();
        move || open().map(Self::with)
    }

    fn with(engine: Engine<D>) -> Self {
        Self {
            engine,
            trees: None,
            intersector: Intersector::Watertight,
            range: None,
        }
    }

    /// Returns the device.
    pub fn gpu(&self) -> &D {
        &self.engine.gpu
    }

    /// Returns the device.
    pub fn gpu_mut(&mut self) -> &mut D {
        &mut self.engine.gpu
    }

    /// Returns the tickets of submissions that are known to never run, and gives each an empty report. The next submission
    /// must then begin with `interpolate`.
    pub fn remove_dropped(&mut self) -> Vec<Ticket> {
        let engine = &mut self.engine;
        let dropped = engine.frames.remove_dropped(&mut engine.gpu);
        if !dropped.is_empty() {
            // Later submissions depend on earlier ones, so all data on the device is stale.
            engine.abandon();
            engine.snapshots.remove(&dropped);
            if let Some(trees) = &mut self.trees {
                trees.recording_dropped();
            }
        }
        dropped
    }

    pub(crate) fn trees(&self) -> &TreeBuffers<D> {
        self.trees.as_ref().expect("a scene was loaded")
    }

    fn trees_mut(&mut self) -> &mut TreeBuffers<D> {
        self.trees.as_mut().expect("a scene was loaded")
    }

    /// Checks that all stages before `stage` are up to date.
    fn require(&self, stage: NextStage, why: &str) {
        assert!(self.engine.next_stage >= stage, "{why}");
    }

    fn require_later(&self, generation: Generation) {
        assert!(
            generation > self.trees().current.generation,
            "generations must increase"
        );
    }

    /// Returns the parameters that all dispatches share.
    fn params(&self) -> Params {
        self.params_at(self.engine.pose)
    }

    fn params_at(&self, pose: Pose) -> Params {
        self.params_of(&self.trees().current.shape, pose)
    }

    fn params_of(&self, shape: &Shape, pose: Pose) -> Params {
        let params = Params {
            alpha: pose.alpha,
            // `with_range(None)` keeps this value: whether coordinates differ greatly in magnitude, as last measured by
            // the device. It selects kernels and the padding of boxes. This affects speed, but changes no hit.
            spread: self.engine.frames.spread.into(),
            ..Params::of(self.engine.scene().scale_exponent, shape)
        };
        params.with_range(self.range)
    }

    /// Records a stage of the current tree.
    fn run(&mut self, stage: Stage, work: &[work::Work]) -> Result<()> {
        let trees = self.trees.as_ref().expect("a scene was loaded");
        self.engine.run(Some(stage), work, |name| trees.get(name))
    }

    /// Records the stages of the candidate. They precede those of the current tree, because the last `preprocess`
    /// of a submission determines its counts of inactive and degenerate triangles.
    fn record_candidate(&mut self, params: Params) -> Result<()> {
        let (intersector, engine) = (self.intersector, &mut self.engine);
        let trees = self.trees.as_mut().expect("a scene was loaded");
        let tree = trees.candidate.as_mut().expect("it was loaded");
        let (work, _) = tree.progress.preprocess(intersector, params, &tree.shape);
        engine.run(Some(Stage::Preprocess), &work, |name| tree.get(name))?;
        tree.progress.preprocessed(&tree.shape);
        let work = tree.progress.refit(params, &tree.shape);
        engine.run(Some(Stage::Refit), &work, |name| tree.get(name))?;
        engine.frames.recorder.tree_stages.evaluated_candidate = true;
        Ok(())
    }

    /// Returns whether the current tree was built on the device from the current positions. Its triangle records and
    /// boxes are then up to date. Panics if it was built on the device from other positions.
    fn is_built_at_pose(&self) -> bool {
        let built_on_device = self.trees().built_on_device;
        let is_stale = built_on_device && self.engine.next_stage < NextStage::Trace;
        assert!(!is_stale, "new positions require a rebuild of the tree");
        built_on_device
    }

    /// Records the build of a tree. See [`shaders::rebuild`].
    fn build_tree(&mut self, generation: Generation) -> Result<()> {
        let animation = Arc::clone(&self.engine.scene().animation);
        let shape = Shape::built_on_device(animation.live_count() as u32);
        let trees = self.trees.as_mut().expect("a scene was loaded");
        let engine = &mut self.engine;
        if trees.build.is_none() {
            let kernels = build_kernels(self.intersector);
            engine.pipelines.prepare(&engine.gpu, kernels)?;
            trees.allocate_build(&mut engine.gpu)?;
        }
        trees
            .current
            .grow(&engine.gpu, &mut engine.frames, &shape)?;
        let params = Params::of(animation.scale_exponent(), &shape);
        let tree_stages = &mut engine.frames.recorder.tree_stages;
        tree_stages.skipped_degenerate = Some(0);
        tree_stages.summed_areas = true;
        let sort = rebuild::sort(params, animation.vertex_count(), &shape);
        engine.run(Some(Stage::Rebuild), &sort, |name| trees.get(name))?;
        let leaves = rebuild::leaves(self.intersector, params, &shape);
        engine.run(Some(Stage::Preprocess), &[leaves], |name| trees.get(name))?;
        let cluster = rebuild::cluster(params, &shape);
        engine.run(Some(Stage::Rebuild), &cluster, |name| trees.get(name))?;
        (trees.current.generation, trees.current.shape) = (generation, shape);
        trees.built_on_device = true;
        Ok(())
    }
}

impl<D: GpuDevice> Drop for ComputeBackend<D> {
    fn drop(&mut self) {
        // The engine closes the device, so drop all other buffers first. An error means that the device is lost; there
        // is nothing to wait for.
        let _ = self.engine.gpu.wait(None);
        self.trees = None;
    }
}

/// Returns the kernels that build trees for this intersector.
fn build_kernels(intersector: Intersector) -> impl Iterator<Item = &'static Kernel> {
    let makes = move |k: &&Kernel| k.builds_trees() && k.serves(intersector);
    KERNELS.iter().filter(makes)
}

impl<D: GpuDevice> Backend for ComputeBackend<D> {
    fn device(&self) -> &Device {
        &self.engine.info.device
    }

    fn memory(&self) -> MemoryUse {
        let trees = self.trees.as_ref().map_or([0; 3], TreeBuffers::held);
        MemoryUse {
            held: Some(self.engine.bytes(trees)),
            available: self.engine.info.free_bytes,
        }
    }

    fn load(&mut self, animation: Arc<Animation>, intersector: Intersector) -> Result<()> {
        let engine = &mut self.engine;
        let usual = KERNELS.iter().filter(|k| k.loads_with_scene);
        let usual = usual.filter(|k| k.serves(intersector));
        let copies = engine.info.copies_points.then(|| common("copy_points"));
        let streamed = work::range_kernels(intersector).chain(copies);
        let streamed = streamed.filter(|_| animation.is_streamed());
        engine.pipelines.begin(&engine.gpu, usual.chain(streamed));
        engine.unload()?;
        self.trees = None;
        let trees = TreeBuffers::new(&mut engine.gpu, &animation, intersector)?;
        engine.load(animation)?;
        (self.trees, self.intersector) = (Some(trees), intersector);
        Ok(())
    }

    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        self.require_later(generation);
        let Engine { gpu, frames, .. } = &mut self.engine;
        let is_between = frames.recorder.is_empty();
        assert!(is_between, "trees are adopted between submissions");
        let trees = self.trees.as_mut().expect("a scene was loaded");
        trees.adopt(gpu, frames, tree, generation)?;
        self.engine.next_stage = self.engine.next_stage.min(NextStage::Preprocess);
        Ok(())
    }

    fn evaluate(&mut self, tree: &Topology, generation: Generation) -> Result<bool> {
        self.require(NextStage::Preprocess, "call `interpolate` first");
        self.require_later(generation);
        let Engine { gpu, frames, .. } = &mut self.engine;
        let trees = self.trees.as_mut().expect("a scene was loaded");
        let loaded = trees.load_candidate(gpu, frames, tree, generation)?;
        let Some(shape) = loaded.map(|candidate| candidate.shape.clone()) else {
            return Ok(false);
        };
        let params = self.params_of(&shape, self.engine.pose);
        let recorded = self.record_candidate(params);
        if recorded.is_err() {
            self.trees_mut().abandon_candidate();
        }
        recorded.map(|()| true)
    }

    fn tree_writer(&mut self, generation: Generation) -> Result<Option<TreeWriter>> {
        let trees = self.trees.as_mut().expect("a scene was loaded");
        trees.writer(&mut self.engine.gpu, generation)
    }

    fn upload_tree(&mut self, tree: &Topology, generation: Generation) -> Result<bool> {
        let (gpu, trees) = (&mut self.engine.gpu, self.trees.as_mut());
        let trees = trees.expect("a scene was loaded");
        let upload_value = trees.send(gpu, tree, generation)?;
        gpu.has_finished(PendingWork::Use(LastUse::by_upload(upload_value)))
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        let animation = &self.engine.scene().animation;
        self.range = animation.known_range(pose);
        let vertices = animation.vertex_count();
        let params = self.params_at(pose);
        let measure = work::measure_range(self.intersector, params, vertices);
        self.engine.interpolate(pose, params, measure)
    }

    fn preprocess(&mut self) -> Result<()> {
        self.require(NextStage::Preprocess, "call `interpolate` first");
        let generation = self.trees().current.generation;
        assert!(generation > Generation(0), "there is no tree yet");
        if self.is_built_at_pose() {
            return Ok(());
        }
        let (params, tree) = (self.params(), &self.trees().current);
        let progress = &tree.progress;
        // `skipped_degenerate` counts zero-area triangles that this `preprocess` skips; the report adds them.
        let (work, skipped_degenerate) = progress.preprocess(self.intersector, params, &tree.shape);
        self.run(Stage::Preprocess, &work)?;
        self.engine.frames.recorder.tree_stages.skipped_degenerate = Some(skipped_degenerate);
        let tree = &mut self.trees_mut().current;
        tree.progress.preprocessed(&tree.shape);
        self.engine.next_stage = NextStage::Refit;
        Ok(())
    }

    fn refit(&mut self) -> Result<()> {
        self.require(NextStage::Refit, "call `preprocess` first");
        if self.is_built_at_pose() {
            return Ok(());
        }
        let (params, tree) = (self.params(), &self.trees().current);
        let work = tree.progress.refit(params, &tree.shape);
        self.run(Stage::Refit, &work)?;
        self.engine.frames.recorder.tree_stages.summed_areas = true;
        self.trees_mut().current.progress.refitted();
        self.engine.next_stage = NextStage::Trace;
        Ok(())
    }

    fn rebuild(&mut self, generation: Generation) -> Result<()> {
        self.require(NextStage::Preprocess, "call `interpolate` first");
        self.require_later(generation);
        self.engine
            .info
            .device
            .capabilities
            .device_rebuild
            .clone()?;
        self.engine.next_stage = self.engine.next_stage.min(NextStage::Preprocess);
        self.build_tree(generation)?;
        self.engine.next_stage = NextStage::Trace;
        Ok(())
    }

    fn trace(&mut self, queries: &[Query<'_>]) -> Result<()> {
        let mut all = queries.iter().enumerate();
        let mut traced =
            all.try_for_each(|(index, query)| self.trace_one_of(query, index, queries.len()));
        if let (Ok(()), [query]) = (&traced, queries) {
            let params = self.params();
            traced = self.engine.shade(query, params);
        }
        if traced.is_err() {
            self.engine.frames.refuse_pending();
        }
        traced
    }

    fn prepare(&mut self, query: Query<'_>, builds_trees: bool) {
        let rays = ray_source(&query);
        let animation = &self.engine.scene().animation;
        let leaves = animation.live_count() as u32;
        let range = animation.known_range(Pose::default());
        let shape = if builds_trees {
            Shape::built_on_device(leaves)
        } else {
            Shape::expected(leaves)
        };
        let input = TraceInput {
            intersector: self.intersector,
            params: Params::of(animation.scale_exponent(), &shape).with_range(range),
            rays,
            kind: query.kind,
        };
        let engine = &mut self.engine;
        let tracing = work::trace(input, engine.pipelines.traits);
        let shadow = tracing.shadow.iter().flatten();
        let trace = tracing.primary.iter().chain(shadow).map(|w| w.kernel);
        let trees = build_kernels(self.intersector).filter(|_| builds_trees);
        let shade = engine.scene().has_palette().then(|| common("shade"));
        let all: Vec<_> = trace.chain(trees).chain(shade).collect();
        engine.pipelines.begin(&engine.gpu, all);
    }

    fn load_palette(&mut self, palette: &Palette) -> Result<bool> {
        let Engine {
            scene, gpu, frames, ..
        } = &mut self.engine;
        let scene = scene.as_mut().expect("a scene was loaded");
        frames.drop_when_unused(scene.load_palette(gpu, palette)?);
        Ok(true)
    }

    fn pixels(&mut self, ticket: Ticket, out: &mut Vec<u8>) -> Result<bool> {
        self.engine.wait(ticket)?;
        let trace = self.engine.frames.trace(ticket, 0);
        trace.fetch_pixels(&mut self.engine.gpu, out)
    }

    fn request_positions(&mut self) -> Result<()> {
        self.require(NextStage::Preprocess, "call `interpolate` first");
        let engine = &mut self.engine;
        let scene = engine.scene.as_mut().expect("a scene was loaded");
        scene.make_positions(&mut engine.gpu)?;
        engine.snapshots.request(engine.position);
        engine.frames.recorder.split();
        Ok(())
    }

    fn submit(&mut self) -> Result<Ticket> {
        let submitted = self.engine.submit();
        if submitted.is_ok() {
            self.trees_mut().recording_submitted();
        } else {
            self.trees_mut().recording_dropped();
            self.engine.abandon();
        }
        submitted
    }

    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        self.engine.wait(ticket)
    }

    fn take_hits(&mut self, ticket: Ticket, index: usize, hits: &mut Hits) -> Result<()> {
        self.engine.take_hits(ticket, index, hits)
    }

    fn is_done(&mut self, ticket: Ticket) -> Result<bool> {
        let Engine { frames, gpu, .. } = &self.engine;
        frames.is_done(gpu, ticket)
    }

    fn retain_traces(&mut self, tickets: &[Ticket]) {
        self.engine.frames.retain(tickets);
    }

    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        let vertices = self.engine.scene().animation.vertex_count();
        let Engine { snapshots, gpu, .. } = &mut self.engine;
        snapshots.take(gpu, vertices)
    }
}
