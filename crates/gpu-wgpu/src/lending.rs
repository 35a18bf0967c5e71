//! Resources shared with the program on its own device, without copies through the host. Positions that its kernels
//! wrote are copied from buffer to buffer. Kernels bind its ray buffers directly, and its shaders can trace the scene.

use crate::buffers::write;
use crate::gpu::make;
use crate::lent_points::{DevicePoints, POINT};
use crate::wgpu_device::{WgpuBackend, WgpuDevice};
use backend::Result;
use gpu_common::{LentRays, without};
use shaders::Params;
use std::ops::Range;
use wgpu::{Buffer, BufferSlice, BufferUsages, CommandEncoder};

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
        points.commands.append(&mut self.scene.lent.copies);
        if !points.commands.is_empty() {
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
        if self.scene.rays != rays {
            // Bind groups keep the previous buffers alive until they are recreated.
            self.gpu.count_buffer();
        }
        self.scene.lent.rays = rays.iter().cloned().collect();
        self.scene.rays = rays;
    }

    /// Creates an empty encoder.
    pub fn encoder(&self) -> Result<CommandEncoder> {
        self.gpu.encoder("nothing")
    }

    /// Makes the next submission go into this encoder instead of the queue. The program should have submitted the
    /// previous encoder.
    pub fn lend_encoder(&mut self, encoder: CommandEncoder) -> Result<()> {
        let lent = &mut self.scene.encoder;
        lent.encoder = Some(encoder);
        if let Some((_, place @ None)) = lent.under_way.back_mut() {
            // The index of the program's own submission is unknown, so a later one is used.
            *place = Some(self.gpu.submit([])?);
        }
        Ok(())
    }

    /// Takes back the encoder lent last, unless it was taken already.
    pub fn take_encoder(&mut self) -> Option<CommandEncoder> {
        self.scene.encoder.encoder.take()
    }

    /// Returns whether any encoder contains unfinished submissions.
    pub fn has_encoded(&self) -> bool {
        !self.scene.encoder.under_way.is_empty()
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
