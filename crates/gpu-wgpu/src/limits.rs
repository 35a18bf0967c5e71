//! What the backend needs of a device, and what a scene needs of it.

use crate::marks::WITHIN_PASSES;
use backend::{BackendError, Intersector, Result};
use geom::Animation;
use shaders::{KERNELS, Kernel, Params, storage_buffers};
use wgpu::{Features, Limits};

/// Features without which [`crate::from_device`] refuses a device: none.
#[must_use]
pub fn required_features() -> Features {
    Features::empty()
}

/// Features that an engine should ask for where its adapter has them: timestamps, without which stages are not timed;
/// timestamps within passes, without which each stage takes a pass of its own, and so some microseconds more; shaders
/// passed through, which spares the kernels some arithmetic on Vulkan; subgroups, by which rays search together; and the
/// least of numbers of 64 bits, by which the first hits of large scenes are found triangle by triangle.
#[must_use]
pub fn useful_features() -> Features {
    Features::TIMESTAMP_QUERY
        | WITHIN_PASSES
        | Features::PASSTHROUGH_SHADERS
        | Features::SUBGROUP
        | Features::PIPELINE_CACHE
        | LEAST_OF_64_BITS
}

/// What kernels of rasterization ask for: an atomic minimum that returns the former value.
pub(crate) const LEAST_OF_64_BITS: Features =
    Features::SHADER_INT64.union(Features::SHADER_INT64_ATOMIC_ALL_OPS);

/// The limits that an engine's device needs for `animation`, traced by up to `rays` rays at a time.
///
/// They are the least that suffice; merge them with the engine's own by [`Limits::or_better_values_from`].
#[must_use]
pub fn required_limits(animation: &Animation, rays: usize) -> Limits {
    let leaves = animation.live_count() as u64;
    let largest = [
        animation.vertex_count() as u64 * 12,
        animation.triangle_count() as u64 * 12,
        // Nodes, of layout `fast` at the worst, and so records of triangles: see `tree.rs`.
        leaves * 80 + 64,
        rays as u64 * 32,
        shaders::occluded_words(Intersector::Exact, rays as u64) * 4,
    ];
    let bytes = largest.into_iter().fold(1 << 20, u64::max);
    let bytes = bytes.next_multiple_of(16);
    Limits {
        max_buffer_size: bytes,
        max_storage_buffer_binding_size: bytes,
        ..least()
    }
}

/// What every scene needs.
fn least() -> Limits {
    let all = KERNELS.iter().map(|k| storage_buffers(k.bindings));
    Limits {
        max_storage_buffers_per_shader_stage: all.max().unwrap_or(0),
        ..Limits::downlevel_defaults()
    }
}

/// What to ask of an adapter of our own: what is needed, with buffers as large as it allows.
pub(crate) fn generous(adapter: &Limits) -> Limits {
    Limits {
        max_buffer_size: adapter.max_buffer_size,
        max_storage_buffer_binding_size: adapter.max_storage_buffer_binding_size,
        max_compute_workgroups_per_dimension: adapter.max_compute_workgroups_per_dimension,
        min_uniform_buffer_offset_alignment: adapter.min_uniform_buffer_offset_alignment,
        min_storage_buffer_offset_alignment: adapter.min_storage_buffer_offset_alignment,
        ..least()
    }
}

/// Refuses a device that no scene fits.
pub(crate) fn check(limits: &Limits) -> Result<()> {
    check_kernels(limits, &|k| !k.makes_trees())
}

/// Refuses a device on which one of these kernels cannot run.
pub(crate) fn check_kernels(limits: &Limits, asked: &dyn Fn(&Kernel) -> bool) -> Result<()> {
    let kernels = || KERNELS.iter().filter(|k| asked(k));
    let most = |of: fn(&Kernel) -> u32| kernels().map(of).max().unwrap_or(0);
    let group = most(|k| k.workgroup[0]);
    let need = Limits {
        max_bindings_per_bind_group: most(|k| k.bindings.len() as u32),
        max_compute_workgroup_storage_size: most(|k| k.shared_bytes),
        max_storage_buffers_per_shader_stage: least().max_storage_buffers_per_shader_stage,
        max_compute_invocations_per_workgroup: group,
        max_compute_workgroup_size_x: group,
        max_dynamic_uniform_buffers_per_pipeline_layout: 1,
        ..limits.clone()
    };
    let mut checked = Ok(());
    need.check_limits_with_fail_fn(limits, true, |what, need, limit| {
        let what = format!("the device's {what}");
        checked = Err(BackendError::Limit { what, need, limit });
    });
    checked
}

/// What bounds the work on such a device: names and values, to be shown.
pub(crate) fn named(limits: &Limits) -> Vec<(&'static str, String)> {
    let group = limits
        .max_compute_invocations_per_workgroup
        .min(limits.max_compute_workgroup_size_x);
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
        ("max workgroup size", group.into()),
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

/// Bytes that one storage buffer may span. Kernels count words in 32 bits, so never more than 4 GiB.
pub(crate) fn span(limits: &Limits) -> u64 {
    let largest = limits
        .max_storage_buffer_binding_size
        .min(limits.max_buffer_size);
    largest.min(u64::from(u32::MAX)) / 16 * 16
}

/// Distance from one dispatch's parameters to the next one's.
pub(crate) fn params_stride(limits: &Limits) -> u64 {
    let align = u64::from(limits.min_uniform_buffer_offset_alignment).max(16);
    (size_of::<Params>() as u64).next_multiple_of(align)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_with_too_little_workgroup_memory_is_refused_by_the_limits_name() {
        assert_eq!(check(&least()), Ok(()));
        let cramped = Limits {
            max_compute_workgroup_storage_size: 256,
            ..least()
        };
        let refused = check(&cramped).unwrap_err().to_string();
        let expected =
            "the device's max_compute_workgroup_storage_size needs 15376, the limit is 256";
        assert_eq!(refused, expected);
        assert_eq!(check_kernels(&least(), &Kernel::makes_trees), Ok(()));
        let cramped = Limits {
            max_compute_workgroup_storage_size: 15376,
            ..least()
        };
        assert_eq!(check(&cramped), Ok(()));
        assert!(check_kernels(&cramped, &Kernel::makes_trees).is_err());
    }
}
