//! Submissions recorded into a command encoder that the program submits itself.

use crate::buffers::{HostCopy, Mapping};
use crate::gpu::Gpu;
use crate::slot::Slot;
use crate::wgpu_device::WgpuDevice;
use backend::{Result, Ticket};
use std::collections::VecDeque;
use wgpu::{Buffer, CommandEncoder, SubmissionIndex};

/// The encoder for the next submission, and the submissions recorded into earlier encoders.
#[derive(Default)]
pub(crate) struct LentEncoder {
    pub(crate) encoder: Option<CommandEncoder>,
    /// Unfinished submissions, oldest first. Each has the index of a later submission to the queue, if one is known.
    pub(crate) under_way: VecDeque<(Ticket, Option<SubmissionIndex>)>,
}

impl LentEncoder {
    /// Returns whether no encoder contains an unfinished submission up to `ticket`. Queue writes would run before such
    /// a submission.
    pub(crate) fn is_past(&self, ticket: u64) -> bool {
        self.under_way.iter().all(|(of, _)| of.0 > ticket)
    }

    /// Waits for a submission in an encoder, if it is known to be in the queue.
    pub(crate) fn wait(&mut self, gpu: &Gpu, ticket: Ticket) -> Result<()> {
        let of = self.under_way.iter_mut().find(|(of, _)| *of == ticket);
        match of.and_then(|(_, place)| place.take()) {
            Some(place) => gpu.wait_for(place),
            None => Ok(()),
        }
    }

    /// Notes that a submission and all before it have finished.
    pub(crate) fn finished(&mut self, ticket: Ticket) {
        self.under_way.retain(|(of, _)| *of > ticket);
    }

    /// Notes that a submission was dropped with its encoder.
    pub(crate) fn dropped(&mut self, ticket: Ticket) {
        self.under_way.retain(|(of, _)| *of != ticket);
    }
}

impl WgpuDevice {
    /// Records a submission into an encoder. Returns the mapping of its report, and the copy of the positions. In a
    /// program's encoder, the report contains the ticket as a stamp.
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

    /// Creates an empty encoder.
    pub fn encoder(&self) -> Result<CommandEncoder> {
        self.gpu.encoder("nothing")
    }

    /// Makes the next submission go into this encoder instead of the queue. The program should have submitted the
    /// previous encoder.
    pub fn lend_encoder(&mut self, encoder: CommandEncoder) -> Result<()> {
        let lent = &mut self.scene.encoder;
        lent.encoder = Some(encoder);
        if let Some((_, place @ None)) = lent.under_way.back_mut() {
            // The index of the program's own submission is unknown, so a later one is used.
            *place = Some(self.gpu.submit([])?);
        }
        Ok(())
    }

    /// Takes back the encoder lent last, unless it was taken already.
    pub fn take_encoder(&mut self) -> Option<CommandEncoder> {
        self.scene.encoder.encoder.take()
    }

    /// Returns whether any encoder contains unfinished submissions.
    pub fn has_encoded(&self) -> bool {
        !self.scene.encoder.under_way.is_empty()
    }
}
