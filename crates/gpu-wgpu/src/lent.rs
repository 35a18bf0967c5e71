//! Resources shared with the program on its own device, without copies through the host. Positions that its kernels
//! wrote are copied from buffer to buffer. Kernels bind its ray buffers directly, and its shaders can trace the scene.

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

/// The latest positions from buffers of the program.
#[derive(Default)]
pub(crate) struct DevicePoints {
    /// Runs of the scene's positions that come from the program, in order.
    runs: Vec<Range<usize>>,
    /// Runs that are in no key frame yet, with the buffer and the offset at which each begins.
    brought: Vec<(Range<usize>, (Buffer, u64))>,
    /// The key frame that contains all other runs.
    newest: Option<Buffer>,
    /// Copies at the start of the next submission.
    copies: Vec<PointsCopy<Buffer>>,
}

impl DevicePoints {
    /// Returns the parts of `runs` that come from the host.
    pub(crate) fn others(&self, runs: &[Range<usize>]) -> Vec<Range<usize>> {
        without(runs, &self.runs)
    }

    /// Schedules copies of all runs to a key frame.
    pub(crate) fn copy_to(&mut self, key: &Buffer) {
        if self.runs.is_empty() {
            return;
        }
        for run in &self.runs {
            // The previous key frame may have used the same buffer.
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

    /// Returns the buffer and offset at which a run begins.
    fn place(&self, run: &Range<usize>) -> Option<(Buffer, u64)> {
        let brought = self.brought.iter().find(|(other, _)| other == run);
        match brought {
            Some((_, place)) => Some(place.clone()),
            None => Some((self.newest.clone()?, run.start as u64 * POINT)),
        }
    }

    /// Takes the copies that a kernel can perform, from buffers that it can bind. A kernel takes half the time of a
    /// copy command.
    pub(crate) fn take_copies(&mut self, largest: u64) -> Vec<PointsCopy<Buffer>> {
        let is_bound = |copy: &mut PointsCopy<Buffer>| {
            let from = &copy.from.0;
            from.usage().contains(BufferUsages::STORAGE) && from.size() <= largest
        };
        self.copies.extract_if(.., is_bound).collect()
    }

    /// Records the remaining copies.
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
    /// Rays of the next queries.
    pub(crate) due: VecDeque<LentRays<Buffer>>,
}

impl WgpuDevice {
    /// Makes the positions from `first` on come from a buffer of the program, in all later key frames. The next key
    /// frame's submission copies them first. Does not check that the buffer allows copies.
    pub fn bring_points(&mut self, first: usize, from: BufferSlice<'_>) {
        let run = first..first + (from.size() / POINT) as usize;
        self.release_points(&run);
        let DevicePoints { runs, brought, .. } = &mut self.scene.points;
        brought.push((run.clone(), (from.buffer().clone(), from.offset())));
        runs.insert(runs.partition_point(|r| r.start < run.start), run);
    }

    /// Returns the buffer and byte range of a run that came from the program. Submits pending copies first.
    ///
    /// # Errors
    /// A source buffer does not allow copies.
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

    /// Makes a run of positions come from the host again.
    pub fn release_points(&mut self, run: &Range<usize>) {
        self.scene.points.brought.retain(|(other, _)| other != run);
        self.scene.points.runs = without(&self.scene.points.runs, std::slice::from_ref(run));
    }

    /// Makes the next queries of [`backend::Rays::OnDevice`] trace these rays, one element per query. Kernels must be
    /// able to bind the buffers.
    pub fn lend_rays(&mut self, rays: Vec<LentRays<Buffer>>) {
        if self.scene.rays.lent != rays {
            // Bind groups keep the previous buffers alive until they are recreated.
            self.gpu.count_buffer();
        }
        self.scene.rays.due = rays.iter().cloned().collect();
        self.scene.rays.lent = rays;
    }

    /// Returns a buffer with these parameters. Changed parameters get a new buffer, because unsubmitted work may still
    /// read the previous one.
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

/// Parameters, nodes of the tree, triangle records, and range of the coordinates.
pub type TracedScene = [Buffer; 4];

/// Returns the scene's buffers as the last submission leaves them. Returns `None` if they are not up to date, or unless
/// the intersector is `watertight`.
pub fn traced_scene(backend: &mut WgpuBackend) -> Result<Option<TracedScene>> {
    let Some((params, others)) = backend.traced_scene() else {
        return Ok(None);
    };
    let [nodes, records, range] = others.map(Clone::clone);
    let params = backend.gpu_mut().module_params(params)?;
    Ok(Some([params, nodes, records, range]))
}
