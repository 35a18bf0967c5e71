//! Commands that go into an encoder of the program's, which submits it itself.

use crate::buffers::{Mapping, PositionsCopy, copy, readback};
use crate::gpu::Gpu;
use crate::slot::Slot;
use crate::wgpu_device::WgpuDevice;
use backend::{Result, Ticket};
use gpu_common::Sent;
use std::collections::VecDeque;
use wgpu::{Buffer, CommandEncoder, SubmissionIndex};

/// The encoder that the next submission goes into, and submissions that went into others.
#[derive(Default)]
pub(crate) struct LentEncoder {
    encoder: Option<CommandEncoder>,
    /// Not seen to be done, the oldest first, each with a later place in the queue if one is known.
    under_way: VecDeque<(Ticket, Option<SubmissionIndex>)>,
    /// Buffers that came back while such submissions might read them. What the queue writes would come before these.
    held: Vec<(Ticket, Sent, Buffer)>,
}

impl LentEncoder {
    /// Whether a buffer is to be held that comes back now.
    pub(crate) fn holds(&mut self, what: Sent, buffer: &Buffer) -> bool {
        let newest = self.under_way.back();
        let held = newest.map(|&(ticket, _)| (ticket, what, buffer.clone()));
        self.held.extend(held);
        newest.is_some()
    }

    /// Waits for the submission, if it is such a one and is known to be in the queue.
    pub(crate) fn wait(&mut self, gpu: &Gpu, ticket: Ticket) -> Result<()> {
        let of = self.under_way.iter_mut().find(|(of, _)| *of == ticket);
        match of.and_then(|(_, place)| place.take()) {
            Some(place) => gpu.wait_for(place),
            None => Ok(()),
        }
    }

    /// A submission is done, and so are all before it: gives the buffers that were held for them.
    pub(crate) fn finished(&mut self, ticket: Ticket) -> Vec<(Sent, Buffer)> {
        self.under_way.retain(|(of, _)| *of > ticket);
        let done = self.held.extract_if(.., |(of, ..)| *of <= ticket);
        done.map(|(_, what, buffer)| (what, buffer)).collect()
    }
}

impl WgpuDevice {
    /// Submits a recording, or leaves it in the program's encoder.
    pub(crate) fn submit_or_leave(
        &mut self,
        slot: &mut Slot,
        ticket: Ticket,
        positions: Option<(&Buffer, u64)>,
    ) -> Result<Option<PositionsCopy>> {
        let Some(mut encoder) = self.take_encoder() else {
            let mut encoder = self.gpu.encoder("a frame")?;
            let copied = self.encode(&mut encoder, slot, positions)?;
            slot.submit(&self.gpu, encoder)?;
            let ask = |buffer| {
                let mapping = Mapping::ask(&self.gpu, &buffer)?;
                Ok(PositionsCopy { buffer, mapping })
            };
            return copied.map(ask).transpose();
        };
        let encoded = self.encode(&mut encoder, slot, positions);
        let copy = encoded.map(|copied| {
            slot.leave(&encoder);
            copied.map(|buffer| {
                let mapping = Mapping::on_submit(&encoder, &buffer, wgpu::MapMode::Read);
                PositionsCopy { buffer, mapping }
            })
        });
        self.encoder.encoder = Some(encoder);
        let under_way = copy.is_ok().then_some((ticket, None));
        self.encoder.under_way.extend(under_way);
        copy
    }

    /// Writes a recording into an encoder; gives the buffer that the positions are copied to.
    fn encode(
        &mut self,
        encoder: &mut CommandEncoder,
        slot: &mut Slot,
        positions: Option<(&Buffer, u64)>,
    ) -> Result<Option<Buffer>> {
        let gpu = &self.gpu;
        self.points.encode(gpu, encoder)?;
        slot.encode(gpu, encoder)?;
        let Some((from, bytes)) = positions else {
            return Ok(None);
        };
        let spare = self.spares.pop().and_then(|s| s.unmapped(&gpu.device));
        let buffer = match spare.filter(|b| b.size() >= bytes) {
            Some(buffer) => buffer,
            None => readback(gpu, "vertices for the builder", bytes)?,
        };
        copy(gpu, encoder, [(from, 0), (&buffer, 0)], bytes)?;
        Ok(Some(buffer))
    }

    /// Commands of nothing yet.
    ///
    /// # Errors
    /// The device is lost.
    pub fn encoder(&self) -> Result<CommandEncoder> {
        self.gpu.encoder("nothing")
    }

    /// Has the next submission go into this encoder instead of the queue. What went into the one before should be in the
    /// queue by now.
    ///
    /// # Errors
    /// The device is lost.
    pub fn lend_encoder(&mut self, encoder: CommandEncoder) -> Result<()> {
        let lent = &mut self.encoder;
        lent.encoder = Some(encoder);
        if let Some((_, place @ None)) = lent.under_way.back_mut() {
            // Of a program's own submission nobody tells the place.
            *place = Some(self.gpu.submit([])?);
        }
        Ok(())
    }

    /// The encoder lent last, unless it was taken back.
    pub fn take_encoder(&mut self) -> Option<CommandEncoder> {
        self.encoder.encoder.take()
    }

    /// Whether encoders with submissions are not seen to be done.
    pub fn has_encoded(&self) -> bool {
        !self.encoder.under_way.is_empty()
    }
}
