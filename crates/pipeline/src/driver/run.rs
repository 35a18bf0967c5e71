//! Renders sequences of frames and fetches their results.

use super::Driver;
use crate::error::PipelineError;
use crate::frame::{Frame, FrameRecord, ms};
use backend::{DeviceBytes, FRAMES_IN_FLIGHT, Hits, Query, Ticket};
use std::time::Instant;

/// Maximum number of frames whose key frames are read ahead, if not all key frames are in memory.
pub const LOOK_AHEAD: usize = 64;

/// Selects the results to fetch of each frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OutputSelection {
    /// Hits and shadows.
    pub hits: bool,
    /// Pixels. If the backend does not shade, hits and shadows instead.
    pub pixels: bool,
}

impl OutputSelection {
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

/// Results of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameOutputs {
    /// Hits and shadows, if selected, or if the host must shade the selected pixels.
    pub hits: Hits,
    /// Pixels, as [`backend::Backend::pixels`] returns them. `Driver::finish` leaves them empty if the host must shade.
    pub pixels: Vec<u8>,
}

impl Driver {
    /// Renders `frames` in order, with [as many in flight as allowed](Self::max_in_flight). Passes each finished frame
    /// to `on_frame`, with the selected results. `on_frame` may take or replace the buffers of the results. Later
    /// frames reuse the buffers that it leaves.
    ///
    /// # Errors
    /// Those of [`begin`](Self::begin), [`finish`](Self::finish) and `on_frame`.
    pub fn run<E: From<PipelineError>>(
        &mut self,
        frames: impl IntoIterator<Item = Frame>,
        query: Query<'_>,
        selection: OutputSelection,
        mut on_frame: impl FnMut(&FrameRecord, &mut FrameOutputs) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut outputs = FrameOutputs::default();
        let in_flight = self.max_in_flight(&[query]);
        let frames: Vec<Frame> = frames.into_iter().collect();
        let mut finish = |driver: &mut Self| -> Result<bool, E> {
            match driver.finish(selection, &mut outputs)? {
                Some(record) => on_frame(&record, &mut outputs).map(|()| true),
                None => Ok(false),
            }
        };
        for (i, &frame) in frames.iter().enumerate() {
            let next = frames[i..].iter().take(LOOK_AHEAD);
            self.animation.look_ahead(next.map(|frame| frame.time));
            self.begin(frame, &[query])?;
            if self.pending.len() >= in_flight {
                finish(self)?;
            }
        }
        while finish(self)? {}
        Ok(())
    }

    /// Waits for the oldest frame in flight and writes the selected results to `outputs`. The backend
    /// reuses the previous memory of `outputs`. Returns `None` if no frame is in flight.
    ///
    /// # Errors
    /// Those of the backend. If the wait fails, the frame stays in flight, and the next call waits for it again.
    pub fn finish(
        &mut self,
        selection: OutputSelection,
        outputs: &mut FrameOutputs,
    ) -> Result<Option<FrameRecord>, PipelineError> {
        let Some(oldest) = self.in_flight().next() else {
            return Ok(None);
        };
        let wait_started = Instant::now();
        let report = self.backend.wait(oldest)?;
        let waited = wait_started.elapsed();
        let pending = self.pending.pop_front().expect("a frame is in flight");
        self.process_costs(pending.ticket, &report);
        self.fetch(pending.ticket, selection, outputs)?;
        self.poll_builder_after_frame();
        let mut record = pending.record;
        record.wall_ms += ms(waited);
        record.device_memory = self.backend.memory().held;
        record.device_bytes = record.device_memory.map(DeviceBytes::total);
        record.tree.sah_ratio = report.sah_cost.map(|now| {
            let when_built = pending.cost_when_built.filter(|&c| c > 0.0);
            when_built.map_or(1.0, |when_built| now / when_built)
        });
        record.complete(report);
        Ok(Some(record))
    }

    /// Returns the tickets of the frames in flight, oldest first.
    pub fn in_flight(&self) -> impl ExactSizeIterator<Item = Ticket> {
        self.pending.iter().map(|frame| frame.ticket)
    }

    /// Returns how many frames with these queries may be in flight, including the next one to [begin](Self::begin).
    pub fn max_in_flight(&self, queries: &[Query<'_>]) -> usize {
        // A frame that waits for its own tree or positions takes several submissions, so no other frame may be
        // unfinished.
        if self.options.update.waits_for_tree() || self.must_measure_coordinate_range(queries) {
            1
        } else {
            FRAMES_IN_FLIGHT
        }
    }

    fn fetch(
        &mut self,
        ticket: Ticket,
        selection: OutputSelection,
        outputs: &mut FrameOutputs,
    ) -> backend::Result<()> {
        let shaded = selection.pixels && self.backend.pixels(ticket, &mut outputs.pixels)?;
        if !shaded {
            outputs.pixels.clear();
        }
        if selection.hits || (selection.pixels && !shaded) {
            self.backend.take_hits(ticket, 0, &mut outputs.hits)?;
        }
        Ok(())
    }
}
