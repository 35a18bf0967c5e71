//! What a loaded animation keeps on the device.

use crate::buffers::{Loader, storage};
use crate::device::Gpu;
use backend::Result;
use geom::Animation;
use shaders::work::Vertices;
use std::sync::Arc;
use wgpu::Buffer;

/// Key frames, triangles, positions.
pub(crate) struct SceneBuffers {
    pub(crate) animation: Arc<Animation>,
    /// A buffer each, so that only the device's memory limits how many there are.
    keys: Vec<Buffer>,
    pub(crate) triangles: Buffer,
    /// Two, so that one can go back to the host while the next frame fills the other.
    /// Where rows are listed, static vertices stand in both from the start.
    pub(crate) positions: [Buffer; 2],
    /// Rows of positions in which anything moves, and how many, where that pays; else a buffer to bind.
    pub(crate) moving_rows: Buffer,
    moving_row_count: Option<usize>,
    /// `k` of `docs/design/hits.md`.
    pub(crate) scale_exponent: i32,
    /// Triangles that are inactive in every key frame, and so in no tree.
    pub(crate) never_active: u64,
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
        let position = || storage(gpu, "positions", key_bytes);
        let positions = [position()?, position()?];
        let rows = shaders::moving_rows(&animation);
        let row_bytes = rows.as_ref().map_or(0, |rows| rows.len() as u64 * 4);
        let moving_rows = storage(gpu, "rows that move", row_bytes)?;
        if let Some(rows) = &rows {
            loader.send(rows, &moving_rows)?;
            for buffer in &positions {
                loader.send(&animation.keys()[0], buffer)?;
            }
        }
        loader.flush()?;
        Ok(Self {
            keys,
            triangles,
            positions,
            moving_rows,
            moving_row_count: rows.map(|rows| rows.len()),
            never_active: (animation.triangle_count() - animation.live_count()) as u64,
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
        let all = all.chain([&self.triangles, &self.moving_rows]);
        all.map(Buffer::size).sum()
    }

    /// What has to be interpolated.
    pub(crate) fn vertices(&self) -> Vertices {
        let all = Vertices::All(self.animation.vertex_count());
        self.moving_row_count.map_or(all, Vertices::Rows)
    }
}
