//! Parameters and descriptor sets of a submission's dispatches, in pages that are allocated on demand.

use crate::errors::failed;
use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::pipelines::{Pipeline, descriptor_type};
use ash::vk;
use backend::Result;
use shaders::{Binding, BufferName, KERNELS, Kind, Params, RAYS, storage_buffers};
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

/// A descriptor set. It can be reused for the same kernel with the same buffers and rows of the same page.
#[derive(Clone, Copy)]
pub(crate) struct Bound {
    pub(crate) set: vk::DescriptorSet,
    kernel: &'static str,
    page: usize,
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

    /// Returns a set for a kernel with this row: `last` if it matches, otherwise a new one over the buffers that `find`
    /// returns for the names in the kernel.
    pub(crate) fn bind<'a>(
        &self,
        pipeline: &Pipeline,
        row: ParamsRow,
        last: Option<Bound>,
        find: impl Fn(BufferName) -> &'a Buffer,
    ) -> Result<Bound> {
        let (kernel, page) = (pipeline.kernel.name, row.page);
        if let Some(last) = last.filter(|l| (l.kernel, l.page) == (kernel, page)) {
            return Ok(last);
        }
        let what = (pipeline.layouts.set, pipeline.kernel.bindings);
        let set = self.set(what, page, find, None)?;
        Ok(Bound { set, kernel, page })
    }

    /// Creates a set with these bindings, over a page's parameters and the buffers that `find` returns by name.
    /// Bindings of rays also include the driver's `tree`.
    pub(crate) fn set<'a>(
        &self,
        (layout, bindings): (vk::DescriptorSetLayout, &[Binding]),
        page: usize,
        find: impl Fn(BufferName) -> &'a Buffer,
        tree: Option<vk::AccelerationStructureKHR>,
    ) -> Result<vk::DescriptorSet> {
        let layouts = [layout];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(self.all[page].sets)
            .set_layouts(&layouts);
        // SAFETY: the pool has capacity for one set per row of the page.
        let sets = unsafe { self.gpu.vk.allocate_descriptor_sets(&info) };
        let set = sets.map_err(failed("descriptors"))?[0];
        let info = |b: &Binding| {
            let (buffer, bytes) = match b.kind {
                Kind::Uniform => (self.all[page].params.vk, size_of::<Params>() as u64),
                Kind::Read | Kind::ReadWrite => {
                    let buffer = find(b.name);
                    (buffer.vk, buffer.bytes)
                }
            };
            let info = vk::DescriptorBufferInfo::default().buffer(buffer);
            [info.range(bytes)]
        };
        let infos: Vec<_> = bindings.iter().map(info).collect();
        let write = |number, kind| {
            vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(number)
                .descriptor_type(kind)
        };
        let each = bindings.iter().zip(&infos);
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
