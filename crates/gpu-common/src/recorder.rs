//! Records stages as commands.

use crate::{
    BoundBuffer, DeviceInfo, Dispatch, GpuDevice, Pipelines, PositionsCopy, RecordedCommand,
    RecordingOf, Stage,
};
use backend::{BackendError, Result, Ticket};
use shaders::work::Work;
use shaders::{BufferName, Counts};
use std::mem::offset_of;

/// Size of the first members of [`Counts`], which `preprocess` increments. If `preprocess` runs again in a submission,
/// these bytes are cleared first, so that the last run determines them.
const LEAF_COUNTS: u64 = offset_of!(Counts, hits) as u64;

/// Records the stages of one submission at a time.
pub struct Recorder<D: GpuDevice> {
    recording: RecordingOf<D>,
    /// Stages that were recorded.
    stages: Vec<Stage>,
    /// Stages without work.
    pub(crate) idle: Vec<Stage>,
    /// Whether `interpolate` was recorded last and its stage is still open, so that `preprocess` may run concurrently.
    open: bool,
    pub(crate) tree_stages: TreeStages,
    max_groups: u32,
    splits: bool,
}

/// Changes of a submission to the tree statistics in reports: the stages that ran, and the triangles that the device
/// does not count.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TreeStages {
    /// Number of zero-area triangles that the last preprocess skipped and did not count. 0 after a build on the device;
    /// `None` if neither ran.
    pub(crate) skipped_degenerate: Option<u32>,
    /// Number of triangles that are inactive in every key frame and therefore in no tree.
    pub(crate) never_active: u64,
    /// Whether a refit or a build summed the areas of boxes.
    pub(crate) summed_areas: bool,
    /// Whether a candidate tree was evaluated next to the current one.
    pub(crate) evaluated_candidate: bool,
}

impl<D: GpuDevice> Recorder<D> {
    pub(crate) fn new(info: &DeviceInfo) -> Self {
        Self {
            recording: RecordingOf::<D>::default(),
            stages: Vec::new(),
            idle: Vec::new(),
            open: false,
            tree_stages: TreeStages::default(),
            max_groups: info.max_groups,
            splits: info.splits,
        }
    }

    /// Returns whether nothing was recorded.
    pub(crate) fn is_empty(&self) -> bool {
        self.recording.commands.is_empty()
    }

    /// Returns whether a recorded dispatch uses the buffer.
    pub(crate) fn uses(&self, buffer: &D::Buffer) -> bool {
        let bound = BoundBuffer::Recorded(D::bind(buffer));
        self.recording.buffers.contains(&bound)
    }

    /// Drops all commands.
    pub(crate) fn abandon(&mut self) {
        self.recording.clear();
        self.open = false;
        self.stages.clear();
        self.idle.clear();
        self.tree_stages = TreeStages::default();
    }

    /// Records dispatches, and then the end of `stage` if there is one. Checks all dispatches before it records the
    /// first one. `interpolate` stays open for kernels that may run concurrently, and is then timed together with them.
    /// A stage without work is reported with a time of 0. If it is the first stage, its end is recorded too, so that
    /// the frame has a first timestamp.
    pub(crate) fn record<'a>(
        &mut self,
        pipelines: &Pipelines<D>,
        stage: Option<Stage>,
        work: &[Work],
        find: impl Fn(BufferName) -> &'a D::Buffer,
    ) -> Result<()> {
        if stage.is_none() || !work.first().is_some_and(|w| w.alongside) {
            self.close();
        }
        if let Some(stage) = stage.filter(|_| work.is_empty() && !self.stages.is_empty()) {
            self.idle.push(stage);
            return Ok(());
        }
        let groups = |w: &Work| groups(w, self.max_groups);
        work.iter().try_for_each(|w| groups(w).map(|_| ()))?;
        let commands = &mut self.recording.commands;
        if stage == Some(Stage::Preprocess) && self.stages.contains(&Stage::Preprocess) {
            commands.push(RecordedCommand::ClearCounts(LEAF_COUNTS));
        }
        for work in work {
            let buffers = &mut self.recording.buffers;
            let first = buffers.len();
            buffers.extend(work.kernel.bindings.iter().map(|b| match b.name {
                BufferName::Params => BoundBuffer::Params,
                BufferName::Counts => BoundBuffer::Counts,
                name => BoundBuffer::Recorded(D::bind(find(name))),
            }));
            commands.push(RecordedCommand::Dispatch(Dispatch {
                work: *work,
                pipeline: pipelines.get(work.kernel),
                buffers: first..buffers.len(),
                groups: groups(work)?,
            }));
        }
        self.open = stage == Some(Stage::Interpolate);
        if let Some(stage) = stage.filter(|_| !self.open) {
            self.end(stage);
        }
        Ok(())
    }

    /// Records a stage of one native command, or of no command.
    pub fn record_native(&mut self, stage: Stage, command: Option<D::Native>) {
        self.close();
        let commands = &mut self.recording.commands;
        commands.extend(command.map(RecordedCommand::Native));
        self.end(stage);
    }

    /// Ends `interpolate` if it is open, because the following work must not run concurrently with it.
    pub(crate) fn close(&mut self) {
        if std::mem::take(&mut self.open) {
            self.end(Stage::Interpolate);
        }
    }

    fn end(&mut self, stage: Stage) {
        self.stages.push(stage);
        self.recording
            .commands
            .push(RecordedCommand::EndStage(stage));
    }

    /// Ends the part of the recording that must finish before positions are copied to the host.
    pub(crate) fn split(&mut self) {
        if self.splits {
            self.close();
            self.recording.commands.push(RecordedCommand::Split);
        }
    }

    /// Makes the recording wait for the copy of positions that a submission requested, because it overwrites them.
    pub(crate) fn overwrites(&mut self, positions_of: Option<Ticket>) {
        self.recording.overwrites = self.recording.overwrites.max(positions_of);
    }

    /// Sets the positions to copy to the host and the upload to wait for. Returns the recording.
    pub(crate) fn complete(
        &mut self,
        positions: Option<(&D::Buffer, u64)>,
        after_upload: u64,
    ) -> &mut RecordingOf<D> {
        self.recording.positions = positions.map(|(from, bytes)| PositionsCopy {
            from: D::bind(from),
            bytes,
        });
        self.recording.after_upload = after_upload;
        &mut self.recording
    }
}

fn groups(work: &Work, limit: u32) -> Result<[u32; 2]> {
    let refused = |need: u32| BackendError::Limit {
        what: format!("kernel {} (workgroups along an axis)", work.kernel.name),
        need: need.into(),
        limit: limit.into(),
    };
    work.group_counts(limit).map_err(refused)
}
