//! What one submission needs for itself: commands, parameters, marks of time, counts.

use crate::clock::{Marks, Stage};
use crate::commands::{ALL, COPIES, Commands, HOST, KERNELS};
use crate::device::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::pages::{Bound, Pages};
use crate::pipelines::{Pipeline, Pipelines};
use ash::vk;
use backend::Result;
use shaders::work::Work;
use shaders::{Counts, Extents};
use std::mem::offset_of;
use std::sync::Arc;
use std::time::Instant;

/// Used by one submission at a time.
pub(crate) struct Slot {
    commands: Commands,
    pages: Pages,
    marks: Marks,
    stages: Vec<Stage>,
    /// Whether `interpolate` was recorded last, and has no end yet: `preprocess` may run beside it.
    open: bool,
    counts: Buffer,
    counts_back: Buffer,
    pub(crate) readback_bytes: u64,
    pub(crate) extents: Extents,
    /// When the recording was submitted.
    pub(crate) sent: Option<Instant>,
    gpu: Arc<Gpu>,
}

/// What a finished submission left behind.
pub(crate) struct Done<'a> {
    pub(crate) stages: &'a [Stage],
    pub(crate) marks: Vec<u64>,
    pub(crate) counts: Counts,
}

const COUNTS: u64 = size_of::<Counts>() as u64;
/// Bytes of what `preprocess` counts: it may run more than once a submission.
const LEAF_COUNTS: u64 = offset_of!(Counts, hits) as u64;

impl Slot {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            commands: Commands::new(gpu, gpu.compute.family)?,
            pages: Pages::new(gpu),
            marks: Marks::new(gpu),
            stages: Vec::new(),
            open: false,
            counts: Buffer::new(gpu, "counts", COUNTS, BufferUse::Device)?,
            counts_back: Buffer::new(gpu, "counts", COUNTS, BufferUse::Readback)?,
            readback_bytes: 0,
            extents: Extents::default(),
            sent: None,
            gpu: Arc::clone(gpu),
        })
    }

    /// Starts a new recording. The slot's last submission must be finished.
    pub(crate) fn begin(&mut self) -> Result<()> {
        self.stages.clear();
        self.marks.reset();
        (self.readback_bytes, self.sent, self.open) = (0, None, false);
        self.extents = Extents::default();
        self.pages.reset()?;
        self.commands.reset()?;
        self.commands.begin()?;
        let all = self.gpu.reach();
        self.commands.barrier(all, all);
        self.clear_counts(COUNTS);
        self.marks.mark(self.commands.vk())
    }

    fn clear_counts(&self, bytes: u64) {
        let commands = self.commands.vk();
        let bytes = bytes.min(self.counts.bytes);
        // SAFETY: the command buffer is being recorded; the buffer belongs to the slot.
        unsafe {
            self.gpu
                .vk
                .cmd_fill_buffer(commands, self.counts.vk, 0, bytes, 0);
        }
        self.commands.barrier(COPIES, KERNELS);
    }

    /// Records a stage; `find` gives buffers by their names in the kernels.
    /// What cannot be recorded is refused before anything is. `interpolate` stays open for what may run beside it,
    /// and is then timed with that.
    pub(crate) fn record<'a>(
        &mut self,
        pipelines: &Pipelines,
        stage: Stage,
        work: &[Work],
        find: impl Fn(&'static str) -> &'a Buffer,
    ) -> Result<()> {
        if !work.first().is_some_and(|w| w.alongside) {
            self.close()?;
        }
        if stage == Stage::Preprocess && self.stages.contains(&stage) {
            self.commands.barrier(KERNELS, COPIES);
            self.clear_counts(LEAF_COUNTS);
        }
        if work.is_empty() {
            return self.mark(stage);
        }
        self.launch_all(pipelines, work, find)?;
        self.open = stage == Stage::Interpolate;
        match self.open {
            true => Ok(()),
            false => self.end_stage(stage),
        }
    }

    /// Records a stage that is no list of kernels.
    pub(crate) fn record_as(&mut self, stage: Stage, record: impl FnOnce(&Commands)) -> Result<()> {
        self.close()?;
        record(&self.commands);
        self.mark(stage)
    }

    /// Ends `interpolate`, if it is open: what follows is not to run beside it.
    fn close(&mut self) -> Result<()> {
        match std::mem::take(&mut self.open) {
            true => self.end_stage(Stage::Interpolate),
            false => Ok(()),
        }
    }

    /// Ends a stage of kernels: what follows reads what they wrote.
    fn end_stage(&mut self, stage: Stage) -> Result<()> {
        self.commands.barrier(KERNELS, KERNELS);
        self.mark(stage)
    }

    fn mark(&mut self, stage: Stage) -> Result<()> {
        self.stages.push(stage);
        self.marks.mark(self.commands.vk())
    }

    /// Records kernels that belong to no stage, and a barrier behind them.
    pub(crate) fn dispatch<'a>(
        &mut self,
        pipelines: &Pipelines,
        all: &[Work],
        find: impl Fn(&'static str) -> &'a Buffer,
    ) -> Result<()> {
        self.close()?;
        self.launch_all(pipelines, all, find)?;
        self.commands.barrier(KERNELS, KERNELS);
        Ok(())
    }

    /// Records kernels, each after what those before wrote, unless it reads none of that; but no barrier behind all.
    fn launch_all<'a>(
        &mut self,
        pipelines: &Pipelines,
        all: &[Work],
        find: impl Fn(&'static str) -> &'a Buffer,
    ) -> Result<()> {
        let groups = all.iter().map(|w| self.gpu.limits.groups(w));
        let groups = groups.collect::<Result<Vec<_>>>()?;
        let mut last: Option<Bound> = None;
        for (i, (work, groups)) in all.iter().zip(groups).enumerate() {
            let pipeline = pipelines.get(work.kernel);
            let row = self.pages.row(&work.params)?;
            let find = |name| match name {
                "counts" => &self.counts,
                other => find(other),
            };
            let bound = self.pages.bind(pipeline, row, last, find)?;
            self.launch(pipeline, bound.set, row.offset, groups);
            let next = all.get(i + 1);
            if next.is_some_and(|next| !next.alongside) {
                self.commands.barrier(KERNELS, KERNELS);
            }
            last = Some(bound);
        }
        Ok(())
    }

    fn launch(&self, pipeline: &Pipeline, set: vk::DescriptorSet, row: u32, [x, y]: [u32; 2]) {
        let (vk, commands) = (&self.gpu.vk, self.commands.vk());
        let point = vk::PipelineBindPoint::COMPUTE;
        // SAFETY: the command buffer is being recorded; pipeline and set belong to the device and match.
        unsafe {
            vk.cmd_bind_pipeline(commands, point, pipeline.vk);
            vk.cmd_bind_descriptor_sets(commands, point, pipeline.layout, 0, &[set], &[row]);
            vk.cmd_dispatch(commands, x, y, 1);
        }
    }

    /// Ends the first part of the recording, for somebody who waits for that alone, and begins the second.
    pub(crate) fn split(&mut self) -> Result<()> {
        self.close()?;
        self.commands.end()?;
        self.commands.begin()
    }

    /// Ends the recording.
    pub(crate) fn end(&mut self) -> Result<()> {
        self.close()?;
        self.copy_counts();
        self.commands.end()
    }

    /// The parts of the recording, in order.
    pub(crate) fn parts(&self) -> &[vk::CommandBuffer] {
        self.commands.all()
    }

    fn copy_counts(&self) {
        self.commands.barrier(ALL, COPIES);
        let copy = [vk::BufferCopy::default().size(COUNTS)];
        // SAFETY: the command buffer is being recorded; both buffers belong to the slot.
        unsafe {
            self.gpu.vk.cmd_copy_buffer(
                self.commands.vk(),
                self.counts.vk,
                self.counts_back.vk,
                &copy,
            );
        }
        self.commands.barrier(COPIES, HOST);
    }

    /// What was counted when counts were copied last, by a part that is done.
    pub(crate) fn counts(&self) -> Counts {
        self.counts_back.read::<Counts>(1)[0]
    }

    /// What the finished submission left behind.
    pub(crate) fn done(&self) -> Result<Done<'_>> {
        Ok(Done {
            stages: &self.stages,
            marks: self.marks.read()?,
            counts: self.counts(),
        })
    }
}
