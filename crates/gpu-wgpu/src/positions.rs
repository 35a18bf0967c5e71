//! Positions on their way to the builder.

use crate::buffers::{Mapping, unmap, unreadable};
use crate::gpu::Gpu;
use backend::{Result, Snapshot};
use geom::Point;
use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use wgpu::{Buffer, BufferView};

/// Buffers that wait to be filled again.
#[derive(Clone, Default)]
pub(crate) struct Spare(Arc<Mutex<Vec<Buffer>>>);

impl Spare {
    fn lock(&self) -> MutexGuard<'_, Vec<Buffer>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn pop(&self) -> Option<Buffer> {
        self.lock().pop()
    }

    pub(crate) fn clear(&self) {
        self.lock().clear();
    }
}

/// A copy that the queue is at.
pub struct PositionsCopy {
    buffer: Buffer,
    mapping: Mapping,
}

impl PositionsCopy {
    /// Follows a copy that was submitted.
    pub(crate) fn begun(gpu: &Gpu, buffer: Buffer) -> Result<Self> {
        let mapping = Mapping::ask(gpu, &buffer)?;
        Ok(Self { buffer, mapping })
    }

    pub(crate) fn has_arrived(&self, gpu: &Gpu) -> Result<bool> {
        self.mapping.poll(gpu)
    }

    /// The mapped buffer itself; it comes back to `spare` when the builder is done with it.
    pub(crate) fn take(self, gpu: &Gpu, vertices: usize, spare: &Spare) -> Result<Snapshot> {
        let view = self.buffer.get_mapped_range(..).map_err(unreadable)?;
        Ok(Box::new(BorrowedPositions {
            view: Some(view),
            device: gpu.device.clone(),
            buffer: self.buffer,
            vertices,
            spare: spare.clone(),
        }))
    }
}

/// wgpu's view may be sent to and read by any thread.
struct BorrowedPositions {
    /// Taken out when the loan ends.
    view: Option<BufferView>,
    device: wgpu::Device,
    buffer: Buffer,
    vertices: usize,
    spare: Spare,
}

impl Deref for BorrowedPositions {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        let view = self.view.as_ref();
        let view = view.expect("the view stays until the loan ends");
        bytemuck::cast_slice(&view[..self.vertices * size_of::<Point>()])
    }
}

impl Drop for BorrowedPositions {
    fn drop(&mut self) {
        // A buffer is unmapped only when no view looks at it any more.
        drop(self.view.take());
        if unmap(&self.device, &self.buffer) {
            self.spare.lock().push(self.buffer.clone());
        }
    }
}
