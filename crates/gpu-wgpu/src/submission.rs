//! Encodes recordings, with parameters, counts and timestamps.

use crate::buffers::{Mapping, inaccessible, write};
use crate::gpu::{OpenGpu, READBACK, STORAGE, make, unmap};
use crate::launches::{Launch, Launches, WgpuRecording};
use crate::timestamps::{self, PassTimestamps};
use backend::{BackendError, Result, Ticket};
use gpu_common::{Outcome, RecordedCommand, Stage, SubmissionOutput};
use shaders::Counts;
use std::sync::Arc;
use std::time::Duration;
use wgpu::{Buffer, BufferUsages, CommandEncoder, ComputePassDescriptor, MapMode, SubmissionIndex};

const COUNTS: u64 = size_of::<Counts>() as u64;

/// Maximum number of counts buffers per submission. In wgpu, dispatches that write the same buffer wait for each other,
/// so each trace has its own buffer up to this number.
const MAX_COUNTS: usize = 16;

/// Offset of `SubmissionEncoder::stamp` in a report.
const STAMP: u64 = timestamps::BYTES + COUNTS * MAX_COUNTS as u64;

/// Reason why a submission in the program's encoder never runs.
const REJECTED: &str = "wgpu rejected the command encoder of this step: it belongs to another device, has an \
                        open pass, or contains invalid commands";

/// Resources of one submission at a time.
pub(crate) struct SubmissionEncoder {
    /// One buffer per trace index, created on first use.
    counts: Vec<Buffer>,
    /// Number of counts buffers that this submission uses.
    counts_used: usize,
    timestamps: Option<PassTimestamps>,
    /// The report that the host maps: timestamps, counts and the stamp.
    report: Buffer,
    /// Contains the ticket of a submission that is recorded into the program's encoder. Its commands copy the ticket to
    /// the report.
    stamp: Buffer,
    /// The ticket in `stamp`, or 0.
    stamped: u64,
    /// Whether [`Self::finish`] found that wgpu rejected the program's encoder, so that its commands never ran.
    is_refused: bool,
    pub(crate) launches: Launches,
    /// Index of the submission, and mapping of the report. `None` until the recording is encoded. The index is `None`
    /// if the program submits the recording.
    pub(crate) sent: Option<(Option<SubmissionIndex>, Mapping)>,
    gpu: Arc<OpenGpu>,
}

/// Launches of one stage, or of no stage.
struct StageLaunches {
    stage: Option<Stage>,
    launches: Vec<Launch>,
}

impl SubmissionEncoder {
    pub(crate) fn new(gpu: &Arc<OpenGpu>) -> Result<Self> {
        let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        Ok(Self {
            counts: vec![make(gpu, "counts", COUNTS, STORAGE)?],
            counts_used: 1,
            timestamps: PassTimestamps::new(gpu)?,
            report: make(gpu, "a report", STAMP + size_of::<u64>() as u64, READBACK)?,
            stamp: make(gpu, "a stamp", size_of::<u64>() as u64, usage)?,
            stamped: 0,
            is_refused: false,
            launches: Launches::new(gpu)?,
            sent: None,
            gpu: Arc::clone(gpu),
        })
    }

    /// Encodes a recording, and the copies of its counts and timestamps to the report. With a `stamp`, the report also
    /// contains this ticket.
    ///
    /// wgpu validates the program's encoder only when the program finishes it. If the encoder belongs to another device
    /// or has an open pass, its commands never run, but wgpu still maps the report. The stamp then reveals the error,
    /// because the report does not contain the ticket.
    pub(crate) fn encode(
        &mut self,
        encoder: &mut CommandEncoder,
        recording: &mut WgpuRecording,
        stamp: Option<Ticket>,
    ) -> Result<()> {
        self.begin(recording)?;
        self.stamped = stamp.map_or(0, |ticket| ticket.0);
        if stamp.is_some() {
            write(&self.gpu, &self.stamp, 0, &[self.stamped])?;
        }
        self.gpu.guard("recording", 0, || {
            let all = self.counts[..self.counts_used].iter();
            all.for_each(|counts| encoder.clear_buffer(counts, 0, None));
        })?;
        let counts = &self.counts[..self.counts_used];
        let launches = self.launches.bind(&self.gpu, counts, recording)?;
        let mut launches = launches.into_iter();
        // Complete stages that no pass contains yet, and the launches after them.
        let (mut stages, mut waiting) = (Vec::new(), Vec::new());
        for command in recording.commands.drain(..) {
            match command {
                RecordedCommand::Dispatch(_) => waiting.extend(launches.next()),
                RecordedCommand::ClearCounts(bytes) => {
                    self.passes(encoder, &mut stages)?;
                    self.gpu.guard("recording", 0, || {
                        encoder.clear_buffer(&self.counts[0], 0, Some(bytes));
                    })?;
                }
                RecordedCommand::EndStage(stage) => {
                    // Geometry and rays have separate passes, because a timestamp within a pass would lengthen the
                    // stage before it.
                    if stage == Stage::TracePrimary {
                        self.passes(encoder, &mut stages)?;
                    }
                    stages.push(StageLaunches {
                        stage: Some(stage),
                        launches: std::mem::take(&mut waiting),
                    });
                }
                RecordedCommand::Split => (),
                RecordedCommand::Native(never) => match never {},
            }
        }
        self.passes(encoder, &mut stages)?;
        if !waiting.is_empty() {
            let (stage, launches) = (None, waiting);
            self.pass(encoder, &[StageLaunches { stage, launches }])?;
        }
        self.gpu.guard("the report of a frame", 0, || {
            for (counts, at) in self.counts[..self.counts_used].iter().zip(0..) {
                let at = timestamps::BYTES + COUNTS * at;
                encoder.copy_buffer_to_buffer(counts, 0, &self.report, at, COUNTS);
            }
            if stamp.is_some() {
                encoder.copy_buffer_to_buffer(&self.stamp, 0, &self.report, STAMP, Some(8));
            }
            if let Some(timestamps) = &self.timestamps {
                timestamps.resolve(encoder, &self.report, 0);
            }
        })
    }

    /// Requests the mapping of the report. Call it after all commands of the submission are encoded.
    pub(crate) fn report(&self, encoder: &CommandEncoder) -> Mapping {
        Mapping::on_submit(encoder, &self.report, MapMode::Read)
    }

    /// Unmaps the report after the submission failed, because wgpu maps it anyway.
    pub(crate) fn unmap_report(&self) {
        // If the device is lost, the next call reports it.
        let _ = unmap(&self.gpu.device, &self.report);
    }

    /// Encodes and removes all stages, as one pass if they can be timed within it.
    fn passes(
        &mut self,
        encoder: &mut CommandEncoder,
        stages: &mut Vec<StageLaunches>,
    ) -> Result<()> {
        let is_one = self.timestamps.as_ref().is_none_or(|t| t.within);
        let most = if is_one { stages.len() } else { 1 };
        for stages in stages.chunks(most.max(1)) {
            self.pass(encoder, stages)?;
        }
        stages.clear();
        Ok(())
    }

    fn pass(&mut self, encoder: &mut CommandEncoder, stages: &[StageLaunches]) -> Result<()> {
        let named: Option<Vec<Stage>> = stages.iter().map(|s| s.stage).collect();
        let timestamps = self.timestamps.as_mut().zip(named);
        let first = timestamps.and_then(|(timestamps, named)| timestamps.reserve(&named));
        let timed = self.timestamps.as_ref().zip(first);
        let label = "stages of a frame";
        self.gpu.guard(label, 0, || {
            let desc = ComputePassDescriptor {
                label: Some(label),
                timestamp_writes: timed.map(|(t, first)| t.around(first, stages.len())),
            };
            let mut pass = encoder.begin_compute_pass(&desc);
            for (i, stage) in stages.iter().enumerate() {
                if let Some((timestamps, first)) = timed {
                    timestamps.write(&mut pass, first, i);
                }
                stage.launches.iter().for_each(|l| l.encode(&mut pass));
            }
        })
    }

    /// Prepares the resources for a recording. The previous submission must have finished or been dropped.
    fn begin(&mut self, recording: &WgpuRecording) -> Result<()> {
        let is_free = self.sent.as_ref().is_none_or(|(_, m)| m.is_dropped());
        assert!(is_free, "each unfinished submission has its own encoder");
        (self.sent, self.is_refused) = (None, false);
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.stages.clear();
        }
        let counts_used = recording.commands.iter().map(|command| match command {
            RecordedCommand::Dispatch(dispatch) => dispatch.work.trace_index + 1,
            _ => 1,
        });
        self.counts_used = counts_used.max().unwrap_or(1).min(MAX_COUNTS);
        while self.counts.len() < self.counts_used {
            let made = make(&self.gpu, "counts", COUNTS, STORAGE)?;
            self.counts.push(made);
        }
        Ok(())
    }

    /// Returns whether the program dropped the encoder, or [`Self::finish`] found that wgpu rejected it. Never blocks.
    pub(crate) fn is_dropped(&self) -> bool {
        let is_dropped = |(_, mapping): &(_, Mapping)| mapping.is_dropped();
        self.is_refused || self.sent.as_ref().is_some_and(is_dropped)
    }

    /// Returns whether the submission has finished or never runs. Never blocks.
    pub(crate) fn has_finished(&self) -> Result<bool> {
        // After a failed wait there is no report, and another wait fails at once.
        let report = self.sent.as_ref();
        report.map_or(Ok(true), |(_, mapping)| {
            Ok(mapping.is_dropped() || mapping.is_mapped(&self.gpu)?)
        })
    }

    /// Waits for the submission and returns its output.
    pub(crate) fn finish(&mut self) -> Result<Outcome> {
        if self.is_refused {
            return Ok(Outcome::Dropped(REJECTED));
        }
        if self.is_dropped() {
            let why = "the program dropped the command encoder of this step";
            return Ok(Outcome::Dropped(why));
        }
        let gpu = &self.gpu;
        // There is no report if an earlier wait failed.
        let lost = || gpu.faults.lose("a submission did not finish".into());
        let (submission, mapping) = self.sent.take().ok_or_else(lost)?;
        match submission {
            Some(submission) => gpu.wait_for(submission)?,
            None if mapping.is_mapped(gpu)? => (),
            None => {
                gpu.wait_idle()?;
                if !mapping.arrives_within(gpu, Duration::from_millis(50))? {
                    self.sent = Some((None, mapping));
                    let why = "the program has not submitted the command encoder of this step";
                    return Err(BackendError::Misuse(why.into()));
                }
            }
        }
        mapping.wait(gpu)?;
        let view = self.report.get_mapped_range(..).map_err(inaccessible)?;
        let (report, stamp) = view.split_at(STAMP as usize);
        self.is_refused = self.stamped > 0 && !stamp.starts_with(&self.stamped.to_ne_bytes());
        let (ticks, counts) = report.split_at(timestamps::BYTES as usize);
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(ticks);
        let each: Vec<Counts> = bytemuck::pod_collect_to_vec(counts);
        let (mut counts, others) = (each[0], &each[1..self.counts_used]);
        others.iter().for_each(|other| counts.add_trace(other));
        drop(view);
        if !unmap(&gpu.device, &self.report) {
            return Err(gpu.faults.lose("a report was lost".into()));
        }
        if self.is_refused {
            return Ok(Outcome::Dropped(REJECTED));
        }
        let marks = self.timestamps.as_ref().map(|t| t.stages.clone());
        Ok(Outcome::Finished(SubmissionOutput {
            counts,
            ticks: marks.is_some().then_some(ticks),
            marks: marks.unwrap_or_default(),
        }))
    }

    /// Returns the bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        let timestamps = self.timestamps.as_ref().map_or(0, PassTimestamps::bytes);
        COUNTS * self.counts.len() as u64 + self.launches.bytes() + timestamps
    }
}
