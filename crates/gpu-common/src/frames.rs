//! The recording, unfinished submissions, and the reports and traces of finished ones.

use crate::recorder::{Recorder, TreeStages};
use crate::{Clock, GpuDevice, Outcome, PendingWork, Stage, SubmissionOutput, TraceBuffers};
use backend::{BackendError, FRAMES_IN_FLIGHT, FrameReport, Result, StageTimes, Ticket};
use shaders::RasterBackoff;
use std::collections::VecDeque;
use std::time::Instant;

/// The recording, and the results of submissions.
pub struct Frames<D: GpuDevice> {
    /// The recording.
    pub recorder: Recorder<D>,
    /// Last submitted ticket.
    pub(crate) submitted: Ticket,
    /// Number of the upload that the next submission must wait for; 0 for no upload.
    awaited_upload: u64,
    /// Traces that are recorded but not yet submitted, in order.
    pub pending: Vec<TraceBuffers<D>>,
    /// Traces of a batch in which one query failed. Recorded commands still use their buffers.
    refused: Vec<TraceBuffers<D>>,
    /// Buffers that were replaced, each with the last ticket that may use it.
    replaced: Vec<(Ticket, D::Buffer)>,
    /// Maximum number of released traces whose buffers are kept for later traces.
    spare_traces: usize,
    /// Remembered submissions, oldest first.
    ledger: VecDeque<SubmissionRecord<D>>,
    /// Report of the last finished submission.
    latest: FrameReport,
    /// Whether the next traces may use rasterization.
    pub(crate) raster_backoff: RasterBackoff,
    /// Whether coordinates have very different magnitudes, by the latest measurement.
    pub(crate) spread: bool,
    clock: Clock,
}

struct SubmissionRecord<D: GpuDevice> {
    ticket: Ticket,
    traces: Vec<TraceBuffers<D>>,
    /// Whether it has traces that were not released.
    is_traced: bool,
    /// Whether the last call of [`backend::Backend::retain_traces`] named it.
    is_retained: bool,
    /// See [`backend::Backend::retain_traces`]. A released trace only keeps its buffers for later traces.
    is_released: bool,
    at: Instant,
    /// Stages without work.
    idle: Vec<Stage>,
    tree_stages: TreeStages,
    readback_bytes: u64,
    /// `None` until the submission has finished.
    report: Option<FrameReport>,
}

impl<D: GpuDevice> Frames<D> {
    pub(crate) fn new(gpu: &D) -> Self {
        let info = gpu.info();
        Self {
            clock: info.clock,
            recorder: Recorder::new(&info),
            submitted: Ticket(0),
            awaited_upload: 0,
            pending: Vec::new(),
            refused: Vec::new(),
            replaced: Vec::new(),
            spare_traces: FRAMES_IN_FLIGHT,
            ledger: VecDeque::new(),
            latest: FrameReport::default(),
            raster_backoff: RasterBackoff::default(),
            spread: false,
        }
    }

    /// Makes the next submission wait for this upload and all uploads before it.
    pub(crate) fn await_upload(&mut self, upload_value: u64) {
        self.awaited_upload = self.awaited_upload.max(upload_value);
    }

    /// Drops buffers once the work recorded so far no longer uses them.
    pub(crate) fn drop_when_unused(&mut self, buffers: impl IntoIterator<Item = D::Buffer>) {
        let last = Ticket(self.submitted.0 + 1);
        self.replaced.extend(buffers.into_iter().map(|b| (last, b)));
    }

    /// Returns the bytes of device memory of all traces and replaced buffers.
    pub(crate) fn bytes(&self) -> u64 {
        let kept = self.ledger.iter().flat_map(|s| &s.traces);
        let traces = kept.chain(&self.pending).chain(&self.refused);
        let replaced = self.replaced.iter().map(|(_, b)| D::size(b).allocated);
        traces.map(TraceBuffers::held).chain(replaced).sum()
    }

    /// Makes all traces of a batch unavailable because one query failed.
    pub(crate) fn refuse_pending(&mut self) {
        self.refused.append(&mut self.pending);
    }

    /// Drops the recording.
    pub(crate) fn abandon(&mut self) {
        self.recorder.abandon();
        self.pending.clear();
        self.refused.clear();
    }

    /// Removes and returns a finished trace whose results are no longer available, to reuse its buffers: a released
    /// one, or one with at least [`FRAMES_IN_FLIGHT`] later submissions with traces.
    pub fn expired(&mut self) -> Option<TraceBuffers<D>> {
        let mut later_traced = self.ledger.iter().filter(|s| s.is_traced).count();
        let found = self.ledger.iter_mut().find(|submission| {
            later_traced -= usize::from(submission.is_traced);
            let is_old = submission.is_released || later_traced >= FRAMES_IN_FLIGHT;
            is_old
                && !submission.is_retained
                && submission.report.is_some()
                && !submission.traces.is_empty()
        });
        found.map(|submission| submission.traces.remove(0))
    }

    /// See [`backend::Backend::retain_traces`].
    pub(crate) fn retain(&mut self, tickets: &[Ticket]) {
        self.spare_traces = FRAMES_IN_FLIGHT.max(tickets.len() + 1);
        for submission in &mut self.ledger {
            let was_retained = submission.is_retained;
            submission.is_retained = tickets.binary_search(&submission.ticket).is_ok();
            if was_retained && !submission.is_retained {
                (submission.is_traced, submission.is_released) = (false, true);
            }
        }
        self.drop_expired();
    }

    /// Returns the trace of query `index` of a submission.
    ///
    /// # Panics
    /// If the submission had no such trace or has expired.
    pub(crate) fn trace(&mut self, ticket: Ticket, index: usize) -> &mut TraceBuffers<D> {
        let submission = self.ledger.iter_mut().find(|s| s.ticket == ticket);
        let found = submission.and_then(|s| s.traces.get_mut(index));
        found.expect("the submission has no such trace or has expired")
    }

    /// Submits the recording. Copies `positions`, a buffer and a number of bytes, to the host. Waits until at most one
    /// earlier submission is unfinished. [`backend::Backend::retain_traces`] determines when the submission expires.
    pub(crate) fn submit(
        &mut self,
        gpu: &mut D,
        positions: Option<(&D::Buffer, u64)>,
    ) -> Result<Ticket> {
        self.recorder.close();
        let ticket = Ticket(self.submitted.0 + 1);
        // The device reuses the resources of submission `earlier`. So wait for it, even if it is the only unfinished
        // one because the one after it was dropped.
        let earlier = ticket.0.saturating_sub(FRAMES_IN_FLIGHT as u64);
        self.finish(gpu, Ticket(earlier))?;
        let at = Instant::now();
        let recording = self.recorder.complete(positions, self.awaited_upload);
        gpu.submit(recording, ticket)?;
        self.awaited_upload = 0;
        self.submitted = ticket;
        let mut traces = std::mem::take(&mut self.pending);
        let is_traced = !traces.is_empty();
        traces.append(&mut self.refused);
        self.ledger.push_back(SubmissionRecord {
            ticket,
            is_traced,
            is_retained: false,
            is_released: !is_traced && !traces.is_empty(),
            traces,
            at,
            idle: std::mem::take(&mut self.recorder.idle),
            tree_stages: self.recorder.tree_stages,
            readback_bytes: positions.map_or(0, |(_, bytes)| bytes),
            report: None,
        });
        self.recorder.abandon();
        self.drop_expired();
        Ok(ticket)
    }

    /// Returns the submissions that have no report yet.
    pub(crate) fn unfinished(&self) -> impl Iterator<Item = Ticket> + '_ {
        let open = self.ledger.iter().filter(|s| s.report.is_none());
        open.map(|s| s.ticket)
    }

    /// Returns the tickets of submissions that are known to never run, and gives each an empty report.
    pub(crate) fn remove_dropped(&mut self, gpu: &mut D) -> Vec<Ticket> {
        let mut dropped = Vec::new();
        for ticket in self.unfinished().collect::<Vec<_>>() {
            // An error is returned again when the program waits for the submission.
            if gpu.is_dropped(ticket) && self.finish_one(gpu, ticket).is_ok() {
                self.submission_mut(ticket).report = Some(FrameReport::default());
                dropped.push(ticket);
            }
        }
        dropped
    }

    fn submission_mut(&mut self, ticket: Ticket) -> &mut SubmissionRecord<D> {
        let mut ledger = self.ledger.iter_mut();
        let found = ledger.find(|s| s.ticket == ticket);
        found.expect("unfinished submissions are remembered")
    }

    /// Drops finished submissions that have expired, and released traces beyond `spare_traces`.
    fn drop_expired(&mut self) {
        let mut later = self.ledger.len();
        let mut later_traced = self.ledger.iter().filter(|s| s.is_traced).count();
        let mut spares = 0;
        for submission in self.ledger.iter_mut().rev() {
            if submission.is_released && submission.report.is_some() {
                submission.traces.truncate(self.spare_traces - spares);
                spares += submission.traces.len();
            }
        }
        self.ledger.retain(|submission| {
            later -= 1;
            later_traced -= usize::from(submission.is_traced);
            let is_available = if submission.is_released {
                later <= FRAMES_IN_FLIGHT || !submission.traces.is_empty()
            } else {
                submission.is_retained || later_traced <= FRAMES_IN_FLIGHT
            };
            is_available || submission.report.is_none()
        });
    }

    /// Waits for a submission and all earlier ones.
    fn finish(&mut self, gpu: &mut D, ticket: Ticket) -> Result<()> {
        let next = |frames: &Self| frames.unfinished().next();
        while let Some(oldest) = next(self).filter(|oldest| *oldest <= ticket) {
            if let Some(why) = self.finish_one(gpu, oldest)? {
                return Err(BackendError::Misuse(why.into()));
            }
        }
        Ok(())
    }

    /// Waits for a submission and completes its report. If the submission never runs, returns the reason.
    fn finish_one(&mut self, gpu: &mut D, ticket: Ticket) -> Result<Option<&'static str>> {
        let outcome = gpu.finish(ticket)?;
        // A dropped submission may end before earlier ones, which may still use replaced buffers.
        if self.unfinished().next() == Some(ticket) {
            self.replaced.retain(|(last, _)| *last > ticket);
        }
        let SubmissionOutput {
            counts,
            marks,
            ticks,
        } = match outcome {
            Outcome::Finished(output) => output,
            Outcome::Dropped(why) => return Ok(Some(why)),
        };
        let mut ledger = self.ledger.iter_mut();
        let submission = ledger.find(|s| s.ticket == ticket);
        let submission = submission.expect("unfinished submissions are remembered");
        let times = match &ticks {
            Some(ticks) => self.clock.times(&marks, ticks, &submission.idle),
            // Without timestamps, use the host's clock.
            None => StageTimes {
                device_ms: submission.at.elapsed().as_secs_f64() * 1e3,
                ..StageTimes::default()
            },
        };
        let mut report = FrameReport {
            times,
            hits: u64::from(counts.hits),
            blocked: u64::from(counts.blocked),
            exact_rays: counts.exact_rays(),
            readback_bytes: submission.readback_bytes,
            candidate_cost: None,
            // The other values stay valid until their stages run again.
            ..self.latest.clone()
        };
        let stages = submission.tree_stages;
        if let Some(skipped_degenerate) = stages.skipped_degenerate {
            report.inactive = u64::from(counts.inactive) + stages.never_active;
            report.degenerate = u64::from(counts.degenerate) + u64::from(skipped_degenerate);
        }
        if stages.summed_areas {
            report.sah_cost = counts.cost(counts.areas);
        }
        if stages.evaluated_candidate {
            report.candidate_cost = counts.cost(counts.candidate_areas);
        }
        self.raster_backoff.update(&counts);
        self.spread = counts.is_spread().unwrap_or(self.spread);
        self.latest = report.clone();
        submission.report = Some(report);
        Ok(None)
    }

    /// Returns whether a submission has finished. Never blocks.
    ///
    /// # Panics
    /// If the ticket is unknown or has expired.
    pub(crate) fn is_done(&self, gpu: &D, ticket: Ticket) -> Result<bool> {
        let found = self.ledger.iter().find(|s| s.ticket == ticket);
        let submission = found.expect("the ticket is unknown or has expired");
        match submission.report {
            Some(_) => Ok(true),
            None => gpu.has_finished(PendingWork::Submission(ticket)),
        }
    }

    /// Waits for a submission and all earlier ones, and returns its report.
    ///
    /// # Panics
    /// If the ticket is unknown or has expired.
    pub(crate) fn retire(&mut self, gpu: &mut D, ticket: Ticket) -> Result<FrameReport> {
        self.finish(gpu, ticket)?;
        let found = self.ledger.iter().find(|s| s.ticket == ticket);
        let report = found.and_then(|s| s.report.clone());
        Ok(report.expect("the ticket is unknown or has expired"))
    }

    /// Waits for all submissions and forgets them, before another scene is loaded.
    pub(crate) fn unload(&mut self, gpu: &mut D) -> Result<()> {
        for ticket in self.unfinished().collect::<Vec<_>>() {
            // The reason why a submission never ran does not matter any more.
            self.finish_one(gpu, ticket)?;
        }
        self.ledger.clear();
        self.spare_traces = FRAMES_IN_FLIGHT;
        self.latest = FrameReport::default();
        self.raster_backoff = RasterBackoff::default();
        self.spread = false;
        gpu.unload()?;
        self.replaced.clear();
        self.awaited_upload = 0;
        Ok(())
    }
}
