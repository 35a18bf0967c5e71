//! Limits of the device, with errors that name the need and the limit, and optional capabilities.

use crate::instance::VulkanInstance;
use crate::sharing;
use ash::ext::pipeline_robustness;
use ash::vk;
use backend::{BackendError, Result};
use gpu_common::{KernelLimit, check_limit};
use shaders::storage_buffers;
use std::ffi::CStr;

/// Limits of a device that matter for scenes, queries and kernels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DeviceLimits {
    /// `maxStorageBufferRange`, bytes.
    pub(crate) storage_range: u64,
    /// `maxMemoryAllocationSize`, bytes.
    pub(crate) allocation: u64,
    /// The lower value of `maxComputeWorkGroupCount` along x and y.
    pub(crate) groups: u32,
    /// Maximum invocations of a workgroup: the lower of the limits along x and in total.
    pub(crate) workgroup: u32,
    /// `maxPerStageDescriptorStorageBuffers`.
    pub(crate) storage_buffers: u32,
    pub(crate) uniform_alignment: u64,
    /// `maxTimelineSemaphoreValueDifference`.
    pub(crate) timeline_difference: u64,
    /// Nanoseconds per tick of the device's clock.
    pub(crate) tick_ns: f64,
}

impl DeviceLimits {
    pub(crate) fn of(instance: &VulkanInstance, device: vk::PhysicalDevice) -> Self {
        let mut p11 = vk::PhysicalDeviceVulkan11Properties::default();
        let mut p12 = vk::PhysicalDeviceVulkan12Properties::default();
        let mut p = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut p11)
            .push_next(&mut p12);
        instance.read_properties(device, &mut p);
        let l = p.properties.limits;
        let [x, y, _] = l.max_compute_work_group_count;
        let invocations = l.max_compute_work_group_invocations;
        Self {
            storage_range: u64::from(l.max_storage_buffer_range),
            allocation: p11.max_memory_allocation_size,
            groups: x.min(y),
            workgroup: invocations.min(l.max_compute_work_group_size[0]),
            storage_buffers: l.max_per_stage_descriptor_storage_buffers,
            uniform_alignment: l.min_uniform_buffer_offset_alignment.max(16),
            timeline_difference: p12.max_timeline_semaphore_value_difference,
            tick_ns: f64::from(l.timestamp_period),
        }
    }

    /// Checks that a kernel can address the whole buffer, and that its memory can be allocated in one piece.
    ///
    /// # Errors
    /// [`backend::BackendError::Limit`].
    pub(crate) fn admit(&self, what: &str, bytes: u64) -> Result<()> {
        for (name, most) in [
            ("maxStorageBufferRange", self.storage_range),
            ("maxMemoryAllocationSize", self.allocation),
        ] {
            check_limit(|| format!("{what} (bytes, {name})"), bytes, most)?;
        }
        Ok(())
    }

    /// Checks that a timeline with value `now` can be signalled with `signal`.
    ///
    /// # Errors
    /// [`BackendError::Misuse`].
    pub(crate) fn admit_signal(&self, now: u64, signal: u64) -> Result<()> {
        let most = self.timeline_difference;
        if signal.saturating_sub(now) <= most {
            return Ok(());
        }
        let why = format!(
            "the semaphore cannot signal {signal}: the value must exceed the current value, {now}, by at most {most} \
             (maxTimelineSemaphoreValueDifference)"
        );
        Err(BackendError::Misuse(why))
    }

    /// Returns the limits for kernels.
    pub(crate) fn of_kernels(&self) -> Vec<KernelLimit> {
        vec![
            KernelLimit {
                name: "maxPerStageDescriptorStorageBuffers",
                need: |kernel| storage_buffers(kernel.bindings),
                most: self.storage_buffers,
            },
            KernelLimit {
                name: "maxComputeWorkGroupInvocations",
                need: |kernel| kernel.workgroup[0],
                most: self.workgroup,
            },
        ]
    }

    /// Returns names and values, for display.
    pub(crate) fn displayed_limits(&self) -> Vec<(&'static str, String)> {
        vec![
            ("max storage buffer bytes", self.storage_range.to_string()),
            ("max allocation bytes", self.allocation.to_string()),
            ("max storage buffers", self.storage_buffers.to_string()),
            ("max workgroup size", self.workgroup.to_string()),
            ("max workgroups along an axis", self.groups.to_string()),
            ("timestamp period ns", self.tick_ns.to_string()),
        ]
    }
}

/// Optional capabilities that are enabled if the device supports them.
#[derive(Clone, Debug)]
pub struct DeviceFeatures {
    /// Acceleration structures and ray tracing pipelines, if they were requested.
    pub(crate) traces_rays: bool,
    /// Pipelines without robustness checks of buffers. NVIDIA's driver checks each address even if robust access is not
    /// requested. The checks are a sixth of the instructions per tree node and 4 % of the trace time (driver 580,
    /// H200).
    pub(crate) has_pipeline_robustness: bool,
    /// Invocations per subgroup, if the device supports the subgroup operations of the kernels.
    pub(crate) subgroups: Option<u32>,
    /// An atomic minimum of 64-bit numbers in buffers.
    pub(crate) has_64_bit_atomics: bool,
    /// Extensions for exporting memory and semaphores, and for importing host pages.
    pub sharing: Vec<&'static CStr>,
}

impl DeviceFeatures {
    /// Reads the capabilities of a device. With `traces_rays`, the caller must have checked that the device supports
    /// ray tracing.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] if a required feature is missing.
    pub(crate) fn of(
        instance: &VulkanInstance,
        device: vk::PhysicalDevice,
        traces_rays: bool,
    ) -> Result<Self> {
        let mut core = vk::PhysicalDeviceVulkan12Features::default();
        let mut robustness = vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default();
        let mut have = vk::PhysicalDeviceFeatures2::default().push_next(&mut core);
        if instance.offers(device, pipeline_robustness::NAME) {
            have = have.push_next(&mut robustness);
        }
        instance.read_features(device, &mut have);
        let has_integers = have.features.shader_int64 == vk::TRUE;
        if core.timeline_semaphore == vk::FALSE {
            let why = "the device has no timeline semaphores (Vulkan 1.2)";
            return Err(BackendError::NoDevice(why.into()));
        }
        Ok(Self {
            traces_rays,
            has_pipeline_robustness: robustness.pipeline_robustness == vk::TRUE,
            subgroups: subgroups(instance, device),
            has_64_bit_atomics: has_integers && core.shader_buffer_int64_atomics == vk::TRUE,
            sharing: sharing::extensions(instance, device),
        })
    }
}

/// Returns the number of invocations per subgroup. All kernels run with this subgroup size, because they request no
/// other. Returns `None` if a subgroup operation of the kernels is missing.
fn subgroups(instance: &VulkanInstance, device: vk::PhysicalDevice) -> Option<u32> {
    let mut found = vk::PhysicalDeviceSubgroupProperties::default();
    let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut found);
    instance.read_properties(device, &mut all);
    let needed = vk::SubgroupFeatureFlags::BASIC
        | vk::SubgroupFeatureFlags::VOTE
        | vk::SubgroupFeatureFlags::ARITHMETIC
        | vk::SubgroupFeatureFlags::SHUFFLE;
    let suffices = found
        .supported_stages
        .contains(vk::ShaderStageFlags::COMPUTE)
        && found.supported_operations.contains(needed);
    suffices.then_some(found.subgroup_size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpu_common::check_kernels;
    use shaders::Kernel;

    const LIMITS: DeviceLimits = DeviceLimits {
        storage_range: 1 << 27,
        allocation: 1 << 30,
        groups: 65535,
        workgroup: 256,
        storage_buffers: 8,
        uniform_alignment: 64,
        timeline_difference: (1 << 31) - 1,
        tick_ns: 1.0,
    };

    #[test]
    fn buffer_error_states_need_and_limit() {
        assert_eq!(LIMITS.admit("hits", 1 << 27), Ok(()));
        let refused = LIMITS.admit("hits", (1 << 27) + 16).unwrap_err();
        let expected =
            "hits (bytes, maxStorageBufferRange) needs 134217744, the limit is 134217728";
        assert_eq!(refused.to_string(), expected);
        let generous = DeviceLimits {
            storage_range: u64::from(u32::MAX),
            ..LIMITS
        };
        let refused = generous.admit("hits", (1 << 30) + 16).unwrap_err();
        let expected =
            "hits (bytes, maxMemoryAllocationSize) needs 1073741840, the limit is 1073741824";
        assert_eq!(refused.to_string(), expected);
    }

    #[test]
    fn distant_signal_is_misuse() {
        assert_eq!(LIMITS.admit_signal(5, (1 << 31) + 4), Ok(()));
        let refused = LIMITS.admit_signal(5, (1 << 31) + 5);
        assert!(
            matches!(refused, Err(BackendError::Misuse(_))),
            "{refused:?}"
        );
    }

    #[test]
    fn kernel_error_states_limit() {
        let required = |k: &Kernel| !k.builds_trees();
        let admit = |limits: DeviceLimits, kernels: fn(&Kernel) -> bool| {
            check_kernels(&limits.of_kernels(), kernels)
        };
        assert_eq!(admit(LIMITS, required), Ok(()));
        let poor = DeviceLimits {
            storage_buffers: 3,
            ..LIMITS
        };
        let refused = admit(poor, required).unwrap_err().to_string();
        assert!(refused.starts_with("kernel "), "{refused}");
        assert!(refused.ends_with("the limit is 3"), "{refused}");
        let small = DeviceLimits {
            workgroup: 128,
            ..LIMITS
        };
        let expected = "maxComputeWorkGroupInvocations) needs 256, the limit is 128";
        for kernels in [required, Kernel::builds_trees] {
            let refused = admit(small, kernels).unwrap_err().to_string();
            assert!(refused.ends_with(expected), "{refused}");
        }
    }
}
