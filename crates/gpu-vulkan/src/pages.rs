//! Parameters and descriptor sets of a submission's dispatches, in pages that are allocated on demand.

use crate::errors::failed;
use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferRange, BufferUse};
use crate::pipelines::descriptor_type;
use ash::vk;
use backend::Result;
use shaders::{Binding, KERNELS, Params, RAYS, storage_buffers};
use std::sync::Arc;

/// Dispatches per page.
const ROWS: usize = 64;

/// The pages of a submission.
pub(crate) struct Pages {
    all: Vec<Page>,
    /// Number of dispatches since the last reset.
    rows: usize,
    stride: u64,
    gpu: Arc<Gpu>,
}

struct Page {
    params: Buffer,
    sets: vk::DescriptorPool,
    gpu: Arc<Gpu>,
}

/// Location of a dispatch's parameters.
#[derive(Clone, Copy)]
pub(crate) struct ParamsRow {
    pub(crate) page: usize,
    pub(crate) offset: u32,
}

impl Pages {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Self {
        let stride = size_of::<Params>() as u64;
        Self {
            all: Vec::new(),
            rows: 0,
            stride: stride.next_multiple_of(gpu.limits.uniform_alignment),
            gpu: Arc::clone(gpu),
        }
    }

    /// Discards all rows. The submission that used them must have finished.
    pub(crate) fn reset(&mut self) -> Result<()> {
        self.rows = 0;
        for page in &self.all {
            let none = vk::DescriptorPoolResetFlags::empty();
            // SAFETY: no set of the pool is in use any more.
            unsafe { self.gpu.vk.reset_descriptor_pool(page.sets, none) }
                .map_err(failed("descriptors"))?;
        }
        Ok(())
    }

    /// Writes the parameters of another dispatch.
    pub(crate) fn row(&mut self, params: &Params) -> Result<ParamsRow> {
        let (page, row) = (self.rows / ROWS, self.rows % ROWS);
        if page == self.all.len() {
            self.all.push(Page::new(&self.gpu, self.stride)?);
        }
        let at = self.stride * row as u64;
        self.all[page]
            .params
            .write(at, std::slice::from_ref(params));
        self.rows += 1;
        let offset = u32::try_from(at).expect("a page is small");
        Ok(ParamsRow { page, offset })
    }

    /// Returns the parameters of a page, for a dynamic offset.
    pub(crate) fn params(&self, page: usize) -> BufferRange {
        BufferRange {
            vk: self.all[page].params.vk,
            bytes: size_of::<Params>() as u64,
        }
    }

    /// Creates a set of a page with these bindings. Bindings of rays also include the driver's `tree`.
    pub(crate) fn set<'b>(
        &self,
        layout: vk::DescriptorSetLayout,
        page: usize,
        bindings: impl Iterator<Item = (&'b Binding, BufferRange)> + Clone,
        tree: Option<vk::AccelerationStructureKHR>,
    ) -> Result<vk::DescriptorSet> {
        let layouts = [layout];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(self.all[page].sets)
            .set_layouts(&layouts);
        // SAFETY: the pool has capacity for one set per row of the page.
        let sets = unsafe { self.gpu.vk.allocate_descriptor_sets(&info) };
        let set = sets.map_err(failed("descriptors"))?[0];
        let info = |(_, buffer): (_, BufferRange)| {
            let info = vk::DescriptorBufferInfo::default().buffer(buffer.vk);
            [info.range(buffer.bytes)]
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

impl Page {
    fn new(gpu: &Arc<Gpu>, stride: u64) -> Result<Self> {
        let params = Buffer::new(gpu, "parameters", stride * ROWS as u64, BufferUse::Upload)?;
        let all = KERNELS.iter().map(|k| k.bindings).chain([RAYS.bindings]);
        let most = all.map(storage_buffers).max().unwrap_or(0);
        let size = |ty, each| {
            vk::DescriptorPoolSize::default()
                .ty(ty)
                .descriptor_count(ROWS as u32 * each)
        };
        let mut sizes = vec![
            size(vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC, 1),
            size(vk::DescriptorType::STORAGE_BUFFER, most),
        ];
        if gpu.traces_rays {
            sizes.push(size(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR, 1));
        }
        let info = vk::DescriptorPoolCreateInfo::default()
            .max_sets(ROWS as u32)
            .pool_sizes(&sizes);
        // SAFETY: the device is alive and `info` outlives the call.
        let sets = unsafe { gpu.vk.create_descriptor_pool(&info, None) };
        Ok(Self {
            params,
            sets: sets.map_err(failed("descriptors"))?,
            gpu: Arc::clone(gpu),
        })
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        // SAFETY: the backend waits for the device before it drops its slots.
        unsafe { self.gpu.vk.destroy_descriptor_pool(self.sets, None) };
    }
}
