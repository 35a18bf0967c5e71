//! The scene that the driver builds its tree from, and the handling of vertices that are not finite.

use super::support::RayTracing;
use super::tree::{Flags, VulkanTree};
use backend::Result;
use geom::{Animation, Point};
use gpu_common::{Engine, GpuDevice};
use gpu_vulkan::VulkanDevice;
use gpu_vulkan::memory::{Buffer, BufferUse};
use std::sync::Arc;

/// Coordinates of smaller magnitude cannot overflow when two key frames are blended.
const HUGE: f32 = f32::MAX / 4.0;

/// State of a loaded scene, in addition to its buffers.
pub(crate) struct VulkanScene {
    pub(crate) tree: VulkanTree,
    /// Box of all key frames, multiplied by `2^-scale_exponent`: minimum and maximum, 16 bytes each. The ray shaders
    /// read it as the first two rows of the buffer `nodes`.
    pub(crate) root: Buffer,
    /// Three finite vertices per triangle; `None` if positions are always finite.
    pub(crate) finite_triangles: Option<Buffer>,
    /// Point to which triangles with a vertex that is not finite collapse, so that no ray hits them. In scene units.
    pub(crate) centre: Point,
}

impl VulkanScene {
    /// Creates the state for the scene that the engine has loaded.
    pub(crate) fn new(
        engine: &mut Engine<VulkanDevice>,
        ray_tracing: &Arc<RayTracing>,
        flags: Flags,
    ) -> Result<Self> {
        let animation = Arc::clone(&engine.scene().animation);
        let bytes = animation.triangle_count() as u64 * 36;
        let device = |what, bytes| Buffer::new(&ray_tracing.gpu, what, bytes, BufferUse::Device);
        let finite_triangles = if is_always_finite(&animation) {
            None
        } else {
            Some(device("finite triangles", bytes)?)
        };
        let root = device("the scene's box", 32)?;
        let corners = root_of(&animation);
        engine
            .gpu
            .upload(&[(bytemuck::cast_slice(&corners), &root)])?;
        Ok(Self {
            tree: VulkanTree::new(engine, ray_tracing, finite_triangles.as_ref(), flags)?,
            root,
            finite_triangles,
            centre: centre_of(&animation),
        })
    }

    /// Returns the bytes of device memory of the tree, and of its scratch and input buffers except positions.
    pub(crate) fn held(&self) -> [u64; 2] {
        let finite_triangles = self.finite_triangles.as_ref().map_or(0, Buffer::held);
        let [tree, scratch] = self.tree.held();
        [tree + self.root.held(), scratch + finite_triangles]
    }
}

fn root_of(animation: &Animation) -> [f32; 8] {
    let bounds = animation.bounds();
    let scale = (-f64::from(animation.scale_exponent())).exp2();
    let scaled = |p: Point| p.map(|x| (f64::from(x) * scale) as f32);
    let ([a, b, c], [d, e, f]) = (scaled(bounds.min), scaled(bounds.max));
    [a, b, c, 0.0, d, e, f, 0.0]
}

/// Returns the centre of all key frames, or the origin if the scene is empty.
fn centre_of(animation: &Animation) -> Point {
    let bounds = animation.bounds();
    let middle = |i: usize| f32::midpoint(bounds.min[i], bounds.max[i]);
    let middle = [middle(0), middle(1), middle(2)];
    if middle.iter().all(|x| x.is_finite()) {
        middle
    } else {
        [0.0; 3]
    }
}

/// Returns whether all vertices are finite and remain finite when blended. Returns `false` for streamed animations,
/// whose future key frames are unknown.
fn is_always_finite(animation: &Animation) -> bool {
    let is_finite_key = |key: usize| {
        let vertices = animation.key(key);
        vertices.is_ok_and(|vertices| vertices.iter().flatten().all(|x| x.abs() < HUGE))
    };
    !animation.is_streamed() && (0..animation.key_count()).all(is_finite_key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detects_possibly_non_finite_vertices() {
        let of = |x: f32| {
            let keys = vec![vec![[1.0; 3]], vec![[0.0, x, 1.0]]];
            is_always_finite(&Animation::new(keys, vec![]).unwrap())
        };
        assert!(of(2.0) && of(-1e30));
        for bad in [f32::NAN, f32::INFINITY, f32::MIN] {
            assert!(!of(bad), "{bad}");
        }
        let streamed = Animation::streamed(vec![[0.0; 3]], &[false], Vec::new());
        assert!(!is_always_finite(&streamed.unwrap()));
    }
}
