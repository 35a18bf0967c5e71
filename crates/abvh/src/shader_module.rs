//! Traces rays from the program's own shaders, on its wgpu device.
//!
//! ```wgsl
//! let hit = abvh_closest(origin, 0.0, direction, 1e30);
//! if hit.triangle < ABVH_EXTREME { color = shade(hit.t, hit.u, hit.v, hit.triangle); }
//! ```
//!
//! | in WGSL | meaning |
//! |---|---|
//! | `abvh_closest(origin, t_min, direction, t_max) -> AbvhHit` | closest hit for `t` between `t_min` and `t_max` |
//! | `abvh_any(origin, t_min, direction, t_max) -> u32` | 1 if there is any hit, else 0 |
//! | `AbvhHit { t, u, v, triangle }` | a hit in the format of [`Tracer::hits_buffer`] |
//! | `ABVH_MISS` | value of `triangle` for a miss |
//! | `ABVH_EXTREME` | value of `triangle`, or result of `abvh_any`, for an extreme ray, which shaders cannot trace |
//!
//! Results are those of queries with [`Intersector::Watertight`](crate::Intersector::Watertight), bit for bit. The
//! [accuracy guide](crate::guide::accuracy) defines extreme rays. Queries can trace them.

use crate::loaded::no_wgpu;
use crate::{Error, Result, Tracer};
use gpu_wgpu::{SHADER_MODULE, traced_scene};

/// Returns the WGSL source to prepend to a shader. All names that the [module page](self) does not list begin with
/// `abvh_`. The source binds four buffers in bind group `group`: a uniform buffer and three read-only storage buffers.
#[must_use]
pub fn wgsl(group: u32) -> String {
    SHADER_MODULE.replace("@group(0)", &format!("@group({group})"))
}

/// The buffers that shaders with the source from [`wgsl`] read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneBuffers([wgpu::Buffer; 4]);

impl SceneBuffers {
    /// Returns the entries of the bind group whose index was passed to [`wgsl`].
    #[must_use]
    pub fn entries(&self) -> [wgpu::BindGroupEntry<'_>; 4] {
        [0, 1, 2, 3].map(|i| wgpu::BindGroupEntry {
            binding: i as u32,
            resource: self.0[i].as_entire_binding(),
        })
    }
}

impl Tracer {
    /// Returns the buffers of the scene after the last step that had a query or was [encoded](crate::Step::encode), or
    /// after [`Tracer::warm_up`] if there is no such step. They are valid for commands before the next step. The
    /// buffers rarely change. Compare them with the previous ones to see if a new bind group is needed.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on devices other than wgpu's. [`Error::Misuse`] for another intersector than
    /// `watertight`, and before the first such step or `warm_up`. After a mesh was [replaced](Tracer::commit), a step
    /// failed, or the encoder of a step was dropped, also [`Error::Misuse`] until such a step succeeds.
    pub fn scene_buffers(&mut self) -> Result<SceneBuffers> {
        let current = &mut self.state().current;
        let is_stale = current.is_stale;
        let backend = current.wgpu().ok_or_else(no_wgpu)?;
        let found = traced_scene(backend).map_err(Error::of_backend)?;
        let why = "shaders need `watertight`, and an earlier step with a query or `encode`";
        let found = found.filter(|_| !is_stale);
        let found = found.ok_or_else(|| Error::Misuse(why.into()));
        found.map(SceneBuffers)
    }
}
