//! Parameters and descriptors of a submission's rays: a set for each submission that may be under way or recorded.

use crate::pipeline::{RayPipeline, storage_buffers};
use ash::vk;
use backend::Result;
use gpu_common::SLOTS;
use gpu_vulkan::descriptor_type;
use gpu_vulkan::errors::failed;
use gpu_vulkan::gpu::Gpu;
use gpu_vulkan::memory::{Buffer, BufferUse};
use shaders::{BufferName, Kind, Params, RAYS};
use std::sync::Arc;

/// A set for each place of a submission, which has one trace at most.
pub(crate) struct RaySets {
    pool: vk::DescriptorPool,
    sets: Vec<vk::DescriptorSet>,
    params: Buffer,
    stride: u64,
    gpu: Arc<Gpu>,
}

impl RaySets {
    pub(crate) fn new(gpu: &Arc<Gpu>, pipeline: &RayPipeline) -> Result<Self> {
        let stride = size_of::<Params>() as u64;
        let stride = stride.next_multiple_of(gpu.uniform_alignment());
        let params = Buffer::new(
            gpu,
            "parameters of rays",
            stride * SLOTS as u64,
            BufferUse::Upload,
        )?;
        let size = |ty, each: u32| {
            let count = SLOTS as u32 * each;
            vk::DescriptorPoolSize::default()
                .ty(ty)
                .descriptor_count(count)
        };
        let sizes = [
            size(vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC, 1),
            size(vk::DescriptorType::STORAGE_BUFFER, storage_buffers()),
            size(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR, 1),
        ];
        let info = vk::DescriptorPoolCreateInfo::default()
            .max_sets(SLOTS as u32)
            .pool_sizes(&sizes);
        // SAFETY: the device is alive and `info` outlives the call.
        let pool = unsafe { gpu.vk.create_descriptor_pool(&info, None) };
        let mut made = Self {
            pool: pool.map_err(failed("descriptors of rays"))?,
            sets: Vec::new(),
            params,
            stride,
            gpu: Arc::clone(gpu),
        };
        let layouts = [pipeline.set_layout; SLOTS];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(made.pool)
            .set_layouts(&layouts);
        // SAFETY: the pool has room for as many sets of this layout.
        made.sets = unsafe { gpu.vk.allocate_descriptor_sets(&info) }
            .map_err(failed("descriptors of rays"))?;
        Ok(made)
    }

    /// Fills the set of a place (see [`gpu_common::Frames::place`]): with a tree, parameters,
    /// and the buffers that `find` gives by their names in the shaders. Returns it with the
    /// offset of its parameters. The submission that used it last must be finished.
    pub(crate) fn fill<'a>(
        &mut self,
        place: usize,
        tree: vk::AccelerationStructureKHR,
        params: &Params,
        find: impl Fn(BufferName) -> &'a Buffer,
    ) -> (vk::DescriptorSet, u32) {
        let offset = self.stride * place as u64;
        self.params.write(offset, std::slice::from_ref(params));
        let set = self.sets[place];
        let buffers = RAYS.bindings.iter().map(|b| {
            let (buffer, bytes) = match b.kind {
                Kind::Uniform => (self.params.vk, size_of::<Params>() as u64),
                Kind::Read | Kind::ReadWrite => {
                    let buffer = find(b.name);
                    (buffer.vk, buffer.bytes)
                }
            };
            [vk::DescriptorBufferInfo::default()
                .buffer(buffer)
                .range(bytes)]
        });
        let buffers: Vec<_> = buffers.collect();
        let trees = [tree];
        let mut scene = vk::WriteDescriptorSetAccelerationStructureKHR::default()
            .acceleration_structures(&trees);
        let write = |number, kind| {
            vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(number)
                .descriptor_type(kind)
        };
        let bound = RAYS.bindings.iter().zip(&buffers);
        let mut writes: Vec<_> = bound
            .map(|(b, info)| write(b.number, descriptor_type(b.kind)).buffer_info(info))
            .collect();
        let tree = write(RAYS.scene, vk::DescriptorType::ACCELERATION_STRUCTURE_KHR);
        writes.push(tree.descriptor_count(1).push_next(&mut scene));
        // SAFETY: the set is not in use; buffers and tree are alive.
        unsafe { self.gpu.vk.update_descriptor_sets(&writes, &[]) };
        (set, offset as u32)
    }
}

impl Drop for RaySets {
    fn drop(&mut self) {
        // SAFETY: the backend waits for the device before it drops its sets.
        unsafe { self.gpu.vk.destroy_descriptor_pool(self.pool, None) };
    }
}
