//! What a loaded animation keeps on the device.

use crate::device::Gpu;
use crate::memory::{Buffer, Place};
use crate::transfer::{Loader, Transfer};
use backend::Result;
use geom::Animation;
use std::sync::Arc;

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
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        road: &mut Transfer,
        animation: Arc<Animation>,
    ) -> Result<Self> {
        let key_bytes = animation.vertex_count() as u64 * 12;
        let triangle_bytes = animation.triangle_count() as u64 * 12;
        let device = |what, bytes| Buffer::new(gpu, what, bytes, Place::Device);
        let triangles = device("triangles' corners", triangle_bytes)?;
        let positions = [
            device("positions", key_bytes)?,
            device("positions", key_bytes)?,
        ];
        let mut loader = Loader::new(gpu, road, key_bytes.max(triangle_bytes))?;
        loader.send(animation.triangles(), &triangles)?;
        let mut keys = Vec::with_capacity(animation.keys().len());
        for key in animation.keys() {
            let buffer = device("a key frame", key_bytes)?;
            loader.send(key, &buffer)?;
            keys.push(buffer);
        }
        Ok(Self {
            keys,
            triangles,
            positions,
            scale_exponent: animation.scale_exponent(),
            animation,
        })
    }

    /// One key frame, or the last where there is none so late.
    pub(crate) fn key(&self, key: u32) -> &Buffer {
        &self.keys[(key as usize).min(self.keys.len() - 1)]
    }

    /// Bytes of all positions.
    pub(crate) fn position_bytes(&self) -> u64 {
        self.animation.vertex_count() as u64 * 12
    }

    /// Triangles that are inactive in every key frame, and so in no tree.
    pub(crate) fn never_active(&self) -> u64 {
        (self.animation.triangle_count() - self.animation.live_count()) as u64
    }
}
