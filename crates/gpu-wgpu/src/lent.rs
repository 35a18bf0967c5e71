//! What lies in buffers of the program's own: positions that its kernels made, which go from buffer to buffer, and rays, which
//! kernels bind as they are. No host sees them.

use crate::buffers::copy_part;
use crate::gpu::Gpu;
use crate::wgpu_device::WgpuDevice;
use backend::Result;
use geom::Point;
use gpu_common::{LentRays, without};
use std::collections::VecDeque;
use std::ops::Range;
use wgpu::{Buffer, BufferSlice, CommandEncoder};

const POINT: u64 = size_of::<Point>() as u64;

/// The newest positions of them.
#[derive(Default)]
pub(crate) struct DevicePoints {
    /// Which of the scene's they are, in order.
    runs: Vec<Range<usize>>,
    /// Those that no key frame has yet, and the place in a buffer where each run begins.
    brought: Vec<(Range<usize>, (Buffer, u64))>,
    /// The key frame that has all others.
    newest: Option<Buffer>,
    /// Copies that the next submission begins with.
    copies: Vec<PointsCopy>,
}

/// From a place in a buffer to a place in another.
struct PointsCopy {
    from: (Buffer, u64),
    to: (Buffer, u64),
    bytes: u64,
}

impl DevicePoints {
    /// Of these runs the parts that come from the host.
    pub(crate) fn others(&self, runs: &[Range<usize>]) -> Vec<Range<usize>> {
        without(runs, &self.runs)
    }

    /// Has a key frame take them.
    pub(crate) fn copy_to(&mut self, key: &Buffer) {
        if self.runs.is_empty() {
            return;
        }
        for run in &self.runs {
            // That of the key frame before may be the same buffer.
            let Some(from) = self.place(run).filter(|(buffer, _)| buffer != key) else {
                continue;
            };
            self.copies.push(PointsCopy {
                from,
                to: (key.clone(), run.start as u64 * POINT),
                bytes: run.len() as u64 * POINT,
            });
        }
        self.brought.clear();
        self.newest = Some(key.clone());
    }

    /// Where a run of them begins.
    fn place(&self, run: &Range<usize>) -> Option<(Buffer, u64)> {
        let brought = self.brought.iter().find(|(other, _)| other == run);
        match brought {
            Some((_, place)) => Some(place.clone()),
            None => Some((self.newest.clone()?, run.start as u64 * POINT)),
        }
    }

    /// Writes the copies that are due.
    pub(crate) fn encode(&mut self, gpu: &Gpu, encoder: &mut CommandEncoder) -> Result<()> {
        self.copies.drain(..).try_for_each(|copy| {
            let (from, to) = ((&copy.from.0, copy.from.1), (&copy.to.0, copy.to.1));
            copy_part(gpu, encoder, from, to, copy.bytes)
        })
    }
}

/// The rays lent last.
#[derive(Default)]
pub(crate) struct DeviceRays {
    lent: Vec<LentRays<Buffer>>,
    /// For queries to come.
    pub(crate) due: VecDeque<LentRays<Buffer>>,
}

impl WgpuDevice {
    /// Has the positions from `first` on come from a buffer of the program's on this device, in all key frames to come; the
    /// submission of the next one copies them first. Whether the buffer can be copied from is for that to tell.
    pub fn bring_points(&mut self, first: usize, from: BufferSlice<'_>) {
        let run = first..first + (from.size() / POINT) as usize;
        self.release_points(&run);
        let DevicePoints { runs, brought, .. } = &mut self.points;
        brought.push((run.clone(), (from.buffer().clone(), from.offset())));
        runs.insert(runs.partition_point(|r| r.start < run.start), run);
    }

    /// Where a run of them lies, in bytes of a buffer, if it was brought: submits what brings it.
    ///
    /// # Errors
    /// The buffers that they came from cannot be copied.
    pub fn brought_points(&mut self, run: &Range<usize>) -> Result<Option<(Buffer, Range<u64>)>> {
        let (gpu, points) = (&self.gpu, &mut self.points);
        if !points.runs.contains(run) {
            return Ok(None);
        }
        if !points.copies.is_empty() {
            let mut encoder = gpu.encoder("positions of the program's")?;
            points.encode(gpu, &mut encoder)?;
            gpu.submit([encoder])?;
        }
        let place = points.place(run);
        Ok(place.map(|(buffer, at)| (buffer, at..at + run.len() as u64 * POINT)))
    }

    /// Has a run of them come from the host again.
    pub fn release_points(&mut self, run: &Range<usize>) {
        self.points.brought.retain(|(other, _)| other != run);
        self.points.runs = without(&self.points.runs, std::slice::from_ref(run));
    }

    /// Has the next queries of [`backend::Rays::OnDevice`] trace these, which kernels can bind: each the next of them.
    pub fn lend_rays(&mut self, rays: Vec<LentRays<Buffer>>) {
        if self.rays.lent != rays {
            // Groups keep the others alive until they are made anew.
            self.gpu.count(|t| t.buffers += 1);
        }
        self.rays.due = rays.iter().cloned().collect();
        self.rays.lent = rays;
    }
}
