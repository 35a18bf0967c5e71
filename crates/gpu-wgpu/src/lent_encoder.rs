//! Commands that go into an encoder of the program's, which submits it itself.

use crate::buffers::{HostCopy, Mapping};
use crate::gpu::Gpu;
use crate::slot::Slot;
use crate::wgpu_device::WgpuDevice;
use backend::{Result, Ticket};
use std::collections::VecDeque;
use wgpu::{Buffer, CommandEncoder, SubmissionIndex};

/// The encoder that the next submission goes into, and submissions that went into others.
#[derive(Default)]
pub(crate) struct LentEncoder {
    pub(crate) encoder: Option<CommandEncoder>,
    /// Not seen to be done, the oldest first, each with a later place in the queue if one is known.
    pub(crate) under_way: VecDeque<(Ticket, Option<SubmissionIndex>)>,
}

impl LentEncoder {
    /// Whether nothing of the submission, nor of those before it, is under way in an encoder. What the queue writes would come
    /// before those.
    pub(crate) fn is_past(&self, ticket: u64) -> bool {
        self.under_way.iter().all(|(of, _)| of.0 > ticket)
    }

    /// Waits for the submission, if it is such a one and is known to be in the queue.
    pub(crate) fn wait(&mut self, gpu: &Gpu, ticket: Ticket) -> Result<()> {
        let of = self.under_way.iter_mut().find(|(of, _)| *of == ticket);
        match of.and_then(|(_, place)| place.take()) {
            Some(place) => gpu.wait_for(place),
            None => Ok(()),
        }
    }

    /// A submission is done, and so are all before it.
    pub(crate) fn finished(&mut self, ticket: Ticket) {
        self.under_way.retain(|(of, _)| *of > ticket);
    }

    /// A submission was dropped with its encoder.
    pub(crate) fn dropped(&mut self, ticket: Ticket) {
        self.under_way.retain(|(of, _)| *of != ticket);
    }
}

impl WgpuDevice {
    /// Writes a recording into an encoder; gives its report, and the positions that it copies. The encoder of a program leaves
    /// the ticket as a stamp in the report.
    pub(crate) fn encode(
        &mut self,
        encoder: &mut CommandEncoder,
        (slot, stamp): (&mut Slot, Option<Ticket>),
        positions: Option<(&Buffer, u64)>,
    ) -> Result<(Mapping, Option<HostCopy>)> {
        let gpu = &self.gpu;
        self.scene.points.encode(gpu, encoder)?;
        slot.encode(encoder, stamp)?;
        let copy = positions.map(|(from, bytes)| {
            let spare = self.scene.spares.pop();
            let spare = spare.and_then(|s| s.unmapped(&gpu.device));
            let to = ("vertices for the builder", spare);
            HostCopy::record(gpu, encoder, (from, 0..bytes), to)
        });
        let copy = copy.transpose()?;
        Ok((slot.report(encoder), copy))
    }

    /// Commands of nothing yet.
    pub fn encoder(&self) -> Result<CommandEncoder> {
        self.gpu.encoder("nothing")
    }

    /// Has the next submission go into this encoder instead of the queue. What went into the one before should be in the
    /// queue by now.
    pub fn lend_encoder(&mut self, encoder: CommandEncoder) -> Result<()> {
        let lent = &mut self.scene.encoder;
        lent.encoder = Some(encoder);
        if let Some((_, place @ None)) = lent.under_way.back_mut() {
            // Of a program's own submission nobody tells the place.
            *place = Some(self.gpu.submit([])?);
        }
        Ok(())
    }

    /// The encoder lent last, unless it was taken back.
    pub fn take_encoder(&mut self) -> Option<CommandEncoder> {
        self.scene.encoder.encoder.take()
    }

    /// Whether encoders with submissions are not seen to be done.
    pub fn has_encoded(&self) -> bool {
        !self.scene.encoder.under_way.is_empty()
    }
}
