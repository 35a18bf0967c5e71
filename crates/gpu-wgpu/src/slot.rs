//! What one submission needs for itself: commands, parameters, counts, timestamps.

use crate::buffers::{Mapping, readback, storage, unmap, unreadable};
use crate::device::Gpu;
use crate::launches::{Launch, Launches};
use crate::pipelines::Pipelines;
use crate::queries::{self, Clock, Stage};
use backend::{FrameReport, Result, StageTimes};
use shaders::work::Work;
use shaders::{Counts, Extents};
use std::mem::offset_of;
use std::time::Instant;
use wgpu::{Buffer, CommandEncoder, ComputePassDescriptor, SubmissionIndex};

const COUNTS: u64 = size_of::<Counts>() as u64;
/// Bytes of what `preprocess` counts.
const LEAF_COUNTS: u64 = offset_of!(Counts, hits) as u64;

/// Used by one submission at a time.
pub(crate) struct Slot {
    counts: Buffer,
    clock: Option<Clock>,
    /// Counts and timestamps on their way to the host.
    back: Buffer,
    launches: Launches,
    encoder: Option<CommandEncoder>,
    /// Those that run, and those that had nothing to do.
    stages: Vec<Stage>,
    idle: Vec<Stage>,
    /// `interpolate`, until it is known whether `preprocess` runs beside it.
    held: Vec<Launch>,
    /// What the next pass is to hold.
    parts: Vec<(Stage, Vec<Launch>)>,
    sent: Option<Sent>,
    pub(crate) readback_bytes: u64,
    pub(crate) extents: Extents,
}

struct Sent {
    submission: SubmissionIndex,
    mapping: Mapping,
    at: Instant,
}

/// What a finished submission did.
pub(crate) struct Done {
    pub(crate) report: FrameReport,
    pub(crate) counts: Counts,
}

impl Slot {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            counts: storage(gpu, "counts", COUNTS)?,
            clock: Clock::new(gpu)?,
            back: readback(gpu, "a report", COUNTS + queries::BYTES)?,
            launches: Launches::new(gpu),
            encoder: None,
            stages: Vec::new(),
            idle: Vec::new(),
            held: Vec::new(),
            parts: Vec::new(),
            sent: None,
            readback_bytes: 0,
            extents: Extents::default(),
        })
    }

    /// Bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        let clock = self.clock.as_ref().map_or(0, Clock::bytes);
        self.counts.size() + self.launches.bytes() + clock
    }

    /// Lets go of the buffers of a scene.
    pub(crate) fn forget(&mut self) {
        self.launches.forget();
        self.held.clear();
        self.parts.clear();
        self.encoder = None;
    }

    /// Starts a new recording. The slot's last submission must have been reported.
    pub(crate) fn begin(&mut self, gpu: &Gpu) -> Result<()> {
        assert!(self.sent.is_none(), "a slot holds one submission at a time");
        self.launches.begin(gpu);
        self.stages.clear();
        self.idle.clear();
        self.held.clear();
        self.parts.clear();
        if let Some(clock) = &mut self.clock {
            clock.begin();
        }
        self.readback_bytes = 0;
        self.extents = Extents::default();
        let mut encoder = gpu.encoder("a frame")?;
        gpu.guard("recording", 0, || {
            encoder.clear_buffer(&self.counts, 0, None);
        })?;
        self.encoder = Some(encoder);
        Ok(())
    }

    /// Records a stage; `find` gives buffers by their names in the kernels. `interpolate` is timed with what may run
    /// beside it.
    pub(crate) fn record<'a>(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        stage: Stage,
        work: &[Work],
        find: impl Fn(&'static str) -> &'a Buffer,
    ) -> Result<()> {
        if !work.first().is_some_and(|w| w.alongside) {
            self.release();
        }
        // Geometry and rays each have a pass: a timestamp within one would lengthen what it ends.
        if stage == Stage::TracePrimary {
            self.flush(gpu)?;
        }
        // The first stage begins the frame's time.
        if work.is_empty() && !self.stages.is_empty() {
            self.idle.push(stage);
            return Ok(());
        }
        if stage == Stage::Preprocess && self.stages.contains(&stage) {
            self.forget_leaves(gpu)?;
        }
        let launches = self
            .launches
            .make(gpu, pipelines, &self.counts, work, find)?;
        gpu.count(|t| t.dispatches += work.len() as u64);
        if stage == Stage::Interpolate {
            self.held = launches;
            return Ok(());
        }
        let beside = std::mem::take(&mut self.held);
        self.stages.push(stage);
        self.parts.push((stage, beside));
        for launch in launches {
            self.append(stage, launch);
        }
        Ok(())
    }

    /// Adds to a stage.
    fn append(&mut self, stage: Stage, launch: Launch) {
        match self.parts.last_mut() {
            Some((_, launches)) => launches.push(launch),
            None => self.parts.push((stage, vec![launch])),
        }
    }

    /// Stands `interpolate` by itself, if it is held.
    fn release(&mut self) {
        let held = std::mem::take(&mut self.held);
        if !held.is_empty() {
            self.stages.push(Stage::Interpolate);
            self.parts.push((Stage::Interpolate, held));
        }
    }

    /// `preprocess` may run more than once a submission: the last one counts.
    fn forget_leaves(&mut self, gpu: &Gpu) -> Result<()> {
        self.flush(gpu)?;
        let (counts, encoder) = (&self.counts, self.encoder.as_mut());
        let encoder = encoder.expect("a recording was begun");
        gpu.guard("recording", 0, || {
            encoder.clear_buffer(counts, 0, Some(LEAF_COUNTS));
        })
    }

    /// Records passes of all stages that wait: one, if they can be timed in it.
    fn flush(&mut self, gpu: &Gpu) -> Result<()> {
        let mut parts = std::mem::take(&mut self.parts);
        let is_one = self.clock.as_ref().is_none_or(Clock::marks_within);
        let most = if is_one { parts.len() } else { 1 };
        let mut passes = parts.chunks(most.max(1));
        let recorded = passes.try_for_each(|parts| self.pass(gpu, parts));
        // Its memory is kept.
        parts.clear();
        self.parts = parts;
        recorded
    }

    fn pass(&mut self, gpu: &Gpu, parts: &[(Stage, Vec<Launch>)]) -> Result<()> {
        let encoder = self.encoder.as_mut().expect("a recording was begun");
        let stages = parts.iter().map(|(stage, _)| *stage);
        let first = self.clock.as_mut().and_then(|clock| clock.take(stages));
        let timed = self.clock.as_ref().zip(first);
        gpu.count(|t| t.passes += 1);
        let label = match parts {
            [(stage, _)] => stage.name(),
            _ => "stages of a frame",
        };
        gpu.guard(label, 0, || {
            let desc = ComputePassDescriptor {
                label: Some(label),
                timestamp_writes: timed.map(|(clock, first)| clock.around(first, parts.len())),
            };
            let mut pass = encoder.begin_compute_pass(&desc);
            for (i, (_, launches)) in parts.iter().enumerate() {
                if let Some((clock, first)) = timed {
                    clock.mark(&mut pass, first, i);
                }
                launches.iter().for_each(|launch| launch.go(&mut pass));
            }
        })
    }

    /// Counts and timestamps that have come back.
    fn read_back(&self, gpu: &Gpu, mapping: &Mapping) -> Result<(Counts, Vec<u64>)> {
        mapping.expect(gpu)?;
        let view = self.back.get_mapped_range(..).map_err(unreadable)?;
        let (counts, ticks) = view.split_at(COUNTS as usize);
        let counts: Counts = bytemuck::pod_read_unaligned(counts);
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(ticks);
        drop(view);
        if !unmap(&gpu.device, &self.back) {
            return Err(gpu.faults.lose("it took a report with it".into()));
        }
        Ok((counts, ticks))
    }

    /// The recording's commands, for copies of what was made so far.
    pub(crate) fn encoder(&mut self, gpu: &Gpu) -> Result<&mut CommandEncoder> {
        self.release();
        self.flush(gpu)?;
        Ok(self.encoder.as_mut().expect("a recording was begun"))
    }

    /// Ends the recording and submits it.
    pub(crate) fn submit(&mut self, gpu: &Gpu) -> Result<()> {
        self.release();
        self.flush(gpu)?;
        self.launches.write(gpu)?;
        let mut encoder = self.encoder.take().expect("a recording was begun");
        gpu.guard("the report of a frame", 0, || {
            encoder.copy_buffer_to_buffer(&self.counts, 0, &self.back, 0, COUNTS);
            if let Some(clock) = &self.clock {
                clock.resolve(&mut encoder, &self.back, COUNTS);
            }
        })?;
        let at = Instant::now();
        let submission = gpu.submit(encoder)?;
        let mapping = Mapping::ask(gpu, &self.back)?;
        self.sent = Some(Sent {
            submission,
            mapping,
            at,
        });
        Ok(())
    }

    /// Waits for the submission and says what it did.
    pub(crate) fn finish(&mut self, gpu: &Gpu) -> Result<Done> {
        // An earlier wait that failed took it.
        let lost = || gpu.faults.lose("a submission never ended".into());
        let sent = self.sent.take().ok_or_else(lost)?;
        gpu.wait_for(sent.submission)?;
        let wall_ms = sent.at.elapsed().as_secs_f64() * 1e3;
        let (counts, ticks) = self.read_back(gpu, &sent.mapping)?;
        let times = match &self.clock {
            Some(clock) => clock.times(&self.idle, &ticks, gpu.tick_ns),
            None => StageTimes {
                device_ms: wall_ms,
                ..StageTimes::default()
            },
        };
        let report = FrameReport {
            times,
            hits: u64::from(counts.hits),
            blocked: u64::from(counts.blocked),
            settled: counts.settled(),
            readback_bytes: self.readback_bytes,
            ..FrameReport::default()
        };
        Ok(Done { report, counts })
    }
}
