//! Frames one after another, and what is fetched of each.

use super::{Driver, PipelineError};
use crate::frame::{Frame, FrameRecord};
use backend::{FRAMES_IN_FLIGHT, Hits, Query, Ticket};

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
    /// Renders `frames` in order, keeping as many under way as the backend allows,
    /// and hands each to `on_frame` when it is done, with what is wanted of it, in the memory that `on_frame` leaves in
    /// place of the last answers.
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
        let under_way = self.most_under_way();
        let frames: Vec<Frame> = frames.into_iter().collect();
        let mut finish = |driver: &mut Self| -> Result<bool, E> {
            let Some(record) = driver.finish_frame(wanted, &mut answers)? else {
                return Ok(false);
            };
            on_frame(&record, &mut answers)?;
            Ok(true)
        };
        for (i, &frame) in frames.iter().enumerate() {
            let next = frames[i..].iter().take(LOOK_AHEAD);
            self.animation.look_ahead(next.map(|frame| frame.time));
            self.begin(frame, query)?;
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
    pub fn finish_frame(
        &mut self,
        wanted: Wanted,
        answers: &mut Answers,
    ) -> Result<Option<FrameRecord>, PipelineError> {
        self.end(|driver, ticket| driver.fetch(ticket, wanted, answers))
    }

    /// Frames that may be under way when another is [begun](Self::begin), that one included.
    pub fn most_under_way(&self) -> usize {
        // A frame that waits for its own tree takes two submissions, so none may be left open before it.
        match self.schedule.waits_at_once() && !self.makes_trees() {
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
        match wanted.hits || (wanted.pixels && !shaded) {
            true => self.take_hits(ticket, &mut answers.hits),
            false => Ok(()),
        }
    }
}
