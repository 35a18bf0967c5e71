//! Trees on their way to the device: whoever builds one writes it, and each submission copies a piece of it first.

use crate::buffers::{Mapping, copy_part, make, unmap, unreadable};
use crate::gpu::Gpu;
use backend::Result;
use std::collections::VecDeque;
use wgpu::{Buffer, BufferUsages, BufferViewMut, CommandEncoder, MapMode};

/// Bytes that one submission copies at least: its frame waits for them.
const PIECE: u64 = 256 << 10;
/// Submissions that one tree goes with at most.
const PIECES: u64 = 32;

/// Memory of the host that the queue copies from.
pub struct Staging {
    view: BufferViewMut,
    buffer: Buffer,
    filled: u64,
}

impl Staging {
    /// Bytes that were written.
    pub(crate) fn filled(&self) -> u64 {
        self.filled
    }

    /// Writes part after part, if there is room for all.
    pub(crate) fn fill(&mut self, parts: &[&[u32]]) -> bool {
        let bytes: usize = parts.iter().map(|part| size_of_val(*part)).sum();
        if bytes > self.view.len() {
            return false;
        }
        let mut at = 0;
        for part in parts {
            let end = at + size_of_val(*part);
            let part = bytemuck::cast_slice(part);
            self.view.slice(at..end).copy_from_slice(part);
            at = end;
        }
        self.filled = bytes as u64;
        true
    }
}

struct Copying {
    number: u64,
    from: Buffer,
    to: Buffer,
    /// Bytes that were copied, and that there are.
    at: u64,
    bytes: u64,
}

/// What is under way.
#[derive(Default)]
pub(crate) struct Sender {
    copies: VecDeque<Copying>,
    /// Of the newest.
    number: u64,
    /// The next submission needs all up to this one.
    expected: u64,
    /// Copied, and soon to be written again.
    used: Option<(Buffer, Mapping)>,
}

impl Sender {
    /// Memory for so many bytes.
    pub(crate) fn staging(&mut self, gpu: &Gpu, bytes: u64) -> Result<Staging> {
        let fits = |buffer: &Buffer| buffer.size() >= bytes;
        let is_back = match &self.used {
            Some((buffer, mapping)) => fits(buffer) && mapping.poll(gpu)?,
            None => false,
        };
        let buffer = match self.used.take_if(|_| is_back) {
            Some((buffer, _)) => buffer,
            None => mapped(gpu, bytes)?,
        };
        Ok(Staging {
            view: buffer.get_mapped_range_mut(..).map_err(unreadable)?,
            buffer,
            filled: 0,
        })
    }

    /// Begins to copy; the number to be expected.
    pub(crate) fn send(&mut self, gpu: &Gpu, staging: Staging, to: &Buffer) -> Result<u64> {
        let Staging {
            view,
            buffer: from,
            filled: bytes,
        } = staging;
        drop(view);
        if !unmap(&gpu.device, &from) {
            return Err(gpu.faults.lose("it took a tree with it".into()));
        }
        self.number += 1;
        self.copies.push_back(Copying {
            number: self.number,
            from,
            to: to.clone(),
            at: 0,
            bytes,
        });
        Ok(self.number)
    }

    pub(crate) fn has_been_sent(&self, number: u64) -> bool {
        self.copies.iter().all(|copying| copying.number != number)
    }

    pub(crate) fn expect(&mut self, number: u64) {
        self.expected = self.expected.max(number);
    }

    /// A buffer is needed for something else.
    pub(crate) fn give_up(&mut self, to: &Buffer) {
        self.copies.retain(|copying| copying.to != *to);
    }

    /// What goes before the next submission.
    pub(crate) fn pieces(&mut self, gpu: &Gpu) -> Result<Option<CommandEncoder>> {
        let Some(number) = self.copies.front().map(|copying| copying.number) else {
            return Ok(None);
        };
        let mut encoder = gpu.encoder("a tree")?;
        let last = self.expected.max(number);
        let due = self.copies.iter_mut().filter(|c| c.number <= last);
        for copying in due {
            let left = copying.bytes - copying.at;
            let share = (copying.bytes / PIECES).next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT);
            let piece = match copying.number <= self.expected {
                true => left,
                false => left.min(PIECE.max(share)),
            };
            let places = ((&copying.from, copying.at), (&copying.to, copying.at));
            copy_part(gpu, &mut encoder, places.0, places.1, piece)?;
            copying.at += piece;
        }
        Ok(Some(encoder))
    }

    /// Those pieces were submitted.
    pub(crate) fn submitted(&mut self, gpu: &Gpu) -> Result<()> {
        let ended = self.copies.iter().take_while(|c| c.at == c.bytes).count();
        for done in self.copies.drain(..ended) {
            let mapping = Mapping::ask(gpu, &done.from, MapMode::Write)?;
            self.used = Some((done.from, mapping));
        }
        Ok(())
    }
}

/// A buffer that the host writes.
fn mapped(gpu: &Gpu, bytes: u64) -> Result<Buffer> {
    let usage = BufferUsages::MAP_WRITE | BufferUsages::COPY_SRC;
    make(gpu, "a tree to be sent", bytes, usage)
}
