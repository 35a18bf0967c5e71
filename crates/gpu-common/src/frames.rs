//! Recorded and unfinished submissions, and the reports and traces of finished ones.

use crate::{Clock, Dispatch, Find, GpuDevice, GpuSlot, Pipelines, Stage, Trace};
use backend::{BackendError, FRAMES_IN_FLIGHT, FrameReport, Result, StageTimes, Ticket};
use shaders::work::Work;
use shaders::{Counts, Extents, RasterBackoff, TreeStats};
use std::collections::VecDeque;
use std::mem::offset_of;
use std::time::Instant;

/// One slot more than the maximum number of unfinished submissions, so that recording never waits.
const SLOTS: usize = FRAMES_IN_FLIGHT + 1;

/// Bytes of the counts of `preprocess`. It may run several times per submission; only the last run counts.
const LEAF_COUNTS: u64 = offset_of!(Counts, hits) as u64;

/// A ring of slots, and the results of their submissions.
pub struct Frames<D: GpuDevice> {
    slots: Vec<Slot<D>>,
    pub(crate) recording: bool,
    /// Last submitted ticket.
    pub(crate) submitted: Ticket,
    /// Traces that are recorded but not yet submitted, in order.
    pub pending: Vec<Trace<D>>,
    /// Traces of a batch that failed in part. Recorded commands still use their buffers.
    refused: Vec<Trace<D>>,
    /// Number of further submissions that contain a trace for which a submission is remembered.
    kept: usize,
    /// Remembered submissions, oldest first.
    ledger: VecDeque<Submission<D>>,
    /// Latest results of `preprocess` and `refit`.
    tree_stats: TreeStats,
    /// Latest results of traces by rasterization.
    pub(crate) raster_backoff: RasterBackoff,
    /// Whether the last submission that measured coordinates found very different sizes.
    pub(crate) spread: bool,
    clock: Clock,
}

struct Submission<D: GpuDevice> {
    ticket: Ticket,
    traces: Vec<Trace<D>>,
    /// Whether it has traces that were not released.
    is_traced: bool,
    /// See [`backend::Backend::release`]. A released trace only keeps its buffers for later traces.
    is_released: bool,
    never_active: u64,
    at: Instant,
    /// `None` until the submission has finished.
    report: Option<FrameReport>,
}

/// Resources of one submission at a time.
pub struct Slot<D: GpuDevice> {
    /// The device's resources.
    own: D::Slot,
    stages: Vec<Stage>,
    /// Stages without work.
    idle: Vec<Stage>,
    max_groups: u32,
    /// Whether `interpolate` was recorded last and its stage is still open, so that `preprocess` may run concurrently.
    open: bool,
    /// Parts of the scene that `preprocess` and `refit` processed.
    pub extents: Extents,
    pub(crate) readback_bytes: u64,
}

impl<D: GpuDevice> Slot<D> {
    fn new(gpu: &D) -> Result<Self> {
        Ok(Self {
            own: gpu.slot()?,
            stages: Vec::new(),
            idle: Vec::new(),
            max_groups: gpu.max_groups(),
            open: false,
            extents: Extents::default(),
            readback_bytes: 0,
        })
    }

    fn begin(&mut self) -> Result<()> {
        self.stages.clear();
        self.idle.clear();
        (self.open, self.readback_bytes) = (false, 0);
        self.extents = Extents::default();
        self.own.begin()
    }

    /// Records kernels as a stage, or as part of no stage. Checks all dispatches before it records the first one.
    /// `interpolate` stays open for kernels that may run concurrently, and is then timed together with them. A stage
    /// without work takes no time, but if it comes first, the frame's time starts with it.
    pub(crate) fn record(
        &mut self,
        pipelines: &Pipelines<D>,
        stage: Option<Stage>,
        work: &[Work],
        find: Find<'_, '_, D::Buffer>,
    ) -> Result<()> {
        if stage.is_none() || !work.first().is_some_and(|w| w.alongside) {
            self.close()?;
        }
        if work.is_empty() && !self.stages.is_empty() {
            self.idle.extend(stage);
            return Ok(());
        }
        let again = |stage: Stage| stage == Stage::Preprocess && self.stages.contains(&stage);
        if stage.is_some_and(again) {
            self.own.clear_counts(LEAF_COUNTS)?;
        }
        let dispatch = |work| dispatch(pipelines, work, self.max_groups);
        let all = work.iter().map(dispatch).collect::<Result<Vec<_>>>()?;
        self.own.dispatch(&all, find)?;
        self.open = stage == Some(Stage::Interpolate);
        match stage.filter(|_| !self.open) {
            Some(stage) => self.end(stage),
            None => Ok(()),
        }
    }

    /// Records a stage that is not a list of kernels.
    pub fn record_as(
        &mut self,
        stage: Stage,
        record: impl FnOnce(&mut D::Slot) -> Result<()>,
    ) -> Result<()> {
        self.close()?;
        record(&mut self.own)?;
        self.end(stage)
    }

    /// Ends `interpolate` if it is open, because the following work must not run concurrently with it.
    fn close(&mut self) -> Result<()> {
        match std::mem::take(&mut self.open) {
            true => self.end(Stage::Interpolate),
            false => Ok(()),
        }
    }

    fn end(&mut self, stage: Stage) -> Result<()> {
        self.stages.push(stage);
        self.own.end_stage(stage)
    }

    /// Records that the positions recorded so far are copied to the host.
    pub(crate) fn split(&mut self) -> Result<()> {
        if !D::Slot::SPLITS {
            return Ok(());
        }
        self.close()?;
        self.own.split()
    }
}

fn dispatch<'a, D: GpuDevice>(
    pipelines: &'a Pipelines<D>,
    work: &'a Work,
    limit: u32,
) -> Result<Dispatch<'a, D>> {
    let refused = |need: u32| BackendError::Limit {
        what: format!("kernel {} (workgroups along an axis)", work.kernel.name),
        need: need.into(),
        limit: limit.into(),
    };
    Ok(Dispatch {
        work,
        pipeline: pipelines.get(work.kernel),
        groups: work.group_counts(limit).map_err(refused)?,
    })
}

impl<D: GpuDevice> Frames<D> {
    pub(crate) fn new(gpu: &D) -> Result<Self> {
        Ok(Self {
            slots: (0..SLOTS).map(|_| Slot::new(gpu)).collect::<Result<_>>()?,
            recording: false,
            submitted: Ticket(0),
            pending: Vec::new(),
            refused: Vec::new(),
            kept: FRAMES_IN_FLIGHT,
            ledger: VecDeque::new(),
            tree_stats: TreeStats::default(),
            raster_backoff: RasterBackoff::default(),
            spread: false,
            clock: gpu.clock(),
        })
    }

    /// Returns the index of the slot of the current or next recording.
    fn place(&self) -> usize {
        self.submitted.0 as usize % SLOTS
    }

    /// Returns the slot of the recording, and begins one if needed.
    pub fn record(&mut self) -> Result<&mut Slot<D>> {
        let place = self.place();
        let slot = &mut self.slots[place];
        if !self.recording {
            slot.begin()?;
            self.recording = true;
        }
        Ok(slot)
    }

    /// Returns the bytes of device memory of all slots and traces.
    pub(crate) fn bytes(&self) -> u64 {
        let slots = self.slots.iter().map(|slot| slot.own.bytes());
        let kept = self.ledger.iter().flat_map(|s| &s.traces);
        let traces = kept.chain(&self.pending).chain(&self.refused);
        slots.chain(traces.map(Trace::held)).sum()
    }

    /// Refuses all traces of a batch because one of them failed.
    pub(crate) fn refuse_pending(&mut self) {
        self.refused.append(&mut self.pending);
    }

    /// Drops the recording.
    pub(crate) fn abandon(&mut self) {
        self.recording = false;
        self.pending.clear();
        self.refused.clear();
    }

    /// Returns a trace that the device has finished and whose results are no longer available: a released one, or one
    /// that expires with the next submission.
    pub fn expired(&mut self) -> Option<Trace<D>> {
        let mut traced = self.ledger.iter().filter(|s| s.is_traced).count();
        let kept = self.kept;
        let found = self.ledger.iter_mut().find(|submission| {
            traced -= usize::from(submission.is_traced);
            let is_old = submission.is_released || traced >= kept;
            is_old && submission.report.is_some() && !submission.traces.is_empty()
        });
        found.map(|submission| submission.traces.remove(0))
    }

    /// See [`backend::Backend::keep`].
    pub(crate) fn keep(&mut self, traces: usize) {
        self.kept = traces.max(FRAMES_IN_FLIGHT);
        self.forget_the_old();
    }

    /// See [`backend::Backend::release`].
    pub(crate) fn release(&mut self, ticket: Ticket) {
        if let Some(submission) = self.ledger.iter_mut().find(|s| s.ticket == ticket) {
            (submission.is_traced, submission.is_released) = (false, true);
            self.forget_the_old();
        }
    }

    /// Returns the trace of query `place` of a submission.
    ///
    /// # Panics
    /// If the submission had no such trace or has expired.
    pub(crate) fn trace(&mut self, ticket: Ticket, place: usize) -> &mut Trace<D> {
        let submission = self.ledger.iter_mut().find(|s| s.ticket == ticket);
        let found = submission.and_then(|s| s.traces.get_mut(place));
        found.expect("this submission had no trace, or was too long ago")
    }

    /// Submits the recording with the requested positions. Waits for the oldest submission if too many are unfinished.
    /// The submission is remembered for `kept` further submissions that contain a trace.
    pub(crate) fn submit(
        &mut self,
        gpu: &mut D,
        positions: Option<(&D::Buffer, u64)>,
        never_active: u64,
    ) -> Result<(Ticket, Option<D::Copy>)> {
        self.record()?.close()?;
        while self.under_way().count() >= FRAMES_IN_FLIGHT {
            let oldest = self.under_way().next();
            self.finish(gpu, oldest.expect("counted just now"))?;
        }
        let ticket = Ticket(self.submitted.0 + 1);
        let place = self.place();
        let (slot, at) = (&mut self.slots[place], Instant::now());
        slot.readback_bytes = positions.map_or(0, |(_, bytes)| bytes);
        let copy = gpu.submit(&mut slot.own, ticket, positions)?;
        self.recording = false;
        self.submitted = ticket;
        let mut traces = std::mem::take(&mut self.pending);
        traces.append(&mut self.refused);
        self.ledger.push_back(Submission {
            ticket,
            is_traced: !traces.is_empty(),
            is_released: false,
            traces,
            never_active,
            at,
            report: None,
        });
        self.forget_the_old();
        Ok((ticket, copy))
    }

    /// Returns the submissions that were not seen to finish.
    pub(crate) fn under_way(&self) -> impl Iterator<Item = Ticket> + '_ {
        let open = self.ledger.iter().filter(|s| s.report.is_none());
        open.map(|s| s.ticket)
    }

    /// Forgets submissions whose command buffers the program dropped, and returns their tickets.
    pub(crate) fn give_up_dropped(&mut self, gpu: &mut D) -> Vec<Ticket> {
        let mut dropped = Vec::new();
        for submission in self.ledger.iter_mut().filter(|s| s.report.is_none()) {
            let slot = &mut self.slots[(submission.ticket.0 - 1) as usize % SLOTS];
            if gpu.give_up_dropped(&mut slot.own, submission.ticket) {
                submission.report = Some(FrameReport::default());
                dropped.push(submission.ticket);
            }
        }
        dropped
    }

    /// Forgets finished submissions that have expired, and released traces beyond the number that is kept.
    fn forget_the_old(&mut self) {
        let mut further = self.ledger.len();
        let mut traced = self.ledger.iter().filter(|s| s.is_traced).count();
        let mut spares = 0;
        for submission in self.ledger.iter_mut().rev() {
            if submission.is_released && submission.report.is_some() {
                submission.traces.truncate(self.kept - spares);
                spares += submission.traces.len();
            }
        }
        self.ledger.retain(|submission| {
            further -= 1;
            traced -= usize::from(submission.is_traced);
            let is_kept = if submission.is_released {
                further <= FRAMES_IN_FLIGHT || !submission.traces.is_empty()
            } else {
                traced <= self.kept
            };
            is_kept || submission.report.is_none()
        });
    }

    /// Waits for a submission, and so for all before it.
    fn finish(&mut self, gpu: &mut D, ticket: Ticket) -> Result<()> {
        let open = |s: &&mut Submission<D>| s.ticket <= ticket && s.report.is_none();
        for submission in self.ledger.iter_mut().filter(open) {
            let slot = &mut self.slots[(submission.ticket.0 - 1) as usize % SLOTS];
            let done = gpu.finish(&mut slot.own, submission.ticket)?;
            let times = match &done.ticks {
                Some(ticks) => self.clock.times(&done.marks, ticks, &slot.idle),
                // Without a device clock, use the host's.
                None => StageTimes {
                    device_ms: submission.at.elapsed().as_secs_f64() * 1e3,
                    ..StageTimes::default()
                },
            };
            let counts = done.counts;
            let mut report = FrameReport {
                times,
                hits: u64::from(counts.hits),
                blocked: u64::from(counts.blocked),
                settled: counts.settled(),
                readback_bytes: slot.readback_bytes,
                ..FrameReport::default()
            };
            let counted = (&counts, slot.extents);
            self.tree_stats
                .complete(&mut report, counted, submission.never_active);
            self.raster_backoff.note(&counts);
            self.spread = counts.is_spread().unwrap_or(self.spread);
            submission.report = Some(report);
        }
        Ok(())
    }

    /// Returns whether a submission has finished. Never blocks.
    ///
    /// # Panics
    /// If the ticket is unknown or has expired.
    pub(crate) fn is_done(&self, gpu: &D, ticket: Ticket) -> Result<bool> {
        let found = self.ledger.iter().find(|s| s.ticket == ticket);
        let submission = found.expect("this ticket was never given, or was given too long ago");
        let slot = &self.slots[(ticket.0 - 1) as usize % SLOTS];
        match submission.report {
            Some(_) => Ok(true),
            None => gpu.is_done(&slot.own, ticket),
        }
    }

    /// Waits for a submission, and so for all before it, and returns its report.
    ///
    /// # Panics
    /// If the ticket is unknown or has expired.
    pub(crate) fn retire(&mut self, gpu: &mut D, ticket: Ticket) -> Result<FrameReport> {
        self.finish(gpu, ticket)?;
        let found = self.ledger.iter().find(|s| s.ticket == ticket);
        let report = found.and_then(|s| s.report.clone());
        Ok(report.expect("this ticket was never given, or was given too long ago"))
    }

    /// Waits for all submissions and forgets them, before another scene is loaded.
    pub(crate) fn unload(&mut self, gpu: &mut D) -> Result<()> {
        if let Some(last) = self.ledger.back().map(|s| s.ticket) {
            self.finish(gpu, last)?;
        }
        self.ledger.clear();
        self.kept = FRAMES_IN_FLIGHT;
        self.tree_stats = TreeStats::default();
        self.raster_backoff = RasterBackoff::default();
        self.spread = false;
        gpu.unload()?;
        self.slots.iter_mut().for_each(|slot| slot.own.forget());
        Ok(())
    }
}
