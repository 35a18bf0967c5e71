//! State and operations that every kind of frame needs.

use crate::device::read_all;
use crate::snapshots::Snapshots;
use crate::{AnimationBuffers, BufferTable, DeviceInfo, Frames, GpuDevice, Pipelines, Stage};
use backend::{
    Arithmetic, BackendError, DeviceBytes, FrameReport, Hits, Query, Rays, Result, Ticket,
};
use geom::{Animation, Pose};
use shaders::arithmetic;
use shaders::work::{self, Work};
use shaders::{BufferName, Kernel, Params, Traits};
use std::sync::Arc;

/// The first stage that must run before the next trace. All later stages must run too.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NextStage {
    /// `interpolate`.
    Interpolate,
    /// `preprocess`.
    Preprocess,
    /// `refit`.
    Refit,
    /// None: the trace itself.
    Trace,
}

/// A device with a scene, its positions, submissions and traces. The backend that owns the engine implements trees and
/// traversal.
///
/// Stages are timed by the device's timestamps. Without timestamps, each stage's time is `None`. Then `device_ms` is the
/// host's time from the submission until its end was noticed.
pub struct Engine<D: GpuDevice> {
    /// Properties of the device, with the arithmetic that was tested.
    pub info: DeviceInfo,
    /// Submissions and their results.
    pub frames: Frames<D>,
    pub(crate) snapshots: Snapshots,
    /// The loaded scene.
    pub scene: Option<AnimationBuffers<D>>,
    /// Index of the current position buffer.
    pub position: usize,
    /// Pose of the current positions.
    pub pose: Pose,
    /// Stages that must run before a trace.
    pub next_stage: NextStage,
    /// Compiled kernels.
    pub pipelines: Pipelines<D>,
    /// The device itself.
    pub gpu: D,
}

impl<D: GpuDevice> Engine<D> {
    /// Compiles kernels and tests the device's arithmetic with one of them.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] if the arithmetic is wrong. The device's own error if it rejects a kernel.
    pub fn new(mut gpu: D, kernels: impl IntoIterator<Item = &'static Kernel>) -> Result<Self> {
        let mut pipelines = Pipelines::of(&gpu, kernels)?;
        let mut frames = Frames::new(&gpu);
        let (arithmetic, fma_rounds_once) = test_arithmetic(&mut gpu, &mut frames, &pipelines)?;
        let mut info = gpu.info();
        info.device.arithmetic = arithmetic;
        pipelines.traits = Traits {
            fma_rounds_once,
            packets: info.packets,
            rasterizes: info.rasterizes,
        };
        Ok(Self::with(gpu, info, frames, pipelines))
    }

    fn with(gpu: D, info: DeviceInfo, frames: Frames<D>, pipelines: Pipelines<D>) -> Self {
        Self {
            info,
            frames,
            snapshots: Snapshots::default(),
            scene: None,
            position: 0,
            pose: Pose::default(),
            next_stage: NextStage::Interpolate,
            pipelines,
            gpu,
        }
    }

    /// Returns a function that creates another engine on the same device. It reuses the test results and compiled
    /// kernels.
    pub fn share_device(&self) -> impl FnOnce() -> Result<Self> + Send + use<D> {
        let (info, pipelines) = (self.info.clone(), self.pipelines.shared());
        let open = self.gpu.share_device();
        move || {
            let gpu = open()?;
            let frames = Frames::new(&gpu);
            Ok(Self::with(gpu, info, frames, pipelines))
        }
    }

    /// Returns the loaded scene.
    ///
    /// # Panics
    /// If no scene is loaded. The same applies to all other methods that need a scene.
    pub fn scene(&self) -> &AnimationBuffers<D> {
        self.scene.as_ref().expect("a scene was loaded")
    }

    /// Drops the recording, waits for unfinished submissions, and frees the scene.
    pub fn unload(&mut self) -> Result<()> {
        self.abandon();
        self.frames.unload(&mut self.gpu)?;
        self.snapshots = Snapshots::default();
        (self.scene, self.position) = (None, 0);
        Ok(())
    }

    /// Makes an animation current. The previous one must have been unloaded.
    pub fn load(&mut self, animation: Arc<Animation>) -> Result<()> {
        self.scene = Some(AnimationBuffers::new(&mut self.gpu, animation)?);
        Ok(())
    }

    /// Records the interpolation of positions at `pose`. `params` contains the blend weight. The interpolation may run
    /// concurrently with the dispatch `measure`, which measures the coordinate range of the pose's first key frame.
    pub fn interpolate(&mut self, pose: Pose, params: Params, measure: Option<Work>) -> Result<()> {
        self.next_stage = NextStage::Interpolate;
        let gpu = &mut self.gpu;
        let (position, overwritten) = self.snapshots.position_to_write(gpu, self.position)?;
        self.frames.recorder.overwrites(overwritten);
        (self.position, self.pose) = (position, pose);
        let scene = self.scene.as_mut().expect("a scene was loaded");
        let last = self.frames.submitted;
        let upload_value = scene.keys.upload_pose(gpu, &scene.animation, pose, last)?;
        self.frames.await_upload(upload_value);
        self.copy_points()?;
        let scene = self.scene();
        let (vertices, rows) = (scene.animation.vertex_count(), scene.moving_row_count);
        let mut interpolate = work::interpolate(params, vertices, rows);
        if let Some(measure) = measure {
            self.run(None, &[measure], |_| None)?;
            interpolate.alongside = true;
        }
        self.run(Some(Stage::Interpolate), &[interpolate], |_| None)?;
        self.next_stage = NextStage::Preprocess;
        Ok(())
    }

    /// Records the copies of positions from buffers of the calling program.
    fn copy_points(&mut self) -> Result<()> {
        for copy in std::mem::take(&mut self.gpu.lent().copies) {
            let words = |bytes: u64| bytes as usize / 4;
            let ((from, start), (to, place)) = (copy.from, copy.to);
            let work = work::copy_points(words(copy.bytes), [start, place].map(words));
            self.run(None, &[work], |name| match name {
                BufferName::CopySource => Some(&from),
                BufferName::KeyFrame => Some(&to),
                _ => None,
            })?;
        }
        Ok(())
    }

    /// Records dispatches, and then the end of `stage`. Without a stage, they are timed as part of the next stage that
    /// ends. Compiles missing kernels. `own` returns buffers that do not belong to the scene, or that replace the
    /// scene's.
    ///
    /// # Panics
    /// If no buffer exists for a name in a kernel.
    pub fn run<'a>(
        &mut self,
        stage: Option<Stage>,
        work: &[Work],
        own: impl Fn(BufferName) -> Option<&'a D::Buffer>,
    ) -> Result<()>
    where
        D: 'a,
    {
        let kernels = work.iter().map(|w| w.kernel);
        self.pipelines.prepare(&self.gpu, kernels)?;
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let pipelines = &self.pipelines;
        let (key, position) = (self.pose.key, self.position);
        let find = |name: BufferName| -> &D::Buffer {
            let found = own(name).or_else(|| scene.get(name, key, position));
            found.unwrap_or_else(|| panic!("no buffer {name:?}"))
        };
        self.frames.recorder.record(pipelines, stage, work, find)
    }

    /// Records the shading of the pending trace of `query`. Does nothing unless `query` has a camera and a light, and
    /// there is a palette.
    ///
    /// # Panics
    /// If no trace is pending.
    pub fn shade(&mut self, query: &Query<'_>, params: Params) -> Result<()> {
        let pending = self.frames.pending.pop();
        let mut trace = pending.expect("a trace is recorded");
        let shaded = match (query.rays, query.kind.light()) {
            (Rays::Camera(camera), Some(lamp)) if self.scene().has_palette() => {
                let work = [work::shade(params, camera, lamp)];
                let made = trace.make_pixels(&self.gpu);
                made.and_then(|()| self.run(None, &work, |name| trace.get(name)))
            }
            _ => Ok(()),
        };
        self.frames.pending.push(trace);
        shaded
    }

    /// Submits the recording.
    pub fn submit(&mut self) -> Result<Ticket> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let never_active = scene.animation.triangle_count() - scene.animation.live_count();
        self.frames.recorder.tree_stages.never_active = never_active as u64;
        let place = |p: usize| (&scene.positions[p], scene.position_bytes());
        let positions = self.snapshots.requested.map(place);
        let ticket = self.frames.submit(&mut self.gpu, positions)?;
        self.snapshots.submitted(ticket);
        let scene = self.scene.as_mut().expect("a scene was loaded");
        let (keys, gpu) = (&mut scene.keys, &mut self.gpu);
        // `submitted` also uploads the next key frame in advance. The submission already runs, so an error of that
        // upload must not discard it. `interpolate` uploads the key frame again if necessary, and returns the error if
        // it persists.
        let _ = keys.submitted(gpu, &scene.animation, ticket);
        Ok(ticket)
    }

    /// Drops the recording. It will never run, so all data on the device is stale.
    pub fn abandon(&mut self) {
        self.next_stage = NextStage::Interpolate;
        self.frames.abandon();
        self.snapshots.requested = None;
    }

    /// Blocks until a submission has finished and returns its report.
    pub fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        self.frames.retire(&mut self.gpu, ticket)
    }

    /// See [`backend::Backend::take_hits`].
    pub fn take_hits(&mut self, ticket: Ticket, index: usize, hits: &mut Hits) -> Result<()> {
        self.wait(ticket)?;
        let trace = self.frames.trace(ticket, index);
        trace.read_hits(&mut self.gpu, hits)
    }

    /// Returns the bytes of device memory by purpose. The argument contains the bytes that the backend itself
    /// allocated.
    pub fn bytes(&self, [tree, scratch, frames]: [u64; 3]) -> DeviceBytes {
        let memory = self.gpu.memory();
        let scratch = scratch + memory.waiting;
        let scene = self.scene.as_ref().map_or(0, AnimationBuffers::held);
        let frames = match memory.allocated {
            // All other buffers.
            Some(all) => all.saturating_sub(tree + scratch + scene),
            None => frames + self.frames.bytes() + memory.submissions,
        };
        DeviceBytes {
            tree,
            scratch,
            scene,
            frames,
        }
    }
}

impl<D: GpuDevice> Drop for Engine<D> {
    fn drop(&mut self) {
        // An error means that the device is lost; there is nothing to wait for.
        let _ = self.gpu.wait(None);
    }
}

/// Runs the kernel `arithmetic`. Rejects the device if one bit is wrong or its driver ends loops early.
fn test_arithmetic<D: GpuDevice>(
    gpu: &mut D,
    frames: &mut Frames<D>,
    pipelines: &Pipelines<D>,
) -> Result<(Arithmetic, bool)> {
    let all = arithmetic::operands();
    let operands = bytemuck::cast_slice(&all);
    let bytes = size_of_val(operands) as u64;
    let sizes = [
        (BufferName::Operands, bytes),
        (BufferName::Results, 2 * bytes),
    ];
    let buffers = BufferTable::new(gpu, sizes)?;
    buffers.fill(gpu, &[(BufferName::Operands, operands)])?;
    let find = |name| buffers.get(name).expect("the kernel binds no other buffer");
    let work = [work::arithmetic(all.len())];
    frames.recorder.record(pipelines, None, &work, find)?;
    let ticket = frames.submit(gpu, None)?;
    frames.retire(gpu, ticket)?;
    let results = read_all(gpu, find(BufferName::Results), all.len())?;
    let refused = |e| BackendError::NoDevice(format!("{}: {e}", gpu.info().device.adapter));
    arithmetic::verify(&all, &results).map_err(refused)
}
