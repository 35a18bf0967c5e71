//! Frames one after another, and what is fetched of each.

use super::{Driver, PipelineError};
use crate::frame::{Frame, FrameRecord};
use backend::{FRAMES_IN_FLIGHT, Hits, Query, Ticket};
use std::time::Instant;

/// Frames whose key frames are read before they come, where not all are held.
pub const LOOK_AHEAD: usize = 64;

/// What is fetched of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Hits and shadows.
    pub hits: bool,
    /// Pixels, or hits and shadows where the backend leaves pictures to the host.
    pub pixels: bool,
}

impl Wanted {
    /// Hits and shadows alone.
    pub const HITS: Self = Self {
        hits: true,
        pixels: false,
    };

    /// Pixels alone.
    pub const PIXELS: Self = Self {
        hits: false,
        pixels: true,
    };
}

/// What was fetched of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answers {
    /// Hits and shadows, where they are wanted.
    pub hits: Hits,
    /// As [`backend::Backend::pixels`]; empty where the host is to shade.
    pub pixels: Vec<u8>,
}

impl Driver {
    /// Renders `frames` in order, as many under way as the backend allows, and hands each to `on_frame` when it is done,
    /// with what is wanted of it, in the memory that `on_frame` leaves in place of the last answers.
    ///
    /// # Errors
    /// The backend's, or whatever `on_frame` returns.
    pub fn run<E: From<PipelineError>>(
        &mut self,
        frames: impl IntoIterator<Item = Frame>,
        query: Query<'_>,
        wanted: Wanted,
        mut on_frame: impl FnMut(&FrameRecord, &mut Answers) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut answers = Answers::default();
        let under_way = self.most_under_way(&[query]);
        let frames: Vec<Frame> = frames.into_iter().collect();
        let mut finish = |driver: &mut Self| -> Result<bool, E> {
            match driver.finish(wanted, &mut answers)? {
                Some(record) => on_frame(&record, &mut answers).map(|()| true),
                None => Ok(false),
            }
        };
        for (i, &frame) in frames.iter().enumerate() {
            let next = frames[i..].iter().take(LOOK_AHEAD);
            self.animation.look_ahead(next.map(|frame| frame.time));
            self.begin(frame, &[query])?;
            if self.pending.len() >= under_way {
                finish(self)?;
            }
        }
        while finish(self)? {}
        Ok(())
    }

    /// Waits for the oldest frame under way and takes what is wanted of it, in exchange for the memory of earlier answers;
    /// `None` if there is none.
    ///
    /// # Errors
    /// The backend's.
    pub fn finish(
        &mut self,
        wanted: Wanted,
        answers: &mut Answers,
    ) -> Result<Option<FrameRecord>, PipelineError> {
        let Some(pending) = self.pending.pop_front() else {
            return Ok(None);
        };
        let waited = Instant::now();
        let report = self.backend.wait(pending.ticket)?;
        let seen = Instant::now();
        self.judge(pending.ticket, &report);
        self.fetch(pending.ticket, wanted, answers)?;
        let read = Instant::now();
        self.poll_builder()?;
        let mut record = pending.record;
        record.device_bytes = self.backend.device_bytes();
        record.sah_ratio = report.sah_cost.map(|now| {
            let before = pending.cost_before.filter(|&c| c > 0.0);
            before.map_or(1.0, |before| now / before)
        });
        record.finish(report, [waited, seen, read]);
        Ok(Some(record))
    }

    /// Frames that may be under way when another of such queries is [begun](Self::begin), that one included.
    pub fn most_under_way(&self, queries: &[Query<'_>]) -> usize {
        // A frame that waits for its own tree or positions takes two submissions, so none may be left open before it.
        match self.options.update.waits_at_once() || self.needs_look(queries) {
            true => 1,
            false => FRAMES_IN_FLIGHT,
        }
    }

    fn fetch(
        &mut self,
        ticket: Ticket,
        wanted: Wanted,
        answers: &mut Answers,
    ) -> backend::Result<()> {
        let shaded = wanted.pixels && self.backend.pixels(ticket, &mut answers.pixels)?;
        if !shaded {
            answers.pixels.clear();
        }
        if wanted.hits || (wanted.pixels && !shaded) {
            std::mem::swap(self.backend.hits(ticket)?, &mut answers.hits);
        }
        Ok(())
    }
}
