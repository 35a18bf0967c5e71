//! What one submission needs for itself: commands, parameters, counts, timestamps.

use crate::buffers::{Mapping, make, readback, storage, unmap, unreadable, write};
use crate::device::Gpu;
use crate::groups::Groups;
use crate::limits::{group_counts, params_stride};
use crate::pipelines::{Pipeline, Pipelines};
use crate::queries::{self, Clock, Stage};
use backend::{FrameReport, Result, StageTimes};
use shaders::work::Work;
use shaders::{Counts, Extents, Params};
use std::mem::offset_of;
use std::time::Instant;
use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, ComputePass, SubmissionIndex};

/// Rows of parameters in one buffer; more dispatches take more buffers.
const ROWS: usize = 64;
const COUNTS: u64 = size_of::<Counts>() as u64;
/// Bytes of what `preprocess` counts.
const LEAF_COUNTS: u64 = offset_of!(Counts, hits) as u64;

/// Used by one submission at a time.
pub(crate) struct Slot {
    counts: Buffer,
    clock: Option<Clock>,
    /// Counts and timestamps on their way to the host.
    back: Buffer,
    pages: Vec<Buffer>,
    groups: Groups,
    stride: usize,
    /// Parameters of the recording, as they will lie in the pages.
    rows: Vec<u8>,
    encoder: Option<CommandEncoder>,
    stages: Vec<Stage>,
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
            pages: Vec::new(),
            groups: Groups::default(),
            stride: params_stride(&gpu.limits) as usize,
            rows: Vec::new(),
            encoder: None,
            stages: Vec::new(),
            sent: None,
            readback_bytes: 0,
            extents: Extents::default(),
        })
    }

    /// Bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        let clock = self.clock.as_ref().map_or(0, Clock::bytes);
        let pages = self.pages.iter().map(Buffer::size).sum::<u64>();
        self.counts.size() + pages + clock
    }

    /// Lets go of the buffers of a scene.
    pub(crate) fn forget(&mut self) {
        self.groups.clear();
        self.encoder = None;
    }

    /// Starts a new recording. The slot's last submission must have been reported.
    pub(crate) fn begin(&mut self, gpu: &Gpu) -> Result<()> {
        assert!(self.sent.is_none(), "a slot holds one submission at a time");
        self.groups.refresh(gpu);
        self.rows.clear();
        self.stages.clear();
        self.readback_bytes = 0;
        self.extents = Extents::default();
        let mut encoder = gpu.encoder("a frame")?;
        gpu.guard("recording", 0, || {
            encoder.clear_buffer(&self.counts, 0, None);
        })?;
        self.encoder = Some(encoder);
        Ok(())
    }

    /// Records a stage; `find` gives buffers by their names in the kernels.
    pub(crate) fn record<'a>(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        stage: Stage,
        work: &[Work],
        find: impl Fn(&'static str) -> &'a Buffer,
    ) -> Result<()> {
        if stage == Stage::Preprocess && self.stages.contains(&stage) {
            // It may run more than once a submission: the last one counts.
            let (counts, encoder) = (&self.counts, self.encoder.as_mut());
            let encoder = encoder.expect("a recording was begun");
            gpu.guard("recording", 0, || {
                encoder.clear_buffer(counts, 0, Some(LEAF_COUNTS));
            })?;
        }
        let first = self.rows.len() / self.stride;
        work.iter().for_each(|w| self.push(&w.params));
        self.make_pages(gpu)?;
        let bound = self.bind_all(gpu, pipelines, first, work, find)?;
        let groups = work.iter().map(|w| group_counts(w, &gpu.limits));
        let groups = groups.collect::<Result<Vec<_>>>()?;
        gpu.count(|t| (t.passes, t.dispatches) = (t.passes + 1, t.dispatches + work.len() as u64));
        let launch = |pass: &mut ComputePass<'_>, i: usize| {
            dispatch(pass, pipelines.get(work[i].kernel), &bound[i], groups[i]);
        };
        let mut from = 0;
        loop {
            let again = (from..work.len()).find(|&i| work[i].until_finished());
            let once = from..again.unwrap_or(work.len());
            self.pass(gpu, stage, from == 0, |pass| {
                once.for_each(|i| launch(pass, i));
            })?;
            let Some(last) = again else { return Ok(()) };
            self.run_until_finished(gpu, |pass| launch(pass, last))?;
            from = last + 1;
            if from == work.len() {
                return Ok(());
            }
        }
    }

    /// Records a pass; that which begins a stage is timed.
    fn pass(
        &mut self,
        gpu: &Gpu,
        stage: Stage,
        begins: bool,
        work: impl FnOnce(&mut ComputePass<'_>),
    ) -> Result<()> {
        let clock = self.clock.as_ref().filter(|_| begins);
        let desc = wgpu::ComputePassDescriptor {
            label: Some(stage.name()),
            timestamp_writes: clock.and_then(|c| c.writes(self.stages.len())),
        };
        let encoder = self.encoder.as_mut().expect("a recording was begun");
        gpu.guard(stage.name(), 0, || {
            work(&mut encoder.begin_compute_pass(&desc));
        })?;
        if begins {
            self.stages.push(stage);
        }
        Ok(())
    }

    /// Runs what was recorded, and then `work` until it leaves no ray open or does nothing any more.
    fn run_until_finished(&mut self, gpu: &Gpu, work: impl Fn(&mut ComputePass<'_>)) -> Result<()> {
        self.write_pages(gpu)?;
        let mut before = None;
        loop {
            let mut encoder = self.encoder.take().expect("a recording was begun");
            gpu.guard("finishing rays", 0, || {
                work(&mut encoder.begin_compute_pass(&Default::default()));
                encoder.copy_buffer_to_buffer(&self.counts, 0, &self.back, 0, COUNTS);
            })?;
            let submission = gpu.submit(encoder)?;
            let mapping = Mapping::ask(gpu, &self.back)?;
            gpu.wait_for(submission)?;
            let counts = self.read_back(gpu, &mapping)?.0;
            self.encoder = Some(gpu.encoder("the rest of a frame")?);
            if counts.is_finished() || before == Some(counts.steps) {
                return Ok(());
            }
            before = Some(counts.steps);
        }
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

    fn write_pages(&self, gpu: &Gpu) -> Result<()> {
        let pages = self.pages.iter().zip(self.rows.chunks(ROWS * self.stride));
        pages
            .into_iter()
            .try_for_each(|(page, rows)| write(gpu, page, 0, rows))
    }

    fn push(&mut self, params: &Params) {
        let at = self.rows.len();
        self.rows.extend_from_slice(bytemuck::bytes_of(params));
        self.rows.resize(at + self.stride, 0);
    }

    fn make_pages(&mut self, gpu: &Gpu) -> Result<()> {
        let page = ROWS * self.stride;
        while self.pages.len() * page < self.rows.len() {
            let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            self.pages
                .push(make(gpu, "parameters", page as u64, usage)?);
        }
        Ok(())
    }

    /// A group and an offset for each piece of work; neighbours that differ in the offset alone share a group.
    fn bind_all<'a>(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        first: usize,
        work: &[Work],
        find: impl Fn(&'static str) -> &'a Buffer,
    ) -> Result<Vec<(BindGroup, u32)>> {
        let mut bound: Vec<(BindGroup, u32)> = Vec::with_capacity(work.len());
        for (i, w) in work.iter().enumerate() {
            let (page, row) = ((first + i) / ROWS, (first + i) % ROWS);
            let shared = i > 0 && row > 0 && work[i - 1].kernel.name == w.kernel.name;
            let group = match bound.last().filter(|_| shared) {
                Some((group, _)) => group.clone(),
                None => {
                    let (params, counts) = (&self.pages[page], &self.counts);
                    let pipeline = pipelines.get(w.kernel);
                    self.groups.get(gpu, pipeline, |name| match name {
                        "params" => params,
                        "counts" => counts,
                        other => find(other),
                    })?
                }
            };
            bound.push((group, (row * self.stride) as u32));
        }
        Ok(bound)
    }

    /// The recording's commands, for copies.
    pub(crate) fn encoder(&mut self) -> &mut CommandEncoder {
        self.encoder.as_mut().expect("a recording was begun")
    }

    /// Ends the recording and submits it.
    pub(crate) fn submit(&mut self, gpu: &Gpu) -> Result<()> {
        self.write_pages(gpu)?;
        let mut encoder = self.encoder.take().expect("a recording was begun");
        gpu.guard("the report of a frame", 0, || {
            encoder.copy_buffer_to_buffer(&self.counts, 0, &self.back, 0, COUNTS);
            if let Some(clock) = &self.clock {
                clock.resolve(&mut encoder, self.stages.len(), &self.back, COUNTS);
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
            Some(_) => queries::times(&self.stages, &ticks, gpu.tick_ns),
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

fn dispatch(
    pass: &mut ComputePass<'_>,
    pipeline: &Pipeline,
    (group, offset): &(BindGroup, u32),
    [x, y]: [u32; 2],
) {
    pass.set_pipeline(&pipeline.wgpu);
    pass.set_bind_group(0, group, &[*offset]);
    pass.dispatch_workgroups(x, y, 1);
}
