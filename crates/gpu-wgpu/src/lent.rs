//! What lies in buffers of the program's own: positions that its kernels made, which go from buffer to buffer, and rays, which
//! kernels bind as they are. No host sees them.

use crate::buffers::{copy_part, storage};
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
    /// Room for all of the scene's.
    all: Option<Buffer>,
    /// Which of those they are, in order.
    runs: Vec<Range<usize>>,
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
        let Some(all) = &self.all else {
            return;
        };
        let copy = |run: &Range<usize>| {
            let at = run.start as u64 * POINT;
            let newest = self
                .copies
                .iter()
                .rfind(|copy| copy.to.0 == *all && copy.to.1 == at);
            PointsCopy {
                // A copy that reads what another writes would wait for it.
                from: newest.map_or_else(|| (all.clone(), at), |copy| copy.from.clone()),
                to: (key.clone(), at),
                bytes: run.len() as u64 * POINT,
            }
        };
        let all: Vec<_> = self.runs.iter().map(copy).collect();
        self.copies.extend(all);
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
    /// Has the positions from `first` on, of so many that the scene has, come from a buffer of the program's on this device, in
    /// all key frames to come; the next submission copies them first.
    ///
    /// # Errors
    /// The buffer cannot be copied from. Of another device's, the submission tells.
    pub fn bring_points(
        &mut self,
        [first, vertices]: [usize; 2],
        from: BufferSlice<'_>,
    ) -> Result<()> {
        let run = first..first + (from.size() / POINT) as usize;
        let points = &mut self.points;
        if points.all.is_none() {
            points.all = Some(storage(&self.gpu, "positions", vertices as u64 * POINT)?);
        }
        let all = points.all.clone().expect("made just now");
        points.copies.push(PointsCopy {
            from: (from.buffer().clone(), from.offset()),
            to: (all, first as u64 * POINT),
            bytes: from.size(),
        });
        self.release_points(&run);
        let runs = &mut self.points.runs;
        runs.insert(runs.partition_point(|r| r.start < run.start), run);
        Ok(())
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
        let bytes = run.start as u64 * POINT..run.end as u64 * POINT;
        Ok(points.all.clone().map(|all| (all, bytes)))
    }

    /// Has a run of them come from the host again.
    pub fn release_points(&mut self, run: &Range<usize>) {
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
