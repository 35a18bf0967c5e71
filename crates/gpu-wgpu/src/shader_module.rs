//! What shaders of the program's own trace.

use crate::buffers::{make, write};
use crate::wgpu_device::{WgpuBackend, WgpuDevice};
use backend::Result;
use shaders::Params;
use wgpu::{Buffer, BufferUsages};

/// WGSL that such shaders call; it reads a [`TracedScene`], which is bound in group 0.
pub use shaders::MODULE as SHADER_MODULE;

/// Parameters, the tree's nodes, its triangles, and how far coordinates reach.
pub type TracedScene = [Buffer; 4];

/// The scene as the last submission leaves it; `None` if none brought it up to date, or by another method than the usual.
///
/// # Errors
/// A buffer cannot be made.
pub fn traced_scene(backend: &mut WgpuBackend) -> Result<Option<TracedScene>> {
    let Some((params, others)) = backend.traced_scene() else {
        return Ok(None);
    };
    let [nodes, records, range] = others.map(Clone::clone);
    let params = backend.gpu_mut().module_params(params)?;
    Ok(Some([params, nodes, records, range]))
}

impl WgpuDevice {
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
