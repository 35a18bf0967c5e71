//! Device buffers of a loaded animation.

use crate::key_slots::KeySlots;
use crate::{BufferTable, GpuDevice};
use backend::{Palette, Result};
use bytemuck::cast_slice;
use geom::Animation;
use shaders::{BufferName, RANGE_BYTES};
use std::sync::Arc;

/// Buffers of key frames, triangles and positions.
pub struct AnimationBuffers<D: GpuDevice> {
    /// The loaded animation.
    pub animation: Arc<Animation>,
    pub(crate) keys: KeySlots<D>,
    /// One or two position buffers. The first request to copy positions to the host creates the second buffer, so that
    /// the next frame can write one while the other is copied. If `interpolate` writes only the
    /// [rows with moving vertices](shaders::moving_rows), both contain the static vertices from the start.
    pub positions: Vec<D::Buffer>,
    /// Buffers of the triangles' vertex indices, of the coordinate range that a kernel measures, and of the list of
    /// rows with moving vertices. The list is empty if it would not save time.
    others: BufferTable<D>,
    pub(crate) moving_row_count: Option<usize>,
    /// Colour tables; empty until a palette is loaded.
    palette: BufferTable<D>,
    /// Exponent of the scene's scale: `k` in `docs/design/hits.md`.
    pub scale_exponent: i32,
}

impl<D: GpuDevice> AnimationBuffers<D> {
    pub(crate) fn new(gpu: &mut D, animation: Arc<Animation>) -> Result<Self> {
        let rows = shaders::moving_rows(&animation);
        let listed = rows.as_deref().unwrap_or_default();
        let contents = [
            (BufferName::Triangles, cast_slice(animation.triangles())),
            (BufferName::MovingRows, cast_slice(listed)),
            (BufferName::Range, &[0; RANGE_BYTES as usize]),
        ];
        let mut made = Self {
            others: BufferTable::filled(gpu, &contents)?,
            keys: KeySlots::new(gpu, &animation)?,
            positions: Vec::new(),
            moving_row_count: rows.map(|rows| rows.len()),
            palette: BufferTable::new(gpu, [])?,
            scale_exponent: animation.scale_exponent(),
            animation,
        };
        made.make_positions(gpu)?;
        Ok(made)
    }

    /// Creates one more position buffer, unless there are two.
    pub(crate) fn make_positions(&mut self, gpu: &mut D) -> Result<()> {
        if self.positions.len() == 2 {
            return Ok(());
        }
        let made = gpu.buffer(BufferName::Positions, self.position_bytes())?;
        if self.moving_row_count.is_some() {
            let first = cast_slice(self.animation.first());
            gpu.upload(&[(first, &made)])?;
        }
        self.positions.push(made);
        Ok(())
    }

    /// Uploads the colour tables. Returns the buffers of previous ones, which recorded or submitted work may still use.
    pub(crate) fn load_palette(
        &mut self,
        gpu: &mut D,
        palette: &Palette,
    ) -> Result<impl Iterator<Item = D::Buffer> + use<D>> {
        let contents = [
            (BufferName::Colours, cast_slice(&palette.colours)),
            (BufferName::Tones, cast_slice(&palette.tones)),
        ];
        let loaded = BufferTable::filled(gpu, &contents)?;
        Ok(std::mem::replace(&mut self.palette, loaded).into_buffers())
    }

    pub(crate) fn has_palette(&self) -> bool {
        self.palette.get(BufferName::Colours).is_some()
    }

    /// Returns one of the scene's buffers. `key` selects the key frames and `position` the position buffer.
    pub fn get(&self, name: BufferName, key: u32, position: usize) -> Option<&D::Buffer> {
        match name {
            BufferName::Earlier => self.keys.get(key),
            BufferName::Later => self.keys.get(key.saturating_add(1)),
            // Kernels that accept both kinds of rays bind `Rays` for camera rays too, but do not read it. Any buffer
            // serves.
            BufferName::Positions | BufferName::Rays => Some(&self.positions[position]),
            other => self.others.get(other).or_else(|| self.palette.get(other)),
        }
    }

    /// Returns the bytes of device memory.
    pub(crate) fn held(&self) -> u64 {
        let positions = self
            .positions
            .iter()
            .map(|b| D::size(b).allocated)
            .sum::<u64>();
        self.keys.held() + positions + self.others.held() + self.palette.held()
    }

    /// Returns the bytes of a position buffer.
    pub(crate) fn position_bytes(&self) -> u64 {
        self.animation.vertex_count() as u64 * 12
    }
}
