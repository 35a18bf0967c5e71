//! Resources of one submission: commands, parameters, counts and timestamps.
//!
//! Commands are kept as a list until the submission, when their encoder is known.

use crate::buffers::{Mapping, READBACK, STORAGE, make, unmap, unreadable, write};
use crate::gpu::Gpu;
use crate::launches::{Launch, Launches};
use crate::marks::{self, Marks};
use crate::wgpu_device::WgpuDevice;
use backend::{BackendError, Result, Ticket};
use gpu_common::{Dispatch, Find, Finished, GpuSlot, Stage};
use shaders::Counts;
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
pub struct Slot {
    /// One buffer for each index of a trace so far.
    counts: Vec<Buffer>,
    /// Number of counts buffers that this submission uses.
    places: usize,
    marks: Option<Marks>,
    /// Report: timestamps, counts and the stamp, on the way to the host.
    back: Buffer,
    /// Contains the ticket of a submission in a program's encoder, which copies it to the report.
    stamp: Buffer,
    /// The ticket in `stamp`, or 0.
    stamped: u64,
    /// Whether the program's commands were submitted without having any effect.
    is_refused: bool,
    launches: Launches,
    commands: Vec<Command>,
    /// Dispatches whose stage has not ended yet.
    waiting: Vec<Launch>,
    /// Mapping of the report, once the recording was encoded, with the index of its submission unless the program
    /// submits it.
    pub(crate) sent: Option<(Option<SubmissionIndex>, Mapping)>,
    gpu: Arc<Gpu>,
}

enum Command {
    /// Sets the first bytes of the counts to 0.
    Clear(u64),
    Stage(Stage, Vec<Launch>),
}

impl Slot {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        Ok(Self {
            counts: vec![make(gpu, "counts", COUNTS, STORAGE)?],
            places: 1,
            marks: Marks::new(gpu)?,
            back: make(gpu, "a report", STAMP + size_of::<u64>() as u64, READBACK)?,
            stamp: make(gpu, "a stamp", size_of::<u64>() as u64, usage)?,
            stamped: 0,
            is_refused: false,
            launches: Launches::new(gpu),
            commands: Vec::new(),
            waiting: Vec::new(),
            sent: None,
            gpu: Arc::clone(gpu),
        })
    }

    /// Writes the recording and the copy of the report into an encoder, with the ticket as a stamp if there is one.
    ///
    /// wgpu checks only when the program finishes its encoder that it belongs to the same device and has no open pass.
    /// If not, the report is mapped all the same, but has another stamp.
    pub(crate) fn encode(
        &mut self,
        encoder: &mut CommandEncoder,
        stamp: Option<Ticket>,
    ) -> Result<()> {
        self.stamped = stamp.map_or(0, |ticket| ticket.0);
        if stamp.is_some() {
            write(&self.gpu, &self.stamp, 0, &[self.stamped])?;
        }
        self.gpu.guard("recording", 0, || {
            let others = self.counts[..self.places].iter().skip(1);
            others.for_each(|counts| encoder.clear_buffer(counts, 0, None));
        })?;
        let mut parts = Vec::new();
        let mut commands = std::mem::take(&mut self.commands);
        for command in commands.drain(..) {
            match command {
                Command::Clear(bytes) => {
                    self.passes(encoder, &mut parts)?;
                    self.gpu.guard("recording", 0, || {
                        encoder.clear_buffer(&self.counts[0], 0, Some(bytes));
                    })?;
                }
                Command::Stage(stage, launches) => {
                    // Geometry and rays have separate passes, because a timestamp within a pass would lengthen the
                    // stage before it.
                    if stage == Stage::TracePrimary {
                        self.passes(encoder, &mut parts)?;
                    }
                    parts.push((stage, launches));
                }
            }
        }
        // Keep the vector's capacity.
        self.commands = commands;
        self.passes(encoder, &mut parts)?;
        self.untimed(encoder)?;
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

    /// Writes these stages, as one pass if they can be timed within it.
    fn passes(
        &mut self,
        encoder: &mut CommandEncoder,
        parts: &mut Vec<(Stage, Vec<Launch>)>,
    ) -> Result<()> {
        let is_one = self.marks.as_ref().is_none_or(|marks| marks.within);
        let most = if is_one { parts.len() } else { 1 };
        let mut passes = parts.chunks(most.max(1));
        let written = passes.try_for_each(|parts| self.pass(encoder, parts));
        parts.clear();
        written
    }

    fn pass(&mut self, encoder: &mut CommandEncoder, parts: &[(Stage, Vec<Launch>)]) -> Result<()> {
        let label = "stages of a frame";
        let stages = parts.iter().map(|(stage, _)| *stage);
        let first = self.marks.as_mut().and_then(|marks| marks.take(stages));
        let timed = self.marks.as_ref().zip(first);
        self.gpu.guard(label, 0, || {
            let desc = ComputePassDescriptor {
                label: Some(label),
                timestamp_writes: timed.map(|(marks, first)| marks.around(first, parts.len())),
            };
            let mut pass = encoder.begin_compute_pass(&desc);
            for (i, (_, launches)) in parts.iter().enumerate() {
                if let Some((marks, first)) = timed {
                    marks.mark(&mut pass, first, i);
                }
                launches.iter().for_each(|launch| launch.go(&mut pass));
            }
        })
    }

    fn untimed(&mut self, encoder: &mut CommandEncoder) -> Result<()> {
        let untimed = std::mem::take(&mut self.waiting);
        if untimed.is_empty() {
            return Ok(());
        }
        self.gpu.guard("kernels of no stage", 0, || {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
            untimed.iter().for_each(|launch| launch.go(&mut pass));
        })
    }

    /// Waits for the submission and returns its output.
    pub(crate) fn finish(&mut self) -> Result<Finished> {
        let gpu = &self.gpu;
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
        Ok(Finished {
            counts,
            ticks: marks.is_some().then_some(ticks),
            marks: marks.unwrap_or_default(),
        })
    }
}

impl Slot {
    /// Forgets the submission if its commands were dropped or rejected. Returns whether they were.
    pub(crate) fn give_up_dropped(&mut self) -> bool {
        let sent = self.sent.as_ref();
        let is_dropped = self.is_refused || sent.is_some_and(|(_, mapping)| mapping.is_dropped());
        if is_dropped {
            (self.sent, self.is_refused) = (None, false);
        }
        is_dropped
    }
}

impl GpuSlot<WgpuDevice> for Slot {
    fn begin(&mut self) -> Result<()> {
        assert!(self.sent.is_none(), "a slot holds one submission at a time");
        self.launches.begin(&self.gpu);
        self.waiting.clear();
        self.commands.clear();
        self.places = 1;
        if let Some(marks) = &mut self.marks {
            marks.stages.clear();
        }
        self.clear_counts(COUNTS)
    }

    fn dispatch(
        &mut self,
        all: &[Dispatch<'_, WgpuDevice>],
        find: Find<'_, '_, Buffer>,
    ) -> Result<()> {
        let gpu = &self.gpu;
        let places = all.iter().map(|d| d.work.place + 1).max();
        self.places = self.places.max(places.unwrap_or(1)).min(PLACES);
        while self.counts.len() < self.places {
            self.counts.push(make(gpu, "counts", COUNTS, STORAGE)?);
        }
        let counts = &self.counts[..self.places];
        let launches = self.launches.make(gpu, counts, all, find)?;
        self.waiting.extend(launches);
        Ok(())
    }

    fn end_stage(&mut self, stage: Stage) -> Result<()> {
        let launches = std::mem::take(&mut self.waiting);
        self.commands.push(Command::Stage(stage, launches));
        Ok(())
    }

    fn clear_counts(&mut self, bytes: u64) -> Result<()> {
        self.commands.push(Command::Clear(bytes));
        Ok(())
    }

    fn bytes(&self) -> u64 {
        let marks = self.marks.as_ref().map_or(0, Marks::bytes);
        COUNTS * self.counts.len() as u64 + self.launches.bytes() + marks
    }

    fn forget(&mut self) {
        self.launches.forget();
        self.waiting.clear();
        self.commands.clear();
    }
}
