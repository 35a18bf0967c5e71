//! What a device can do beyond what every device must, and the kernels make use of.

use crate::instance::Host;
use ash::ext::pipeline_robustness;
use ash::vk;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Extras {
    /// Whether pipelines may say that their kernels stay within their buffers. NVIDIA's driver checks each address even where
    /// nobody asks for robust access: a sixth of the instructions at a tree's node, 4 % of a frame's rays (580, an H200).
    pub(crate) trusts_kernels: bool,
    /// Invocations of a subgroup, where kernels may have them tell each other what they find.
    pub(crate) subgroups: Option<u32>,
    /// Whether buffers may keep the least of numbers of 64 bits.
    pub(crate) has_least_of_64_bits: bool,
}

impl Extras {
    pub(crate) fn of(host: &Host, device: vk::PhysicalDevice) -> Self {
        let mut core = vk::PhysicalDeviceVulkan12Features::default();
        let mut robustness = vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default();
        let mut have = vk::PhysicalDeviceFeatures2::default().push_next(&mut core);
        let name = pipeline_robustness::NAME.to_owned();
        if host.extensions(device).contains(&name) {
            have = have.push_next(&mut robustness);
        }
        // SAFETY: the device belongs to the instance, which is alive, and knows all structures of the chain.
        unsafe {
            host.instance
                .get_physical_device_features2(device, &mut have)
        };
        let has_integers = have.features.shader_int64 == vk::TRUE;
        Self {
            trusts_kernels: robustness.pipeline_robustness == vk::TRUE,
            subgroups: subgroups(host, device),
            has_least_of_64_bits: has_integers && core.shader_buffer_int64_atomics == vk::TRUE,
        }
    }
}

/// Invocations of a subgroup, which are as many in every kernel that does not ask for other sizes;
/// `None` if they cannot do all that kernels ask.
fn subgroups(host: &Host, device: vk::PhysicalDevice) -> Option<u32> {
    let mut found = vk::PhysicalDeviceSubgroupProperties::default();
    let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut found);
    // SAFETY: the device belongs to the instance, which is alive; the structure is of Vulkan 1.1.
    unsafe {
        host.instance
            .get_physical_device_properties2(device, &mut all)
    };
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
