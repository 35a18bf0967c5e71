//! Submissions under way, and the reports of those that are done.

use crate::clock::Clock;
use crate::device::Gpu;
use crate::slot::Slot;
use crate::timeline::{Batch, Moment, Timeline, submit};
use backend::{FRAMES_IN_FLIGHT, FrameReport, Result, Ticket};
use shaders::{Counts, RasterBackoff, TreeStats};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

/// One slot more than may be under way, so that recording never waits.
pub(crate) const SLOTS: usize = FRAMES_IN_FLIGHT + 1;

/// The slots, in a ring, and what became of their submissions.
pub(crate) struct Frames {
    slots: Vec<Slot>,
    recording: bool,
    submitted: u64,
    /// Submissions with a trace so far.
    traces: u64,
    /// From the oldest that is remembered to the newest.
    ledger: VecDeque<Entry>,
    /// What preprocess and refit said last.
    last: TreeStats,
    /// What traces by rasterization said last.
    pub(crate) raster_backoff: RasterBackoff,
    clock: Clock,
    /// Reaches a ticket's number when its submission is done.
    done: Timeline,
    /// Likewise, when the part of it is that somebody waits for alone.
    first_part: Timeline,
    gpu: Arc<Gpu>,
}

struct Entry {
    ticket: Ticket,
    /// Submissions with a trace, up to and including this one.
    traces: u64,
    never_active: u64,
    /// `None` while it is under way.
    report: Option<FrameReport>,
}

impl Frames {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            slots: (0..SLOTS).map(|_| Slot::new(gpu)).collect::<Result<_>>()?,
            recording: false,
            submitted: 0,
            traces: 0,
            ledger: VecDeque::new(),
            last: TreeStats::default(),
            raster_backoff: RasterBackoff::default(),
            clock: Clock::new(gpu.timestamp_bits, gpu.limits.tick_ns),
            done: Timeline::new(gpu)?,
            first_part: Timeline::new(gpu)?,
            gpu: Arc::clone(gpu),
        })
    }

    pub(crate) fn is_recording(&self) -> bool {
        self.recording
    }

    /// Which of so many [`SLOTS`] the recording takes, or the next one will.
    pub(crate) fn place(&self) -> usize {
        self.submitted as usize % SLOTS
    }

    /// The ticket that the recording gets, or the next one.
    pub(crate) fn next(&self) -> Ticket {
        Ticket(self.submitted + 1)
    }

    /// The slot being recorded, begun if need be.
    pub(crate) fn record(&mut self) -> Result<&mut Slot> {
        let place = self.place();
        let slot = &mut self.slots[place];
        if !self.recording {
            slot.begin()?;
            self.recording = true;
        }
        Ok(slot)
    }

    /// Submits the recording, to begin after some moments; waits for the oldest
    /// submission if too many are under way. Remembers it until enough with a trace came after it.
    pub(crate) fn submit(
        &mut self,
        after: &[Moment],
        traced: bool,
        never_active: u64,
    ) -> Result<Ticket> {
        while self.under_way().count() >= FRAMES_IN_FLIGHT {
            let oldest = self.under_way().next();
            self.finish(oldest.expect("counted just now"))?;
        }
        let ticket = self.next();
        self.send(after, ticket)?;
        self.recording = false;
        self.submitted = ticket.0;
        self.traces += u64::from(traced);
        self.ledger.push_back(Entry {
            ticket,
            traces: self.traces,
            never_active,
            report: None,
        });
        self.forget_the_old();
        Ok(ticket)
    }

    /// Sends the recording's parts; others may wait for one of them alone.
    fn send(&mut self, after: &[Moment], ticket: Ticket) -> Result<()> {
        let place = self.place();
        let slot = &mut self.slots[place];
        slot.sent = Some(Instant::now());
        slot.end()?;
        let parts = slot.parts();
        let batch = |(i, &commands)| Batch {
            commands,
            after: if i == 0 { after } else { &[] },
            done: match i + 1 == parts.len() {
                true => self.done.at(ticket.0),
                false => self.first_part.at(ticket.0),
            },
        };
        let batches: Vec<_> = parts.iter().enumerate().map(batch).collect();
        submit(&self.gpu, self.gpu.compute, &batches)
    }

    /// Submissions that were not seen to be done.
    pub(crate) fn under_way(&self) -> impl Iterator<Item = Ticket> + '_ {
        let open = self.ledger.iter().filter(|e| e.report.is_none());
        open.map(|e| e.ticket)
    }

    fn forget_the_old(&mut self) {
        let traces = self.traces;
        let old = |e: &Entry| traces - e.traces > FRAMES_IN_FLIGHT as u64 && e.report.is_some();
        while self.ledger.front().is_some_and(old) {
            self.ledger.pop_front();
        }
    }

    /// When the first part of a submission of two is done.
    pub(crate) fn first_part(&self, ticket: Ticket) -> Moment {
        self.first_part.at(ticket.0)
    }

    /// Whether a submission is done. Never waits.
    pub(crate) fn is_done(&self, ticket: Ticket) -> Result<bool> {
        self.done.has_reached(ticket.0)
    }

    /// Waits for a submission without asking what it did.
    pub(crate) fn wait(&self, ticket: Ticket) -> Result<()> {
        self.done.wait(ticket.0)
    }

    /// Waits for a submission, and so for all before it.
    fn finish(&mut self, ticket: Ticket) -> Result<()> {
        for entry in self.ledger.iter_mut().filter(|e| e.ticket <= ticket) {
            if entry.report.is_some() {
                continue;
            }
            self.done.wait(entry.ticket.0)?;
            let slot = &self.slots[(entry.ticket.0 - 1) as usize % SLOTS];
            let (report, counts) =
                report(slot, &mut self.clock, &mut self.last, entry.never_active)?;
            self.raster_backoff.note(&counts);
            entry.report = Some(report);
        }
        Ok(())
    }

    /// Waits for a submission, and so for all before it, and says what it did.
    pub(crate) fn retire(&mut self, ticket: Ticket) -> Result<FrameReport> {
        self.finish(ticket)?;
        let found = self.ledger.iter().find(|e| e.ticket == ticket);
        let report = found.and_then(|e| e.report.clone());
        Ok(report.expect("this ticket was never given, or was given too long ago"))
    }

    /// Drops the recording, if there is one.
    pub(crate) fn abandon(&mut self) {
        self.recording = false;
    }

    /// Forgets all submissions: another scene is loaded. The device must be idle.
    pub(crate) fn forget(&mut self) {
        self.recording = false;
        self.ledger.clear();
        self.last = TreeStats::default();
        self.raster_backoff = RasterBackoff::default();
    }
}

/// What a finished submission did; submissions are asked in their order.
fn report(
    slot: &Slot,
    clock: &mut Clock,
    last: &mut TreeStats,
    never_active: u64,
) -> Result<(FrameReport, Counts)> {
    let done = slot.done()?;
    let mut times = clock.times(done.stages, &done.marks);
    if done.marks.is_empty() {
        // A device without a clock: the host's has to do.
        let since = slot.sent.map_or(0.0, |at| at.elapsed().as_secs_f64());
        times.device_ms = since * 1e3;
    }
    let counts = done.counts;
    let mut report = FrameReport {
        times,
        hits: u64::from(counts.hits),
        blocked: u64::from(counts.blocked),
        settled: counts.settled(),
        readback_bytes: slot.readback_bytes,
        ..FrameReport::default()
    };
    last.complete(&mut report, (&counts, slot.extents), never_active);
    Ok((report, counts))
}
