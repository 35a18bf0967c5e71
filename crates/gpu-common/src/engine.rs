//! What frames of any kind take of a device.

use crate::snapshots::Snapshots;
use crate::{BufferTable, Frames, GpuDevice, Pipelines, SceneBuffers, Stage};
use backend::{
    Arithmetic, BackendError, Device, DeviceBytes, FrameReport, Hits, Palette, Query, Rays, Result,
    Snapshot, Ticket,
};
use geom::{Animation, Point, Pose};
use shaders::arithmetic;
use shaders::work::{self, Work};
use shaders::{BufferName, Kernel, Params, Traits};
use std::sync::Arc;

/// What must run before a trace.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stale {
    /// `interpolate`, and all that follows.
    Positions,
    /// `preprocess`, likewise.
    Records,
    /// `refit`.
    Boxes,
    /// Nothing.
    Fresh,
}

/// A device with a scene, its positions, submissions and traces. What trees are and how rays go down them is for the owner
/// to say.
///
/// Stages are timed by the device's clock; where it has none, each stage's time is `None` and `device_ms` is the host's,
/// from the submission to the moment its end was seen.
pub struct Engine<D: GpuDevice> {
    /// Who is at work.
    pub device: Device,
    /// Submissions, and what they found.
    pub frames: Frames<D>,
    snapshots: Snapshots<D>,
    /// The scene, once one is loaded.
    pub scene: Option<SceneBuffers<D>>,
    /// Which position buffer is current.
    pub position: usize,
    /// The moment that positions were last interpolated at.
    pub pose: Pose,
    /// What must run before a trace.
    pub stale: Stale,
    /// Kernels ready to be bound.
    pub pipelines: Pipelines<D>,
    /// The device itself.
    pub gpu: D,
}

impl<D: GpuDevice> Engine<D> {
    /// Makes kernels ready, and puts the device's arithmetic to the test by one of them.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] if it is wrong, or the driver refuses a kernel.
    pub fn new(mut gpu: D, kernels: impl IntoIterator<Item = &'static Kernel>) -> Result<Self> {
        let mut pipelines = Pipelines::of(&gpu, kernels)?;
        let mut frames = Frames::new(&gpu)?;
        let (arithmetic, fuses_once) = test_arithmetic(&mut gpu, &mut frames, &pipelines)?;
        let device = Device {
            arithmetic,
            ..gpu.device()
        };
        let (packets, rasterizes) = gpu.forms();
        pipelines.traits = Traits {
            fuses_once,
            packets,
            rasterizes,
        };
        Ok(Self::with((gpu, device), frames, pipelines))
    }

    /// Without a scene.
    fn with((gpu, device): (D, Device), frames: Frames<D>, pipelines: Pipelines<D>) -> Self {
        Self {
            device,
            frames,
            snapshots: Snapshots::default(),
            scene: None,
            position: 0,
            pose: Pose::default(),
            stale: Stale::Positions,
            pipelines,
            gpu,
        }
    }

    /// What makes another on the same device, whose arithmetic is known and whose kernels stay ready.
    pub fn another(&self) -> impl FnOnce() -> Result<Self> + Send + use<D> {
        let device = self.device.clone();
        let (maker, pipelines) = (self.gpu.pipeline_maker(), self.pipelines.ready());
        move || {
            let gpu = D::beside(maker)?;
            let frames = Frames::new(&gpu)?;
            Ok(Self::with((gpu, device), frames, pipelines))
        }
    }

    /// The scene.
    ///
    /// # Panics
    /// Before one is loaded; likewise all that follows but for [`Engine::unload`].
    pub fn scene(&self) -> &SceneBuffers<D> {
        self.scene.as_ref().expect("a scene was loaded")
    }

    /// Drops what was recorded, waits for what is under way, and lets go of the scene.
    pub fn unload(&mut self) -> Result<()> {
        self.abandon();
        self.give_up_dropped();
        self.frames.unload(&mut self.gpu)?;
        self.snapshots = Snapshots::default();
        (self.scene, self.position) = (None, 0);
        Ok(())
    }

    /// Makes an animation current. The last one must have been let go of.
    pub fn load(&mut self, animation: Arc<Animation>) -> Result<()> {
        self.scene = Some(SceneBuffers::new(&mut self.gpu, animation)?);
        Ok(())
    }

    /// Records key frames to positions, after what is to look at the earlier one. `params` has the pose's weight.
    pub fn interpolate(&mut self, pose: Pose, params: Params, measure: Option<Work>) -> Result<()> {
        let gpu = &mut self.gpu;
        self.position = self.snapshots.position_to_write(gpu, self.position)?;
        self.pose = pose;
        let scene = self.scene.as_mut().expect("a scene was loaded");
        let last = self.frames.submitted;
        scene.keys.bring(gpu, (&scene.animation, pose), last)?;
        self.copy_points()?;
        let scene = self.scene();
        let (vertices, rows) = (scene.animation.vertex_count(), scene.moving_row_count);
        let mut interpolate = work::interpolate(params, vertices, rows);
        if let Some(measure) = measure {
            self.run(None, &[measure], |_| None)?;
            interpolate.alongside = true;
        }
        self.run(Some(Stage::Interpolate), &[interpolate], |_| None)?;
        self.stale = Stale::Records;
        Ok(())
    }

    /// Records copies of what the device's owner has there.
    fn copy_points(&mut self) -> Result<()> {
        for copy in self.gpu.take_copies() {
            let words = |bytes: u64| bytes as usize / 4;
            let ((from, start), (to, place)) = (copy.from, copy.to);
            let work = work::copy_points(words(copy.bytes), [start, place].map(words));
            self.run(None, &[work], |name| match name {
                BufferName::Lent => Some(&from),
                BufferName::KeyFrame => Some(&to),
                _ => None,
            })?;
        }
        Ok(())
    }

    /// Records kernels, as a stage or as part of none, and makes those that are not ready yet. `own` gives buffers that are not
    /// the scene's, or stand in place of these.
    ///
    /// # Panics
    /// If a kernel names a buffer that nobody has.
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
        let slot = self.frames.record()?;
        slot.record(pipelines, stage, work, &find)
    }

    /// Records the picture of the pending trace, which `query` asked for, if there is a palette and a tree was traced.
    ///
    /// # Panics
    /// If no trace is pending.
    pub fn shade(&mut self, query: &Query<'_>, params: Params) -> Result<()> {
        let pending = self.frames.pending.pop();
        let mut trace = pending.expect("a trace is recorded");
        let is_shaded = trace.has_tree && self.scene().has_palette();
        let shaded = match (query.rays, query.kind.light()) {
            (Rays::Camera(camera), Some(lamp)) if is_shaded => {
                let work = [work::shade(params, camera, lamp)];
                let made = trace.make_pixels(&self.gpu);
                made.and_then(|()| self.run(None, &work, |name| trace.get(name)))
            }
            _ => Ok(()),
        };
        self.frames.pending.push(trace);
        shaded
    }

    /// Takes what pictures are painted by.
    pub fn load_palette(&mut self, palette: &Palette) -> Result<()> {
        let scene = self.scene.as_mut().expect("a scene was loaded");
        scene.load_palette(&mut self.gpu, palette)
    }

    /// Waits for a submission and copies its pixels, if there are any.
    pub fn pixels(&mut self, ticket: Ticket, out: &mut Vec<u8>) -> Result<bool> {
        self.wait(ticket)?;
        let trace = self.frames.trace(ticket, 0);
        trace.fetch_pixels(&mut self.gpu, out)
    }

    /// Records that the positions go to the host: as soon as they are made, beside what is recorded from here on.
    pub fn request_positions(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Records, "positions come first");
        let scene = self.scene.as_mut().expect("a scene was loaded");
        scene.make_positions(&mut self.gpu)?;
        self.snapshots.request(self.position);
        self.frames.record()?.split()
    }

    /// Submits what was recorded. So many triangles are in no tree, and count as inactive.
    pub fn submit(&mut self, never_active: u64) -> Result<Ticket> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let place = |p: usize| (&scene.positions[p], scene.position_bytes());
        let positions = self.snapshots.requested.map(place);
        let submitted = self.frames.submit(&mut self.gpu, positions, never_active);
        let (ticket, copy) = submitted?;
        self.snapshots.submitted(ticket, copy);
        let scene = self.scene.as_mut().expect("a scene was loaded");
        let (keys, gpu) = (&mut scene.keys, &mut self.gpu);
        keys.submitted(gpu, &scene.animation, ticket)?;
        Ok(ticket)
    }

    /// Forgets submissions whose commands the program dropped, and returns their tickets. Nothing on the device is up to date
    /// then, because later submissions build on earlier ones.
    pub fn give_up_dropped(&mut self) -> Vec<Ticket> {
        let dropped = self.frames.give_up_dropped(&mut self.gpu);
        if !dropped.is_empty() {
            self.abandon();
            self.snapshots.give_up(&dropped);
        }
        dropped
    }

    /// Drops what was recorded: it is not going to be submitted, so nothing on the device is up to date.
    pub fn abandon(&mut self) {
        self.stale = Stale::Positions;
        self.frames.abandon();
        self.snapshots.requested = None;
    }

    /// Waits for a submission and says what it did.
    pub fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        self.frames.retire(&mut self.gpu, ticket)
    }

    /// Waits for a submission and lends what its trace of that place found.
    pub fn hits(&mut self, ticket: Ticket, place: usize) -> Result<&mut Hits> {
        self.wait(ticket)?;
        self.frames.trace(ticket, place).fetch(&mut self.gpu)
    }

    /// See [`backend::Backend::take_hits`].
    pub fn take_hits(&mut self, ticket: Ticket, place: usize, into: &mut Hits) -> Result<()> {
        self.wait(ticket)?;
        let trace = self.frames.trace(ticket, place);
        trace.take(&mut self.gpu, into)
    }

    /// See [`backend::Backend::is_done`].
    pub fn is_done(&self, ticket: Ticket) -> Result<bool> {
        self.frames.is_done(&self.gpu, ticket)
    }

    /// See [`backend::Backend::release`].
    pub fn release(&mut self, ticket: Ticket) {
        self.frames.release(ticket);
    }

    /// See [`backend::Backend::keep`].
    pub fn keep(&mut self, traces: usize) {
        self.frames.keep(traces);
    }

    /// The oldest positions requested, if they have arrived.
    pub fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        let vertices = self.scene().animation.vertex_count();
        self.snapshots.take(&mut self.gpu, vertices)
    }

    /// Bytes of device memory, of which so much is a tree's, room to make one, and its owner's for frames.
    pub fn bytes(&self, [tree, scratch, frames]: [u64; 3]) -> DeviceBytes {
        let bytes = DeviceBytes {
            tree,
            scratch,
            scene: self.scene.as_ref().map_or(0, SceneBuffers::held),
            frames: frames + self.frames.bytes(),
        };
        self.gpu.with_own_bytes(bytes)
    }

    /// Waits for all submissions and reads the current positions.
    pub fn positions(&mut self) -> Result<Vec<Point>> {
        self.gpu.wait_idle()?;
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let count = scene.animation.vertex_count();
        let from = &scene.positions[self.position];
        self.gpu.read_all(from, count)
    }
}

impl<D: GpuDevice> Drop for Engine<D> {
    fn drop(&mut self) {
        // A lost device has nothing to wait for.
        let _ = self.gpu.wait_idle();
    }
}

/// Runs the kernel `arithmetic` and refuses the device if one bit is wrong or its driver ends loops early.
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
    let find = |name| buffers.get(name).expect("it names no other buffer");
    let work = [work::arithmetic(all.len())];
    let slot = frames.record()?;
    slot.record(pipelines, None, &work, &find)?;
    let (ticket, _) = frames.submit(gpu, None, 0)?;
    frames.retire(gpu, ticket)?;
    let results = gpu.read_all(find(BufferName::Results), all.len())?;
    let adapter = gpu.device().adapter;
    arithmetic::verify(&all, &results)
        .map_err(|e| BackendError::NoDevice(format!("{adapter}: {e}")))
}
