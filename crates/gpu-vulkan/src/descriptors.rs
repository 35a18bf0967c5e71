//! Parameters and descriptor sets of the dispatches of one submission.

use crate::errors::failed;
use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::pipelines::descriptor_type;
use ash::vk;
use backend::Result;
use shaders::{Binding, KERNELS, Kind, Params, RAYS, storage_buffers};
use std::sync::Arc;

/// Minimum number of dispatches for which memory is allocated.
const LEAST: usize = 64;

/// Memory for the parameters and descriptor sets of one submission at a time.
pub(crate) struct Descriptors {
    /// Parameters of all dispatches. Each dispatch has its own dynamic offset.
    pub(crate) params: Buffer,
    sets: vk::DescriptorPool,
    /// Maximum number of dispatches.
    capacity: usize,
    /// Number of dispatches since the last reset.
    used: usize,
    /// Bytes between the parameters of consecutive dispatches.
    stride: u64,
    gpu: Arc<Gpu>,
}

impl Descriptors {
    pub(crate) fn new(gpu: &Arc<Gpu>, dispatches: usize) -> Result<Self> {
        let capacity = dispatches.next_power_of_two().max(LEAST);
        let stride = size_of::<Params>() as u64;
        let stride = stride.next_multiple_of(gpu.limits.uniform_alignment);
        let params = Buffer::new(
            gpu,
            "parameters",
            stride * capacity as u64,
            BufferUse::Upload,
        )?;
        Ok(Self {
            params,
            sets: descriptor_pool(gpu, capacity as u32)?,
            capacity,
            used: 0,
            stride,
            gpu: Arc::clone(gpu),
        })
    }

    /// Discards everything and prepares for a number of dispatches. The submission that used these descriptors last must
    /// have finished.
    pub(crate) fn reset(&mut self, dispatches: usize) -> Result<()> {
        if dispatches > self.capacity {
            *self = Self::new(&self.gpu, dispatches)?;
        }
        self.used = 0;
        let none = vk::DescriptorPoolResetFlags::empty();
        // SAFETY: no set of the pool is in use any more.
        unsafe { self.gpu.vk.reset_descriptor_pool(self.sets, none) }.map_err(failed("descriptors"))
    }

    /// Writes the parameters of the next dispatch. Returns their dynamic offset.
    pub(crate) fn write(&mut self, params: &Params) -> u32 {
        assert!(self.used < self.capacity, "the dispatches were counted");
        let at = self.stride * self.used as u64;
        self.used += 1;
        self.params.write(at, std::slice::from_ref(params));
        u32::try_from(at).expect("parameters are small")
    }

    /// Creates a set with these bindings. A set for ray tracing also binds the acceleration structure `tree`.
    pub(crate) fn set<'b>(
        &self,
        layout: vk::DescriptorSetLayout,
        bindings: impl Iterator<Item = (&'b Binding, vk::Buffer)> + Clone,
        tree: Option<vk::AccelerationStructureKHR>,
    ) -> Result<vk::DescriptorSet> {
        let layouts = [layout];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(self.sets)
            .set_layouts(&layouts);
        // SAFETY: the pool has capacity for one set per dispatch.
        let sets = unsafe { self.gpu.vk.allocate_descriptor_sets(&info) };
        let set = sets.map_err(failed("descriptors"))?[0];
        let info = |(binding, buffer): (&Binding, vk::Buffer)| {
            let bytes = match binding.kind {
                // The parameters of a single dispatch.
                Kind::Uniform => size_of::<Params>() as u64,
                Kind::Read | Kind::ReadWrite => vk::WHOLE_SIZE,
            };
            let info = vk::DescriptorBufferInfo::default().buffer(buffer);
            [info.range(bytes)]
        };
        let infos: Vec<_> = bindings.clone().map(info).collect();
        let write = |number, kind| {
            vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(number)
                .descriptor_type(kind)
        };
        let each = bindings.map(|(b, _)| b).zip(&infos);
        let each = each.map(|(b, info)| write(b.number, descriptor_type(b.kind)).buffer_info(info));
        let mut writes: Vec<_> = each.collect();
        let mut scene = vk::WriteDescriptorSetAccelerationStructureKHR::default()
            .acceleration_structures(tree.as_slice());
        if tree.is_some() {
            let tree = write(RAYS.scene, vk::DescriptorType::ACCELERATION_STRUCTURE_KHR);
            writes.push(tree.descriptor_count(1).push_next(&mut scene));
        }
        // SAFETY: the set is new and not in use; the buffers and the tree are alive.
        unsafe { self.gpu.vk.update_descriptor_sets(&writes, &[]) };
        Ok(set)
    }
}

/// Creates a pool with one descriptor set per dispatch.
fn descriptor_pool(gpu: &Gpu, dispatches: u32) -> Result<vk::DescriptorPool> {
    let kernels = KERNELS.iter().map(|k| k.bindings).chain([RAYS.bindings]);
    let most = kernels.map(storage_buffers).max().unwrap_or(0);
    let size = |ty, each| {
        vk::DescriptorPoolSize::default()
            .ty(ty)
            .descriptor_count(dispatches * each)
    };
    let mut sizes = vec![
        size(vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC, 1),
        size(vk::DescriptorType::STORAGE_BUFFER, most),
    ];
    if gpu.features.traces_rays {
        sizes.push(size(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR, 1));
    }
    let info = vk::DescriptorPoolCreateInfo::default()
        .max_sets(dispatches)
        .pool_sizes(&sizes);
    // SAFETY: the device is alive and `info` outlives the call.
    unsafe { gpu.vk.create_descriptor_pool(&info, None) }.map_err(failed("descriptors"))
}

impl Drop for Descriptors {
    fn drop(&mut self) {
        // SAFETY: the owner waits for the submissions that use the sets.
        unsafe { self.gpu.vk.destroy_descriptor_pool(self.sets, None) };
    }
}
