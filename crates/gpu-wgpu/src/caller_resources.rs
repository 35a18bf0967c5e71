//! Resources shared with the program on its own device, without copies through the host.
//!
//! Positions are copied from the program's buffers. Kernels bind the program's ray buffers directly. The program's
//! shaders can trace the scene.

use crate::buffer_points::POINT;
use crate::buffers::write;
use crate::launches::params_buffer;
use crate::limits::bindable_bytes;
use crate::wgpu_device::{WgpuBackend, WgpuDevice};
use backend::Result;
use gpu_common::{LentRays, PointsSource};
use shaders::Params;
use std::ops::Range;
use wgpu::{Buffer, BufferSlice, CommandEncoder};

impl WgpuDevice {
    /// Makes a buffer of the program the source of the positions from vertex `first` on, in all later key frames. The
    /// submission that uploads the next key frame copies them before its other work. Does not check that the buffer
    /// allows copies.
    pub fn set_buffer_points(&mut self, first: usize, from: BufferSlice<'_>) {
        self.scene.points.points.set(PointsSource {
            buffer: from.buffer().clone(),
            offset: from.offset(),
            run: first..first + (from.size() / POINT) as usize,
        });
    }

    /// Returns a buffer that contains the positions of a run, or `None` if the host is the source of the run. Submits
    /// scheduled copies first.
    ///
    /// # Errors
    /// A source buffer does not allow copies.
    pub fn points_buffer(&mut self, run: &Range<usize>) -> Result<Option<PointsSource<Buffer>>> {
        let (gpu, points) = (&self.gpu, &mut self.scene.points);
        if !points.points.runs().contains(run) {
            return Ok(None);
        }
        points
            .commands
            .append(&mut self.scene.caller_buffers.copies);
        if !points.commands.is_empty() {
            let mut encoder = gpu.encoder("a copy of positions")?;
            points.encode(gpu, &mut encoder)?;
            gpu.submit([encoder])?;
        }
        Ok(points.source(run))
    }

    /// Sets the host as the source of a run of positions again.
    pub fn release_points(&mut self, run: &Range<usize>) {
        self.scene.points.points.release(run);
    }

    /// Returns the bytes of a storage buffer that kernels can access, from its beginning.
    pub fn bindable_bytes(&self, buffer: &Buffer) -> u64 {
        bindable_bytes(&self.gpu.limits, buffer)
    }

    /// Makes the next queries of [`backend::Rays::OnDevice`] trace these rays, one element per query. Kernels must be
    /// able to [access](Self::bindable_bytes) all rays and results.
    pub fn set_ray_buffers(&mut self, rays: Vec<LentRays<Buffer>>) {
        if self.scene.rays != rays {
            // A higher count makes the next recording drop the bind groups, which keep the previous buffers alive.
            self.gpu.note_new_buffer();
        }
        self.scene.caller_buffers.rays = rays.iter().cloned().collect();
        self.scene.rays = rays;
    }

    /// Creates an empty encoder.
    pub fn encoder(&self) -> Result<CommandEncoder> {
        self.gpu.encoder("an encoder")
    }

    /// Makes the next submission go into this encoder instead of the queue. The program should have submitted the
    /// previous encoder. Keeps the encoder for [`Self::take_encoder`] even if it returns an error.
    pub fn set_encoder(&mut self, encoder: CommandEncoder) -> Result<()> {
        let caller = &mut self.scene.encoder;
        caller.encoder = Some(encoder);
        if let Some(mut last) = caller.under_way.last_entry()
            && last.get().is_none()
        {
            // The index of the program's own submission is unknown, so a later one is used.
            last.insert(Some(self.gpu.submit([])?));
        }
        Ok(())
    }

    /// Takes back the encoder that was set last, unless it was taken already.
    pub fn take_encoder(&mut self) -> Option<CommandEncoder> {
        self.scene.encoder.encoder.take()
    }

    /// Returns whether the next submission would go to the queue while encoders contain unfinished submissions.
    pub fn overtakes_encoded(&self) -> bool {
        let caller = &self.scene.encoder;
        caller.encoder.is_none() && !caller.under_way.is_empty()
    }

    /// Returns a buffer with these parameters. Changed parameters get a new buffer, because unsubmitted work may still
    /// read the previous one.
    fn module_params(&mut self, params: Params) -> Result<Buffer> {
        if let Some((_, buffer)) = self.module_params.as_ref().filter(|(of, _)| *of == params) {
            return Ok(buffer.clone());
        }
        let bytes = bytemuck::bytes_of(&params);
        let buffer = params_buffer(&self.gpu, bytes.len() as u64)?;
        write(&self.gpu, &buffer, 0, bytes)?;
        self.module_params = Some((params, buffer.clone()));
        Ok(buffer)
    }
}

/// Parameters, nodes of the tree, triangle records, and range of the coordinates.
pub type TracedScene = [Buffer; 4];

/// Returns the scene's buffers after the last submission. Returns `None` in the cases of
/// [`traced_scene`](gpu_common::ComputeBackend::traced_scene).
pub fn traced_scene(backend: &mut WgpuBackend) -> Result<Option<TracedScene>> {
    let Some((params, others)) = backend.traced_scene() else {
        return Ok(None);
    };
    let [nodes, records, range] = others.map(Clone::clone);
    let params = backend.gpu_mut().module_params(params)?;
    Ok(Some([params, nodes, records, range]))
}
