//! Creating, filling, copying and mapping buffers.

use crate::gpu::{OpenDevice, OpenGpu, READBACK, make, unmap};
use backend::{BackendError, Result};
use bytemuck::Pod;
use geom::Point;
use std::ops::Deref;
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};
use wgpu::{Buffer, BufferSlice, BufferView, CommandEncoder, MapMode};

/// Bytes per copy command, so that a large readback does not slow down work of other queues. Kernels of this queue do
/// not run at the same time.
const PIECE: u64 = 512 << 10;

/// Writes at a byte offset, before all later submissions.
pub(crate) fn write<T: Pod>(gpu: &OpenGpu, to: &Buffer, at: u64, data: &[T]) -> Result<()> {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    gpu.guard("an upload", bytes.len() as u64, || {
        gpu.queue.write_buffer(to, at, bytes);
    })
}

/// Fills buffers in pieces and blocks until the copies have finished. At most 64 MiB are in flight at a time.
pub(crate) fn upload(gpu: &OpenGpu, all: &[(&[u8], &Buffer)]) -> Result<()> {
    const BYTES: usize = 32 << 20;
    let flush = || {
        gpu.guard("an upload", 0, || gpu.queue.submit([]))?;
        gpu.wait_idle()
    };
    let mut under_way = 0;
    for (data, to) in all {
        for (i, piece) in data.chunks(BYTES).enumerate() {
            write(gpu, to, (i * BYTES) as u64, piece)?;
            under_way += piece.len();
            if under_way >= BYTES {
                under_way = 0;
                flush()?;
            }
        }
    }
    flush()
}

/// A requested mapping. It completes while the device is polled.
pub(crate) struct Mapping(Arc<OnceLock<MapOutcome>>);

/// Result of a mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MapOutcome {
    Mapped,
    Refused,
    /// The command buffer before the mapping was dropped without being submitted.
    Dropped,
}

/// The part of a mapping that wgpu owns until it calls back.
struct Callback(Arc<OnceLock<MapOutcome>>);

impl Drop for Callback {
    fn drop(&mut self) {
        // This has no effect if the callback was called.
        let _ = self.0.set(MapOutcome::Dropped);
    }
}

impl Mapping {
    /// Requests a mapping that takes place after these commands are submitted.
    pub(crate) fn on_submit(encoder: &CommandEncoder, buffer: &Buffer, mode: MapMode) -> Self {
        let done = Arc::new(OnceLock::new());
        let callback = Callback(Arc::clone(&done));
        encoder.map_buffer_on_submit(buffer, mode, .., move |result| {
            let outcome = match result {
                Ok(()) => MapOutcome::Mapped,
                Err(_) => MapOutcome::Refused,
            };
            let _ = callback.0.set(outcome);
        });
        Self(done)
    }

    /// Returns whether the commands were dropped before they were submitted.
    pub(crate) fn is_dropped(&self) -> bool {
        self.0.get() == Some(&MapOutcome::Dropped)
    }

    /// Returns whether the host can access the buffer. Treats a rejected mapping as the loss of the device.
    pub(crate) fn is_mapped(&self, gpu: &OpenGpu) -> Result<bool> {
        match self.0.get() {
            Some(MapOutcome::Refused) => Err(gpu.faults.lose("a buffer cannot be mapped".into())),
            outcome => Ok(outcome == Some(&MapOutcome::Mapped)),
        }
    }

    /// Waits until the host can access the buffer. The submission that fills it must have finished.
    pub(crate) fn wait(&self, gpu: &OpenGpu) -> Result<()> {
        if self.arrives_within(gpu, Duration::from_secs(10))? {
            return Ok(());
        }
        Err(gpu.faults.lose("a buffer was not mapped in time".into()))
    }

    /// Returns whether the host can access the buffer within `timeout`. Another thread that polls the device may run
    /// the callback.
    pub(crate) fn arrives_within(&self, gpu: &OpenGpu, timeout: Duration) -> Result<bool> {
        let begun = Instant::now();
        while !self.is_mapped(gpu)? {
            if begun.elapsed() > timeout {
                return Ok(false);
            }
            thread::yield_now();
            gpu.poll()?;
        }
        Ok(true)
    }
}

pub(crate) fn inaccessible(e: wgpu::MapRangeError) -> BackendError {
    BackendError::DeviceLost(format!("a mapped buffer cannot be accessed: {e}"))
}

/// A copy of positions or other bytes to the host.
pub(crate) struct MappedCopy {
    pub(crate) buffer: Buffer,
    pub(crate) mapping: Mapping,
}

impl MappedCopy {
    /// Records a copy, in pieces, to `spare` if it is large enough, or else to a new buffer.
    pub(crate) fn record(
        gpu: &OpenGpu,
        encoder: &mut CommandEncoder,
        from: BufferSlice<'_>,
        spare: Option<Buffer>,
    ) -> Result<Self> {
        let size = from.size();
        let buffer = match spare.filter(|b| b.size() >= size) {
            Some(buffer) => buffer,
            None => make(gpu, "a readback", size, READBACK)?,
        };
        gpu.guard("a copy", size, || {
            for at in (0..size).step_by(PIECE as usize) {
                let (begin, bytes) = (from.offset() + at, PIECE.min(size - at));
                encoder.copy_buffer_to_buffer(from.buffer(), begin, &buffer, at, bytes);
            }
        })?;
        Ok(Self {
            mapping: Mapping::on_submit(encoder, &buffer, MapMode::Read),
            buffer,
        })
    }
}

/// Positions that have arrived, in a buffer that stays mapped until it is reused.
pub(crate) struct Arrived {
    view: BufferView,
    buffer: Buffer,
    vertices: usize,
    _device: Arc<OpenDevice>,
}

impl Deref for Arrived {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        bytemuck::cast_slice(&self.view[..self.vertices * size_of::<Point>()])
    }
}

impl Arrived {
    pub(crate) fn new(gpu: &OpenGpu, copy: MappedCopy, vertices: usize) -> Result<Self> {
        let buffer = copy.buffer;
        Ok(Self {
            view: buffer.get_mapped_range(..).map_err(inaccessible)?,
            buffer,
            vertices,
            _device: Arc::clone(&gpu.device),
        })
    }

    /// Returns the buffer, or `None` if it was lost with its device. Drops the view first, because a viewed buffer
    /// cannot be unmapped.
    pub(crate) fn unmapped(self, device: &wgpu::Device) -> Option<Buffer> {
        drop(self.view);
        unmap(device, &self.buffer).then_some(self.buffer)
    }
}
