//! Encodes recordings, with parameters, counts and timestamps.

use crate::buffers::{Mapping, unreadable, write};
use crate::gpu::{OpenGpu, READBACK, STORAGE, make, unmap};
use crate::launches::{Launch, Launches, WgpuRecording};
use crate::marks::{self, PassTimestamps};
use backend::{BackendError, Result, Ticket};
use gpu_common::{Outcome, RecordedCommand, Stage, SubmissionOutput};
use shaders::Counts;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;
use wgpu::{Buffer, BufferUsages, CommandEncoder, ComputePassDescriptor, MapMode, SubmissionIndex};

const COUNTS: u64 = size_of::<Counts>() as u64;

/// Number of traces per submission with counts of their own. In wgpu, dispatches that write the same buffer wait for
/// each other.
const PLACES: usize = 16;

/// Offset of the stamp in a report.
const STAMP: u64 = marks::BYTES + COUNTS * PLACES as u64;

/// Resources of one submission at a time.
pub(crate) struct SubmissionEncoder {
    /// One buffer for each index of a trace so far.
    counts: Vec<Buffer>,
    /// Number of counts buffers that this submission uses.
    places: usize,
    marks: Option<PassTimestamps>,
    /// Report: timestamps, counts and the stamp, on the way to the host.
    back: Buffer,
    /// Contains the ticket of a submission in a program's encoder, which copies it to the report.
    stamp: Buffer,
    /// The ticket in `stamp`, or 0.
    stamped: u64,
    /// Whether the program's commands were submitted without having any effect.
    is_refused: bool,
    launches: Launches,
    /// Stages that are not encoded yet, each with its launches. Empty between submissions.
    parts: Vec<TimedLaunches>,
    /// Mapping of the report, once the recording was encoded, with the index of its submission unless the program
    /// submits it.
    pub(crate) sent: Option<(Option<SubmissionIndex>, Mapping)>,
    gpu: Arc<OpenGpu>,
}

/// A stage and its launches.
struct TimedLaunches {
    stage: Stage,
    launches: Range<usize>,
}

impl SubmissionEncoder {
    pub(crate) fn new(gpu: &Arc<OpenGpu>) -> Result<Self> {
        let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        Ok(Self {
            counts: vec![make(gpu, "counts", COUNTS, STORAGE)?],
            places: 1,
            marks: PassTimestamps::new(gpu)?,
            back: make(gpu, "a report", STAMP + size_of::<u64>() as u64, READBACK)?,
            stamp: make(gpu, "a stamp", size_of::<u64>() as u64, usage)?,
            stamped: 0,
            is_refused: false,
            launches: Launches::new(gpu),
            parts: Vec::new(),
            sent: None,
            gpu: Arc::clone(gpu),
        })
    }

    /// Encodes a recording and the copy of the report, with the ticket as a stamp if there is one.
    ///
    /// wgpu checks only when the program finishes its encoder that it belongs to the same device and has no open pass.
    /// If not, the report is mapped all the same, but has another stamp.
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
            let all = self.counts[..self.places].iter();
            all.for_each(|counts| encoder.clear_buffer(counts, 0, None));
        })?;
        let counts = &self.counts[..self.places];
        let launches = self.launches.make(&self.gpu, counts, recording)?;
        // The launches that no pass contains yet, and those among them whose stage has not ended.
        let (mut next, mut waiting) = (0, 0..0);
        for command in recording.commands.drain(..) {
            match command {
                RecordedCommand::Dispatch(_) => {
                    next += 1;
                    waiting.end = next;
                }
                RecordedCommand::ClearCounts(bytes) => {
                    self.passes(encoder, &launches)?;
                    self.gpu.guard("recording", 0, || {
                        encoder.clear_buffer(&self.counts[0], 0, Some(bytes));
                    })?;
                }
                RecordedCommand::EndStage(stage) => {
                    // Geometry and rays have separate passes, because a timestamp within a pass would lengthen the
                    // stage before it.
                    if stage == Stage::TracePrimary {
                        self.passes(encoder, &launches)?;
                    }
                    self.parts.push(TimedLaunches {
                        stage,
                        launches: waiting,
                    });
                    waiting = next..next;
                }
                RecordedCommand::Split => (),
                RecordedCommand::Native(never) => match never {},
            }
        }
        self.passes(encoder, &launches)?;
        self.untimed(encoder, &launches[waiting])?;
        self.launches.reuse(launches);
        self.launches.write(&self.gpu)?;
        self.gpu.guard("the report of a frame", 0, || {
            for (counts, at) in self.counts[..self.places].iter().zip(0..) {
                let at = marks::BYTES + COUNTS * at;
                encoder.copy_buffer_to_buffer(counts, 0, &self.back, at, COUNTS);
            }
            if stamp.is_some() {
                encoder.copy_buffer_to_buffer(&self.stamp, 0, &self.back, STAMP, Some(8));
            }
            if let Some(marks) = &self.marks {
                marks.resolve(encoder, &self.back, 0);
            }
        })
    }

    /// Requests the mapping of the report. This must be the last call on the encoder.
    pub(crate) fn report(&self, encoder: &CommandEncoder) -> Mapping {
        Mapping::on_submit(encoder, &self.back, MapMode::Read)
    }

    /// Unmaps the report after the submission failed, since wgpu maps it all the same.
    pub(crate) fn recall(&self) {
        // If the device is lost, the next call reports it.
        let _ = unmap(&self.gpu.device, &self.back);
    }

    /// Encodes the stages of `parts`, as one pass if they can be timed within it.
    fn passes(&mut self, encoder: &mut CommandEncoder, launches: &[Launch]) -> Result<()> {
        let mut parts = std::mem::take(&mut self.parts);
        let is_one = self.marks.as_ref().is_none_or(|marks| marks.within);
        let most = if is_one { parts.len() } else { 1 };
        let mut passes = parts.chunks(most.max(1));
        passes.try_for_each(|parts| self.pass(encoder, parts, launches))?;
        parts.clear();
        self.parts = parts;
        Ok(())
    }

    fn pass(
        &mut self,
        encoder: &mut CommandEncoder,
        parts: &[TimedLaunches],
        launches: &[Launch],
    ) -> Result<()> {
        let label = "stages of a frame";
        let stages = parts.iter().map(|part| part.stage);
        let first = self.marks.as_mut().and_then(|marks| marks.take(stages));
        let timed = self.marks.as_ref().zip(first);
        self.gpu.guard(label, 0, || {
            let desc = ComputePassDescriptor {
                label: Some(label),
                timestamp_writes: timed.map(|(marks, first)| marks.around(first, parts.len())),
            };
            let mut pass = encoder.begin_compute_pass(&desc);
            for (i, part) in parts.iter().enumerate() {
                if let Some((marks, first)) = timed {
                    marks.mark(&mut pass, first, i);
                }
                let launches = launches[part.launches.clone()].iter();
                launches.for_each(|launch| launch.go(&mut pass));
            }
        })
    }

    fn untimed(&self, encoder: &mut CommandEncoder, launches: &[Launch]) -> Result<()> {
        if launches.is_empty() {
            return Ok(());
        }
        self.gpu.guard("kernels of no stage", 0, || {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
            launches.iter().for_each(|launch| launch.go(&mut pass));
        })
    }

    /// Prepares the resources for a recording. The previous submission must have finished or been dropped.
    fn begin(&mut self, recording: &WgpuRecording) -> Result<()> {
        let is_free = self.sent.as_ref().is_none_or(|(_, m)| m.is_dropped());
        assert!(
            is_free,
            "at most so many submissions as encoders are unfinished"
        );
        (self.sent, self.is_refused) = (None, false);
        self.parts.clear();
        if let Some(marks) = &mut self.marks {
            marks.stages.clear();
        }
        let places = recording.commands.iter().map(|command| match command {
            RecordedCommand::Dispatch(dispatch) => dispatch.work.trace_index + 1,
            _ => 1,
        });
        self.places = places.max().unwrap_or(1).min(PLACES);
        while self.counts.len() < self.places {
            let made = make(&self.gpu, "counts", COUNTS, STORAGE)?;
            self.counts.push(made);
        }
        Ok(())
    }

    /// Returns whether the submission has finished or never runs. Never blocks.
    pub(crate) fn has_finished(&self) -> Result<bool> {
        // After a failed wait there is no report, and another wait fails at once.
        let report = self.sent.as_ref();
        report.map_or(Ok(true), |(_, mapping)| {
            Ok(mapping.is_dropped() || mapping.poll(&self.gpu)?)
        })
    }

    /// Waits for the submission and returns its output.
    pub(crate) fn finish(&mut self) -> Result<Outcome> {
        let gpu = &self.gpu;
        let is_dropped = |(_, mapping): &(_, Mapping)| mapping.is_dropped();
        if self.is_refused || self.sent.as_ref().is_some_and(is_dropped) {
            return Ok(Outcome::Dropped);
        }
        // An earlier failed wait took it.
        let lost = || gpu.faults.lose("a submission never ended".into());
        let (place, mapping) = self.sent.take().ok_or_else(lost)?;
        match place {
            Some(place) => gpu.wait_for(place)?,
            None if mapping.poll(gpu)? => (),
            None => {
                gpu.wait_idle()?;
                if !mapping.arrives_within(gpu, Duration::from_millis(50))? {
                    self.sent = Some((None, mapping));
                    let why = "the encoder that the step is in was not submitted";
                    return Err(BackendError::Misuse(why.into()));
                }
            }
        }
        mapping.expect(gpu)?;
        let view = self.back.get_mapped_range(..).map_err(unreadable)?;
        let (report, stamp) = view.split_at(STAMP as usize);
        self.is_refused = self.stamped > 0 && !stamp.starts_with(&self.stamped.to_ne_bytes());
        let (ticks, counts) = report.split_at(marks::BYTES as usize);
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(ticks);
        let each: Vec<Counts> = bytemuck::pod_collect_to_vec(counts);
        let (mut counts, others) = (each[0], &each[1..self.places]);
        others.iter().for_each(|other| counts.add_trace(other));
        drop(view);
        if !unmap(&gpu.device, &self.back) {
            return Err(gpu.faults.lose("it took a report with it".into()));
        }
        if self.is_refused {
            let why = "wgpu refused the commands that the step is in: the encoder was another device's, had a pass \
                       open, or had invalid commands of the program's";
            return Err(BackendError::Misuse(why.into()));
        }
        let marks = self.marks.as_ref().map(|marks| marks.stages.clone());
        Ok(Outcome::Finished(SubmissionOutput {
            counts,
            ticks: marks.is_some().then_some(ticks),
            marks: marks.unwrap_or_default(),
        }))
    }

    /// Returns the bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        let marks = self.marks.as_ref().map_or(0, PassTimestamps::bytes);
        COUNTS * self.counts.len() as u64 + self.launches.bytes() + marks
    }

    /// Drops everything that belongs to the scene.
    pub(crate) fn forget(&mut self) {
        self.launches.forget();
    }
}
