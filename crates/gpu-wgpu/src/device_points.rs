//! Positions that the program's own kernels made: they go from buffer to buffer, and no host sees them.

use crate::buffers::{copy_part, storage};
use crate::gpu::Gpu;
use crate::wgpu_device::WgpuDevice;
use backend::Result;
use geom::Point;
use gpu_common::without;
use std::ops::Range;
use wgpu::{Buffer, BufferSlice, CommandEncoder};

const POINT: u64 = size_of::<Point>() as u64;

/// The newest of them.
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
    /// Has those from `first` on, of so many, come from the program's buffer.
    pub(crate) fn bring(
        &mut self,
        gpu: &Gpu,
        [first, vertices]: [usize; 2],
        from: BufferSlice<'_>,
    ) -> Result<()> {
        let count = (from.size() / POINT) as usize;
        if self.all.is_none() {
            self.all = Some(storage(gpu, "positions", vertices as u64 * POINT)?);
        }
        let all = self.all.clone().expect("made just now");
        self.copies.push(PointsCopy {
            from: (from.buffer().clone(), from.offset()),
            to: (all, first as u64 * POINT),
            bytes: from.size(),
        });
        let run = first..first + count;
        self.release(&run);
        let at = self.runs.partition_point(|r| r.start < run.start);
        self.runs.insert(at, run);
        Ok(())
    }

    /// Where a run lies that was brought.
    pub(crate) fn brought(
        &mut self,
        gpu: &Gpu,
        run: &Range<usize>,
    ) -> Result<Option<(Buffer, Range<u64>)>> {
        if !self.runs.contains(run) {
            return Ok(None);
        }
        if !self.copies.is_empty() {
            let mut encoder = gpu.encoder("positions of the program's")?;
            self.encode(gpu, &mut encoder)?;
            gpu.submit([encoder])?;
        }
        let all = self.all.clone();
        Ok(all.map(|all| (all, run.start as u64 * POINT..run.end as u64 * POINT)))
    }

    /// Has positions come from the host again.
    pub(crate) fn release(&mut self, run: &Range<usize>) {
        self.runs = without(&self.runs, std::slice::from_ref(run));
    }

    /// Of these runs the parts that come from the host.
    pub(crate) fn others(&self, runs: &[Range<usize>]) -> Vec<Range<usize>> {
        without(runs, &self.runs)
    }

    /// Has a key frame take them.
    pub(crate) fn copy_to(&mut self, key: &Buffer) {
        let Some(all) = &self.all else {
            return;
        };
        self.copies.extend(self.runs.iter().map(|run| {
            let at = run.start as u64 * POINT;
            PointsCopy {
                from: (all.clone(), at),
                to: (key.clone(), at),
                bytes: run.len() as u64 * POINT,
            }
        }));
    }

    /// Writes the copies that are due.
    pub(crate) fn encode(&mut self, gpu: &Gpu, encoder: &mut CommandEncoder) -> Result<()> {
        self.copies.drain(..).try_for_each(|copy| {
            let (from, to) = ((&copy.from.0, copy.from.1), (&copy.to.0, copy.to.1));
            copy_part(gpu, encoder, from, to, copy.bytes)
        })
    }
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
        self.points.bring(&self.gpu, [first, vertices], from)
    }

    /// Where a run of them lies, in bytes of a buffer, if it was brought: submits what brings it.
    ///
    /// # Errors
    /// The buffers that they came from cannot be copied.
    pub fn brought_points(&mut self, run: &Range<usize>) -> Result<Option<(Buffer, Range<u64>)>> {
        self.points.brought(&self.gpu, run)
    }

    /// Has a run of them come from the host again.
    pub fn release_points(&mut self, run: &Range<usize>) {
        self.points.release(run);
    }
}
