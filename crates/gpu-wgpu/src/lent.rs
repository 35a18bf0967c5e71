//! What is shared with the program on its own device, and no host sees. Positions that its kernels made go from buffer to buffer.
//! Kernels bind its rays as they are, and shaders of its own trace the scene.

use crate::buffers::{copy_part, make, write};
use crate::gpu::Gpu;
use crate::wgpu_device::{WgpuBackend, WgpuDevice};
use backend::Result;
use geom::Point;
use gpu_common::{LentRays, PointsCopy, without};
use shaders::Params;
use std::collections::VecDeque;
use std::ops::Range;
use wgpu::{Buffer, BufferSlice, BufferUsages, CommandEncoder};

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
    copies: Vec<PointsCopy<Buffer>>,
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

    /// Those of the copies that a kernel can make, from buffers that it may bind: it takes half the time of a copy command.
    pub(crate) fn take_copies(&mut self, largest: u64) -> Vec<PointsCopy<Buffer>> {
        let is_bound = |copy: &mut PointsCopy<Buffer>| {
            let from = &copy.from.0;
            from.usage().contains(BufferUsages::STORAGE) && from.size() <= largest
        };
        self.copies.extract_if(.., is_bound).collect()
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
        let DevicePoints { runs, brought, .. } = &mut self.scene.points;
        brought.push((run.clone(), (from.buffer().clone(), from.offset())));
        runs.insert(runs.partition_point(|r| r.start < run.start), run);
    }

    /// Where a run of them lies, in bytes of a buffer, if it was brought: submits what brings it.
    ///
    /// # Errors
    /// The buffers that they came from cannot be copied.
    pub fn brought_points(&mut self, run: &Range<usize>) -> Result<Option<(Buffer, Range<u64>)>> {
        let (gpu, points) = (&self.gpu, &mut self.scene.points);
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
        self.scene.points.brought.retain(|(other, _)| other != run);
        self.scene.points.runs = without(&self.scene.points.runs, std::slice::from_ref(run));
    }

    /// Has the next queries of [`backend::Rays::OnDevice`] trace these, which kernels can bind: each the next of them.
    pub fn lend_rays(&mut self, rays: Vec<LentRays<Buffer>>) {
        if self.scene.rays.lent != rays {
            // Groups keep the others alive until they are made anew.
            self.gpu.count_buffer();
        }
        self.scene.rays.due = rays.iter().cloned().collect();
        self.scene.rays.lent = rays;
    }

    /// A buffer that holds these: another one if they are others, for what reads it may not be submitted yet.
    fn module_params(&mut self, params: Params) -> Result<Buffer> {
        if let Some((_, buffer)) = self.module.as_ref().filter(|(of, _)| *of == params) {
            return Ok(buffer.clone());
        }
        let bytes = bytemuck::bytes_of(&params);
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let buffer = make(&self.gpu, "parameters", bytes.len() as u64, usage)?;
        write(&self.gpu, &buffer, 0, bytes)?;
        self.module = Some((params, buffer.clone()));
        Ok(buffer)
    }
}

/// Parameters, the tree's nodes, its triangles, and how far coordinates reach.
pub type TracedScene = [Buffer; 4];

/// The scene as the last submission leaves it; `None` if none brought it up to date, or by another method than the usual.
pub fn traced_scene(backend: &mut WgpuBackend) -> Result<Option<TracedScene>> {
    let Some((params, others)) = backend.traced_scene() else {
        return Ok(None);
    };
    let [nodes, records, range] = others.map(Clone::clone);
    let params = backend.gpu_mut().module_params(params)?;
    Ok(Some([params, nodes, records, range]))
}
