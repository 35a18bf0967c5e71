//! What one submission needs for itself: commands, parameters, counts, timestamps.

use crate::buffers::{Mapping, readback, storage, unmap, unreadable};
use crate::gpu::Gpu;
use crate::launches::{Launch, Launches};
use crate::marks::{self, Marks};
use crate::wgpu_device::WgpuDevice;
use backend::Result;
use gpu_common::{Dispatch, Find, Finished, Stage};
use shaders::Counts;
use wgpu::{Buffer, CommandEncoder, ComputePassDescriptor, SubmissionIndex};

const COUNTS: u64 = size_of::<Counts>() as u64;

/// Used by one submission at a time.
pub struct Slot {
    counts: Buffer,
    marks: Option<Marks>,
    /// Counts and timestamps on their way to the host.
    back: Buffer,
    launches: Launches,
    encoder: Option<CommandEncoder>,
    /// What belongs to no stage yet.
    waiting: Vec<Launch>,
    /// What the next pass is to hold.
    parts: Vec<(Stage, Vec<Launch>)>,
    sent: Option<(SubmissionIndex, Mapping)>,
}

impl Slot {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            counts: storage(gpu, "counts", COUNTS)?,
            marks: Marks::new(gpu)?,
            back: readback(gpu, "a report", COUNTS + marks::BYTES)?,
            launches: Launches::new(gpu),
            encoder: None,
            waiting: Vec::new(),
            parts: Vec::new(),
            sent: None,
        })
    }

    /// Bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        let marks = self.marks.as_ref().map_or(0, Marks::bytes);
        self.counts.size() + self.launches.bytes() + marks
    }

    /// Lets go of the buffers of a scene.
    pub(crate) fn forget(&mut self) {
        self.launches.forget();
        self.waiting.clear();
        self.parts.clear();
        self.encoder = None;
    }

    pub(crate) fn begin(&mut self, gpu: &Gpu) -> Result<()> {
        assert!(self.sent.is_none(), "a slot holds one submission at a time");
        self.launches.begin(gpu);
        self.waiting.clear();
        self.parts.clear();
        if let Some(marks) = &mut self.marks {
            marks.stages.clear();
        }
        self.encoder = Some(gpu.encoder("a frame")?);
        self.clear_counts(gpu, COUNTS)
    }

    /// Records that the first so many bytes of counts are 0, after the stages before.
    pub(crate) fn clear_counts(&mut self, gpu: &Gpu, bytes: u64) -> Result<()> {
        self.flush(gpu)?;
        let encoder = self.encoder.as_mut().expect("a recording was begun");
        gpu.guard("recording", 0, || {
            encoder.clear_buffer(&self.counts, 0, Some(bytes));
        })
    }

    pub(crate) fn dispatch(
        &mut self,
        gpu: &Gpu,
        all: &[Dispatch<'_, WgpuDevice>],
        find: Find<'_, '_, Buffer>,
    ) -> Result<()> {
        let launches = self.launches.make(gpu, &self.counts, all, find)?;
        gpu.count(|t| t.dispatches += all.len() as u64);
        self.waiting.extend(launches);
        Ok(())
    }

    pub(crate) fn end_stage(&mut self, gpu: &Gpu, stage: Stage) -> Result<()> {
        // Geometry and rays each have a pass: a timestamp within one would lengthen what it ends.
        if stage == Stage::TracePrimary {
            self.flush(gpu)?;
        }
        self.parts.push((stage, std::mem::take(&mut self.waiting)));
        Ok(())
    }

    /// Records passes of all stages that have ended: one, if they can be timed in it.
    fn flush(&mut self, gpu: &Gpu) -> Result<()> {
        let mut parts = std::mem::take(&mut self.parts);
        let is_one = self.marks.as_ref().is_none_or(|marks| marks.within);
        let most = if is_one { parts.len() } else { 1 };
        let mut passes = parts.chunks(most.max(1));
        let recorded = passes.try_for_each(|parts| self.pass(gpu, parts));
        // Its memory is kept.
        parts.clear();
        self.parts = parts;
        recorded
    }

    fn pass(&mut self, gpu: &Gpu, parts: &[(Stage, Vec<Launch>)]) -> Result<()> {
        let label = "stages of a frame";
        let stages = parts.iter().map(|(stage, _)| *stage);
        let first = self.marks.as_mut().and_then(|marks| marks.take(stages));
        let timed = self.marks.as_ref().zip(first);
        let encoder = self.encoder.as_mut().expect("a recording was begun");
        gpu.count(|t| t.passes += 1);
        gpu.guard(label, 0, || {
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

    /// The recording's commands, after all that was recorded.
    pub(crate) fn encoder(&mut self, gpu: &Gpu) -> Result<&mut CommandEncoder> {
        self.flush(gpu)?;
        let encoder = self.encoder.as_mut().expect("a recording was begun");
        let untimed = std::mem::take(&mut self.waiting);
        if !untimed.is_empty() {
            gpu.guard("kernels of no stage", 0, || {
                let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
                untimed.iter().for_each(|launch| launch.go(&mut pass));
            })?;
        }
        Ok(encoder)
    }

    /// Ends the recording and submits it, after what has to come before.
    pub(crate) fn submit(&mut self, gpu: &Gpu, before: Option<CommandEncoder>) -> Result<()> {
        self.encoder(gpu)?;
        self.launches.write(gpu)?;
        let mut encoder = self.encoder.take().expect("a recording was begun");
        gpu.guard("the report of a frame", 0, || {
            encoder.copy_buffer_to_buffer(&self.counts, 0, &self.back, 0, COUNTS);
            if let Some(marks) = &self.marks {
                marks.resolve(&mut encoder, &self.back, COUNTS);
            }
        })?;
        let submission = gpu.submit(before.into_iter().chain([encoder]))?;
        let mapping = Mapping::ask(gpu, &self.back)?;
        self.sent = Some((submission, mapping));
        Ok(())
    }

    /// Waits for the submission and says what it left behind.
    pub(crate) fn finish(&mut self, gpu: &Gpu) -> Result<Finished> {
        // An earlier wait that failed took it.
        let lost = || gpu.faults.lose("a submission never ended".into());
        let (submission, mapping) = self.sent.take().ok_or_else(lost)?;
        gpu.wait_for(submission)?;
        mapping.expect(gpu)?;
        let view = self.back.get_mapped_range(..).map_err(unreadable)?;
        let (counts, ticks) = view.split_at(COUNTS as usize);
        let counts: Counts = bytemuck::pod_read_unaligned(counts);
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(ticks);
        drop(view);
        if !unmap(&gpu.device, &self.back) {
            return Err(gpu.faults.lose("it took a report with it".into()));
        }
        let marks = self.marks.as_ref().map(|marks| marks.stages.clone());
        Ok(Finished {
            counts,
            ticks: marks.is_some().then_some(ticks),
            marks: marks.unwrap_or_default(),
        })
    }
}
