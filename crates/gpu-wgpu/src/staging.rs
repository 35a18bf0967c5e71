//! Host memory from which rays and trees are uploaded.
//!
//! wgpu's queue would allocate new memory for each write and fill it on this thread. Key frames are still written by
//! the queue, because several threads were not faster.

use crate::buffers::{Mapping, inaccessible, write};
use crate::gpu::{OpenDevice, OpenGpu, STAGING, make, unmap};
use backend::Result;
use bytemuck::Pod;
use geom::for_each_in_parallel;
use gpu_common::{Staging, with_slack};
use std::sync::Arc;
use wgpu::{Buffer, MapMode, WriteOnly};

/// Bytes that a thread writes at a time.
const RUN: usize = 96 << 10;

/// Maximum bytes of rays per copy. The next piece is written while the device copies.
const PIECE: usize = 64 * RUN;

/// Bytes up to which writes through the queue are equally fast.
const MAX_QUEUE_WRITE: usize = 1 << 20;

/// Buffers that the device reads or has read, sorted by size. Each has the mapping that makes it writable again.
#[derive(Default)]
pub(crate) struct MappedPool(Vec<(Buffer, Mapping)>);

/// A mapped buffer from which a tree, or a piece of a list of rays, is uploaded.
pub struct MappedStaging {
    buffer: Buffer,
    /// Bytes that were written.
    filled: u64,
    _device: Arc<OpenDevice>,
}

impl MappedStaging {
    pub(crate) fn new(gpu: &OpenGpu, buffer: Buffer, filled: u64) -> Self {
        Self {
            buffer,
            filled,
            _device: Arc::clone(&gpu.device),
        }
    }
}

impl Staging for MappedStaging {
    fn fill(&mut self, parts: &[&[u32]]) -> bool {
        let bytes: usize = parts.iter().map(|part| size_of_val(*part)).sum();
        if bytes as u64 > self.buffer.size() {
            return false;
        }
        let Ok(mut view) = self.buffer.get_mapped_range_mut(..) else {
            return false;
        };
        let mut rest = view.slice(..);
        for part in parts {
            let to = rest.split_off(..size_of_val(*part));
            to.expect("the parts fit")
                .copy_from_slice(bytemuck::cast_slice(part));
        }
        self.filled = bytes as u64;
        true
    }
}

impl MappedPool {
    /// Returns the smallest mapped buffer of at least `bytes`, or a new one.
    pub(crate) fn take(&mut self, gpu: &OpenGpu, bytes: u64) -> Result<Buffer> {
        gpu.poll()?;
        for (i, (buffer, mapping)) in self.0.iter().enumerate() {
            if buffer.size() >= bytes && mapping.is_mapped(gpu)? {
                return Ok(self.0.remove(i).0);
            }
        }
        with_slack(bytes, |bytes| make(gpu, "staging memory", bytes, STAGING))
    }

    /// Copies the written bytes to byte `offset` of the buffer `to`, before all later submissions.
    pub(crate) fn send(
        &mut self,
        gpu: &OpenGpu,
        from: MappedStaging,
        to: &Buffer,
        offset: u64,
    ) -> Result<()> {
        let MappedStaging { buffer, filled, .. } = from;
        if !unmap(&gpu.device, &buffer) {
            return Err(gpu.faults.lose("staging memory was lost".into()));
        }
        let mut encoder = gpu.encoder("an upload")?;
        gpu.guard("an upload", filled, || {
            encoder.copy_buffer_to_buffer(&buffer, 0, to, offset, filled);
        })?;
        let mapping = Mapping::on_submit(&encoder, &buffer, MapMode::Write);
        gpu.submit([encoder])?;
        let at = self.0.partition_point(|(b, _)| b.size() < buffer.size());
        self.0.insert(at, (buffer, mapping));
        Ok(())
    }

    /// Writes the first rows of a buffer on several threads, before all later submissions.
    pub(crate) fn write<T: Pod + Send + Sync>(
        &mut self,
        gpu: &OpenGpu,
        to: &Buffer,
        rows: &[T],
    ) -> Result<()> {
        if size_of_val(rows) <= MAX_QUEUE_WRITE {
            return write(gpu, to, 0, rows);
        }
        let bytes: &[u8] = bytemuck::cast_slice(rows);
        // The program may have requested its device with a smaller limit.
        let limit = usize::try_from(gpu.limits.max_buffer_size).unwrap_or(PIECE);
        let most = PIECE.min(limit) / RUN * RUN;
        let mut at = 0;
        for from in bytes.chunks(most) {
            let buffer = self.take(gpu, most as u64)?;
            fill_piece(&buffer, from)?;
            let filled = from.len() as u64;
            self.send(gpu, MappedStaging::new(gpu, buffer, filled), to, at)?;
            at += filled;
        }
        Ok(())
    }
}

/// Copies bytes to a mapped buffer on several threads.
fn fill_piece(to: &Buffer, from: &[u8]) -> Result<()> {
    let mapped = to.get_mapped_range_mut(..from.len() as u64);
    let mut view = mapped.map_err(inaccessible)?;
    let (runs, mut rest) = view.slice(..).into_chunks::<RUN>();
    let (whole, last) = from.split_at(from.len() / RUN * RUN);
    let runs: Vec<_> = runs.into_iter().collect();
    let parts = runs.into_iter().zip(whole.chunks(RUN));
    for_each_in_parallel(parts, |(to, from)| {
        WriteOnly::<[u8]>::from(to).copy_from_slice(from);
    });
    rest.copy_from_slice(last);
    Ok(())
}
