//! Positions on their way to the host.

use crate::buffers::{Mapping, unmap, unreadable};
use backend::Result;
use geom::Point;
use std::ops::Deref;
use wgpu::{Buffer, BufferView};

/// Positions on their way to the builder.
pub struct PositionsCopy {
    pub(crate) buffer: Buffer,
    pub(crate) mapping: Mapping,
}

impl PositionsCopy {
    pub(crate) fn new(buffer: Buffer, mapping: Mapping) -> Self {
        Self { buffer, mapping }
    }
}

/// Positions that have arrived, and the buffer that is mapped for them until it is used again.
pub(crate) struct Arrived {
    view: BufferView,
    buffer: Buffer,
    vertices: usize,
}

impl Deref for Arrived {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        bytemuck::cast_slice(&self.view[..self.vertices * size_of::<Point>()])
    }
}

impl Arrived {
    pub(crate) fn new(copy: PositionsCopy, vertices: usize) -> Result<Self> {
        let buffer = copy.buffer;
        Ok(Self {
            view: buffer.get_mapped_range(..).map_err(unreadable)?,
            buffer,
            vertices,
        })
    }

    /// The buffer, unless it is gone with its device. No view may look at a buffer that is unmapped.
    pub(crate) fn unmapped(self, device: &wgpu::Device) -> Option<Buffer> {
        drop(self.view);
        unmap(device, &self.buffer).then_some(self.buffer)
    }
}
