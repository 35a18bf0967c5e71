//! What a loaded animation keeps on the device.

use crate::buffers::{Loader, storage};
use crate::device::Gpu;
use backend::Result;
use geom::Animation;
use std::sync::Arc;
use wgpu::Buffer;

/// Key frames, triangles, positions.
pub(crate) struct SceneBuffers {
    pub(crate) animation: Arc<Animation>,
    /// A buffer each, so that only the device's memory limits how many there are.
    keys: Vec<Buffer>,
    pub(crate) triangles: Buffer,
    /// Two, so that one can go back to the host while the next frame fills the other.
    pub(crate) positions: [Buffer; 2],
    /// `k` of "What a hit is" in ARCHITECTURE.md.
    pub(crate) scale_exponent: i32,
}

impl SceneBuffers {
    pub(crate) fn new(gpu: &Gpu, animation: Arc<Animation>) -> Result<Self> {
        let key_bytes = animation.vertex_count() as u64 * 12;
        let triangle_bytes = animation.triangle_count() as u64 * 12;
        gpu.within("the vertices of a key frame", key_bytes)?;
        gpu.within("the triangles' corners", triangle_bytes)?;
        let mut loader = Loader::new(gpu);
        let mut keys = Vec::with_capacity(animation.keys().len());
        for key in animation.keys() {
            let buffer = storage(gpu, "a key frame", key_bytes)?;
            loader.send(key, &buffer)?;
            keys.push(buffer);
        }
        let triangles = storage(gpu, "triangles", triangle_bytes)?;
        loader.send(animation.triangles(), &triangles)?;
        loader.flush()?;
        let position = || storage(gpu, "positions", key_bytes);
        Ok(Self {
            keys,
            triangles,
            positions: [position()?, position()?],
            scale_exponent: animation.scale_exponent(),
            animation,
        })
    }

    /// One key frame, or the last where there is none so late.
    pub(crate) fn key(&self, key: u32) -> &Buffer {
        &self.keys[(key as usize).min(self.keys.len() - 1)]
    }

    /// Bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        let all = self.keys.iter().chain(&self.positions);
        all.map(Buffer::size).sum::<u64>() + self.triangles.size()
    }

    /// Triangles that are inactive in every key frame, and so in no tree.
    pub(crate) fn never_active(&self) -> u64 {
        (self.animation.triangle_count() - self.animation.live_count()) as u64
    }
}
