//! Submissions under way, and the reports of those that are done.

use crate::device::Gpu;
use crate::slot::Slot;
use backend::{FRAMES_IN_FLIGHT, FrameReport, Result, Ticket};
use shaders::{RasterBackoff, TreeStats};
use std::collections::VecDeque;

/// One slot more than may be under way, so that recording never waits.
const SLOTS: usize = FRAMES_IN_FLIGHT + 1;

/// The slots, in a ring, and what became of their submissions.
pub(crate) struct Frames {
    slots: Vec<Slot>,
    recording: bool,
    submitted: u64,
    /// Submissions with a trace so far.
    traces: u64,
    /// From the oldest that is remembered to the newest.
    ledger: VecDeque<Entry>,
    tree_stats: TreeStats,
    /// What traces by rasterization said last.
    pub(crate) raster_backoff: RasterBackoff,
}

struct Entry {
    ticket: Ticket,
    /// Submissions with a trace, up to and including this one.
    traces: u64,
    /// `None` while it is under way.
    report: Option<FrameReport>,
}

impl Frames {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            slots: (0..SLOTS).map(|_| Slot::new(gpu)).collect::<Result<_>>()?,
            recording: false,
            submitted: 0,
            traces: 0,
            ledger: VecDeque::new(),
            tree_stats: TreeStats::default(),
            raster_backoff: RasterBackoff::default(),
        })
    }

    /// Bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        self.slots.iter().map(Slot::bytes).sum()
    }

    pub(crate) fn is_recording(&self) -> bool {
        self.recording
    }

    /// The slot being recorded, begun if need be.
    pub(crate) fn record(&mut self, gpu: &Gpu) -> Result<&mut Slot> {
        let slot = &mut self.slots[self.submitted as usize % SLOTS];
        if !self.recording {
            slot.begin(gpu)?;
            self.recording = true;
        }
        Ok(slot)
    }

    /// Submits the recording; waits for the oldest submission if too many are under way.
    pub(crate) fn submit(&mut self, gpu: &Gpu, never_active: u64) -> Result<Ticket> {
        let under_way = self.ledger.iter().filter(|e| e.report.is_none());
        if under_way.clone().count() >= FRAMES_IN_FLIGHT {
            let oldest = under_way.map(|e| e.ticket).next();
            self.finish(gpu, oldest.expect("counted just now"), never_active)?;
        }
        self.recording = false;
        self.slots[self.submitted as usize % SLOTS].submit(gpu)?;
        self.submitted += 1;
        Ok(Ticket(self.submitted))
    }

    /// Drops the recording, if there is one.
    pub(crate) fn abandon(&mut self) {
        self.recording = false;
    }

    /// Remembers a submission until enough with a trace came after it.
    pub(crate) fn remember(&mut self, ticket: Ticket, traced: bool) {
        self.traces += u64::from(traced);
        let (traces, report) = (self.traces, None);
        self.ledger.push_back(Entry {
            ticket,
            traces,
            report,
        });
        let old = |e: &Entry| traces - e.traces > FRAMES_IN_FLIGHT as u64 && e.report.is_some();
        while self.ledger.front().is_some_and(old) {
            self.ledger.pop_front();
        }
    }

    /// Waits for a submission, and so for all before it.
    fn finish(&mut self, gpu: &Gpu, ticket: Ticket, never_active: u64) -> Result<()> {
        for entry in self.ledger.iter_mut().filter(|e| e.ticket <= ticket) {
            if entry.report.is_some() {
                continue;
            }
            let slot = &mut self.slots[(entry.ticket.0 - 1) as usize % SLOTS];
            let mut done = slot.finish(gpu)?;
            let counted = (&done.counts, slot.extents);
            self.tree_stats
                .complete(&mut done.report, counted, never_active);
            self.raster_backoff.note(&done.counts);
            entry.report = Some(done.report);
        }
        Ok(())
    }

    /// Waits for a submission, and so for all before it, and says what it did.
    pub(crate) fn retire(
        &mut self,
        gpu: &Gpu,
        ticket: Ticket,
        never_active: u64,
    ) -> Result<FrameReport> {
        self.finish(gpu, ticket, never_active)?;
        let found = self.ledger.iter().find(|e| e.ticket == ticket);
        let report = found.and_then(|e| e.report.clone());
        Ok(report.expect("this ticket was never given, or was given too long ago"))
    }

    /// Waits for all submissions and forgets them: another scene is loaded.
    pub(crate) fn forget(&mut self, gpu: &Gpu) -> Result<()> {
        if let Some(last) = self.ledger.back().map(|e| e.ticket) {
            self.finish(gpu, last, 0)?;
        }
        self.recording = false;
        self.ledger.clear();
        self.tree_stats = TreeStats::default();
        self.raster_backoff = RasterBackoff::default();
        self.slots.iter_mut().for_each(Slot::forget);
        Ok(())
    }
}
