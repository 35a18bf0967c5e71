//! Rays that shaders of the program's own trace, on its wgpu device.
//!
//! ```wgsl
//! let hit = abvh_closest(origin, 0.0, direction, 1e30);
//! if hit.triangle < ABVH_EXTREME { color = shade(hit.t, hit.u, hit.v, hit.triangle); }
//! ```
//!
//! | in WGSL | what it is |
//! |---|---|
//! | `abvh_closest(origin, t_min, direction, t_max) -> AbvhHit` | the closest hit for `t` between `t_min` and `t_max` |
//! | `abvh_any(origin, t_min, direction, t_max) -> u32` | 1 if there is any hit, else 0 |
//! | `AbvhHit { t, u, v, triangle }` | as [`Tracer::hits_buffer`] has it |
//! | `ABVH_MISS` | in place of a triangle: nothing is hit |
//! | `ABVH_EXTREME` | in place of a triangle, or of 0 and 1: the ray is not answered |
//!
//! Answers are those of queries by [`Intersector::Watertight`](crate::Intersector::Watertight), bit for bit. Extreme rays
//! start very far away, or where some vertex is (see [`accuracy`](crate::guide::accuracy)). Queries answer them, too.

use crate::own_device::no_wgpu;
use crate::{Error, Result, Tracer};
use gpu_wgpu::{SHADER_MODULE, traced_scene};

/// The text to be put before a shader that calls it. Other names in it begin with `package_`. Its four buffers are bound in
/// this group: a uniform one, then three that are read only.
#[must_use]
pub fn wgsl(group: u32) -> String {
    SHADER_MODULE.replace("@group(0)", &format!("@group({group})"))
}

/// The buffers that such shaders read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneBuffers([wgpu::Buffer; 4]);

impl SceneBuffers {
    /// To be bound in the group that was given to [`wgsl`].
    #[must_use]
    pub fn entries(&self) -> [wgpu::BindGroupEntry<'_>; 4] {
        [0, 1, 2, 3].map(|i| wgpu::BindGroupEntry {
            binding: i as u32,
            resource: self.0[i].as_entire_binding(),
        })
    }
}

impl Tracer {
    /// The scene as the last step leaves it that had a query or was [encoded](crate::Step::encode), for commands that come
    /// after that step and before the next. The buffers are mostly the same as before: compare, to bind them anew if not.
    ///
    /// # Errors
    /// [`Error::Unsupported`] on another device; [`Error::Misuse`] before there was such a step, or by another intersector or
    /// layout.
    pub fn scene_buffers(&mut self) -> Result<SceneBuffers> {
        let backend = self.state().current.wgpu().ok_or_else(no_wgpu)?;
        let found = traced_scene(backend).map_err(Error::of_backend)?;
        let why = "shaders trace by `watertight` and layout `fast`, after a step with a query or one that was encoded";
        let found = found.ok_or_else(|| Error::Misuse(why.into()));
        found.map(SceneBuffers)
    }
}
