//! Features and limits that the backend or a scene requires of a device.

use backend::{Intersector, Result};
use geom::Animation;
use gpu_common::{KernelLimit, check_kernels};
use shaders::{KERNELS, Params, storage_buffers};
use wgpu::{Buffer, Features, Limits};

/// Returns the features that [`crate::from_device`] requires. Currently it requires no features.
#[must_use]
pub fn required_features() -> Features {
    Features::empty()
}

/// Returns the features that a program should request if its adapter has them:
///
/// - Timestamps. Without them stages are not timed.
/// - Timestamps within passes. Without them each stage needs a pass of its own, which takes some microseconds.
/// - Passthrough shaders. On Vulkan, kernels are then SPIR-V, with less arithmetic than the WGSL form.
/// - Subgroups, for packet traversal.
/// - Pipeline caches, which save compilation.
/// - A 64-bit atomic minimum, for rasterizing the first hits of large scenes.
#[must_use]
pub fn useful_features() -> Features {
    Features::TIMESTAMP_QUERY
        | WITHIN_PASSES
        | Features::PASSTHROUGH_SHADERS
        | Features::SUBGROUP
        | Features::PIPELINE_CACHE
        | ATOMIC_MIN_64_BITS
}

/// Feature with which several stages of one pass are timed separately.
pub(crate) const WITHIN_PASSES: Features = Features::TIMESTAMP_QUERY_INSIDE_PASSES;

/// Features that rasterization requires: a 64-bit atomic minimum that returns the former value.
pub(crate) const ATOMIC_MIN_64_BITS: Features =
    Features::SHADER_INT64.union(Features::SHADER_INT64_ATOMIC_ALL_OPS);

/// Returns the limits that the program's device needs for `animation`, traced with up to `rays` rays at a time.
///
/// They are the minimum. Merge them with the program's own by [`Limits::or_better_values_from`].
#[must_use]
pub fn required_limits(animation: &Animation, rays: usize) -> Limits {
    let leaves = animation.live_count() as u64;
    // A query has at most this number of rays.
    let rays = (rays as u64).min(u32::MAX.into());
    let largest = [
        animation.vertex_count() as u64 * 12,
        animation.triangle_count() as u64 * 12,
        // Upper bound of the nodes and of the triangle records. See `Treelets::rows`.
        leaves * 80 + 64,
        rays * 32,
        shaders::occluded_words(Intersector::Exact, rays) * 4,
    ];
    let bytes = largest.into_iter().fold(1 << 20, u64::max);
    let bytes = bytes.next_multiple_of(16);
    Limits {
        max_buffer_size: bytes,
        max_storage_buffer_binding_size: bytes,
        ..minimum_limits()
    }
}

/// Returns the limits that every scene requires.
fn minimum_limits() -> Limits {
    let all = KERNELS.iter().map(|k| storage_buffers(k.bindings));
    Limits {
        max_storage_buffers_per_shader_stage: all.max().unwrap_or(0),
        ..Limits::downlevel_defaults()
    }
}

/// Returns the limits to request from an adapter: those required, with buffers and dispatches as large as the adapter
/// allows, and with its alignments.
pub(crate) fn requested_limits(adapter: &Limits) -> Limits {
    Limits {
        max_buffer_size: adapter.max_buffer_size,
        max_storage_buffer_binding_size: adapter.max_storage_buffer_binding_size,
        max_compute_workgroups_per_dimension: adapter.max_compute_workgroups_per_dimension,
        min_uniform_buffer_offset_alignment: adapter.min_uniform_buffer_offset_alignment,
        min_storage_buffer_offset_alignment: adapter.min_storage_buffer_offset_alignment,
        ..minimum_limits()
    }
}

/// Checks that a device meets the requirements of every scene.
pub(crate) fn check(limits: &Limits) -> Result<()> {
    check_kernels(&kernel_limits(limits), |k| !k.builds_trees())
}

/// Returns the limits for kernels.
pub(crate) fn kernel_limits(limits: &Limits) -> Vec<KernelLimit> {
    vec![
        KernelLimit {
            name: "max_compute_workgroup_storage_size",
            need: |kernel| kernel.shared_bytes,
            most: limits.max_compute_workgroup_storage_size,
        },
        KernelLimit {
            name: "max_storage_buffers_per_shader_stage",
            need: |kernel| storage_buffers(kernel.bindings),
            most: limits.max_storage_buffers_per_shader_stage,
        },
        KernelLimit {
            name: "max_compute_invocations_per_workgroup or max_compute_workgroup_size_x",
            need: |kernel| kernel.workgroup[0],
            most: workgroup_size(limits),
        },
    ]
}

/// Returns the maximum number of invocations of a workgroup along the x axis.
fn workgroup_size(limits: &Limits) -> u32 {
    limits
        .max_compute_invocations_per_workgroup
        .min(limits.max_compute_workgroup_size_x)
}

/// Returns names and values of limits that affect the work, for display.
pub(crate) fn displayed_limits(limits: &Limits) -> Vec<(&'static str, String)> {
    let all = [
        (
            "max storage buffer bytes",
            limits.max_storage_buffer_binding_size,
        ),
        ("max buffer bytes", limits.max_buffer_size),
        (
            "max storage buffers",
            limits.max_storage_buffers_per_shader_stage.into(),
        ),
        ("max workgroup size", workgroup_size(limits).into()),
        (
            "max workgroups along an axis",
            limits.max_compute_workgroups_per_dimension.into(),
        ),
        (
            "parameter alignment bytes",
            limits.min_uniform_buffer_offset_alignment.into(),
        ),
    ];
    all.map(|(name, value)| (name, value.to_string())).to_vec()
}

/// Returns the maximum bytes of a storage buffer. Kernels compute sizes in 32 bits, so it is at most 4 GiB.
pub(crate) fn max_storage_bytes(limits: &Limits) -> u64 {
    let largest = limits
        .max_storage_buffer_binding_size
        .min(limits.max_buffer_size);
    largest.min(u64::from(u32::MAX)) / 16 * 16
}

/// Returns the bytes that a storage binding can cover, from the beginning of a buffer. They are a multiple of 4.
pub(crate) fn bindable_bytes(limits: &Limits, buffer: &Buffer) -> u64 {
    buffer.size().min(max_storage_bytes(limits)) / 4 * 4
}

/// Returns the distance in bytes between the parameters of consecutive dispatches.
pub(crate) fn params_stride(limits: &Limits) -> u64 {
    let align = u64::from(limits.min_uniform_buffer_offset_alignment).max(16);
    (size_of::<Params>() as u64).next_multiple_of(align)
}

#[cfg(test)]
mod tests {
    use super::*;
    use shaders::Kernel;

    #[test]
    fn required_limits_do_not_overflow() {
        let animation = Animation::new(vec![vec![[0.0; 3]; 3]], vec![[0, 1, 2]]).unwrap();
        let limits = required_limits(&animation, usize::MAX);
        assert!(limits.max_buffer_size > 32 * u64::from(u32::MAX - 1));
    }

    #[test]
    fn device_error_states_workgroup_memory_limit() {
        assert_eq!(check(&minimum_limits()), Ok(()));
        let cramped = Limits {
            max_compute_workgroup_storage_size: 256,
            ..minimum_limits()
        };
        let refused = check(&cramped).unwrap_err().to_string();
        let expected = "(max_compute_workgroup_storage_size) needs 15376, the limit is 256";
        assert!(refused.ends_with(expected), "{refused}");
        let builds_trees =
            |limits: &Limits| check_kernels(&kernel_limits(limits), Kernel::builds_trees);
        assert_eq!(builds_trees(&minimum_limits()), Ok(()));
        let cramped = Limits {
            max_compute_workgroup_storage_size: 15376,
            ..minimum_limits()
        };
        assert_eq!(check(&cramped), Ok(()));
        assert!(builds_trees(&cramped).is_err());
    }
}
