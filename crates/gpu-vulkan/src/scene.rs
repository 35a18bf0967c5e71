//! What a loaded animation keeps on the device.

use crate::device::Gpu;
use crate::encode::Part;
use crate::memory::{Buffer, Place};
use crate::transfer::Transfer;
use backend::{BackendError, Result};
use bytemuck::Pod;
use geom::Animation;
use std::sync::Arc;

/// Key frames, triangles, positions.
pub(crate) struct SceneBuffers {
    pub(crate) animation: Arc<Animation>,
    /// Every key frame, each from a multiple of `key_stride`.
    keys: Buffer,
    key_stride: u64,
    key_bytes: u64,
    pub(crate) triangles: Buffer,
    /// Two, so that one can go back to the host while the next frame fills the other.
    pub(crate) positions: [Buffer; 2],
    /// `k` of "What a hit is" in ARCHITECTURE.md.
    pub(crate) scale_exponent: i32,
}

impl SceneBuffers {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        transfer: &mut Transfer,
        animation: Arc<Animation>,
    ) -> Result<Self> {
        let key_bytes = ((animation.vertex_count() * 12) as u64)
            .max(16)
            .next_multiple_of(16);
        let triangle_bytes = (animation.triangle_count() * 12) as u64;
        within(gpu, "the vertices of a key frame", key_bytes)?;
        within(gpu, "the triangles' corners", triangle_bytes)?;
        let key_stride = key_bytes.next_multiple_of(256);
        let keys_bytes = key_stride * animation.keys().len() as u64;
        let keys = Buffer::new(gpu, "key frames", keys_bytes, Place::Device)?;
        let triangles = Buffer::new(gpu, "triangles", triangle_bytes, Place::Device)?;
        let mut stage = Stage::new(gpu)?;
        for (i, key) in animation.keys().iter().enumerate() {
            stage.send(transfer, key, &keys, key_stride * i as u64)?;
        }
        stage.send(transfer, animation.triangles(), &triangles, 0)?;
        let position = || Buffer::new(gpu, "positions", key_bytes, Place::Device);
        let scale_exponent = animation.scale_exponent();
        Ok(Self {
            keys,
            key_stride,
            key_bytes,
            triangles,
            positions: [position()?, position()?],
            scale_exponent,
            animation,
        })
    }

    /// One key frame, or the last where there is none so late.
    pub(crate) fn key(&self, key: u32) -> Part {
        let key = u64::from(key).min(self.animation.keys().len() as u64 - 1);
        Part {
            buffer: self.keys.vk,
            offset: key * self.key_stride,
            bytes: self.key_bytes,
        }
    }
}

/// Refuses what one storage buffer cannot span.
pub(crate) fn within(gpu: &Gpu, what: &str, need: u64) -> Result<()> {
    let limit = gpu.adapter.max_buffer_bytes;
    if need > limit {
        return Err(BackendError::Limit {
            what: format!("{what} (bytes of one buffer)"),
            need,
            limit,
        });
    }
    Ok(())
}

/// A window through which loading passes data in pieces; waits for each.
struct Stage {
    window: Buffer,
}

impl Stage {
    const BYTES: usize = 32 << 20;

    fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            window: Buffer::new(gpu, "a loading window", Self::BYTES as u64, Place::Upload)?,
        })
    }

    fn send<T: Pod>(
        &mut self,
        transfer: &mut Transfer,
        data: &[T],
        to: &Buffer,
        at: u64,
    ) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        for (i, piece) in bytes.chunks(Self::BYTES).enumerate() {
            self.window.write(0, piece);
            let at = at + (i * Self::BYTES) as u64;
            let done = transfer.copy_to(&self.window, to, piece.len() as u64, at)?;
            transfer.wait(done)?;
        }
        Ok(())
    }
}
