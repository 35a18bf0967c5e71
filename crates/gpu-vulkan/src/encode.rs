//! A dispatch: parameters, descriptors, groups.

use crate::device::Gpu;
use crate::errors::failed;
use crate::memory::Buffer;
use crate::pipelines::{Pipeline, descriptor_type};
use crate::slot::Slot;
use ash::vk;
use backend::Result;
use shaders::{Kind, Params};

/// A part of a buffer.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    pub(crate) buffer: vk::Buffer,
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
}

impl From<&Buffer> for Part {
    fn from(b: &Buffer) -> Self {
        Self {
            buffer: b.vk,
            offset: 0,
            bytes: b.bytes,
        }
    }
}

/// How many workgroups a dispatch has.
#[derive(Clone, Copy)]
pub(crate) enum Groups {
    /// Enough for so many invocations, in as many rows as it takes.
    Linear(u32),
    /// One for each block of 16 x 8 pixels.
    Pixels(u32, u32),
}

/// Records `pipeline` over `groups`; `find` gives the buffer of each binding by its name in the kernel.
pub(crate) fn dispatch<'a>(
    gpu: &Gpu,
    slot: &mut Slot,
    pipeline: &Pipeline,
    params: &Params,
    groups: Groups,
    find: impl Fn(&'static str) -> Part + 'a,
) -> Result<()> {
    let offset = slot.params_stride * u64::from(slot.params_used);
    slot.params.write(offset, std::slice::from_ref(params));
    slot.params_used += 1;
    let set = slot.descriptor_set(pipeline.set_layout)?;
    write_set(gpu, slot, set, pipeline, find);
    let [x, y] = match groups {
        Groups::Linear(count) => {
            let all = count.div_ceil(pipeline.kernel.workgroup[0]);
            let rows = all.div_ceil(gpu.max_groups).max(1);
            [all.div_ceil(rows), rows]
        }
        Groups::Pixels(width, height) => [width.div_ceil(16), height.div_ceil(8)],
    };
    let point = vk::PipelineBindPoint::COMPUTE;
    let offset = u32::try_from(offset).expect("parameters fit a page or two");
    // SAFETY: the command buffer is being recorded; pipeline and set belong to the device and match.
    unsafe {
        gpu.vk.cmd_bind_pipeline(slot.commands, point, pipeline.vk);
        gpu.vk.cmd_bind_descriptor_sets(
            slot.commands,
            point,
            pipeline.layout,
            0,
            &[set],
            &[offset],
        );
        gpu.vk.cmd_dispatch(slot.commands, x, y, 1);
    }
    Ok(())
}

fn write_set(
    gpu: &Gpu,
    slot: &Slot,
    set: vk::DescriptorSet,
    pipeline: &Pipeline,
    find: impl Fn(&'static str) -> Part,
) {
    let bindings = pipeline.kernel.bindings;
    let infos: Vec<_> = bindings
        .iter()
        .map(|b| {
            let part = match b.kind {
                Kind::Uniform => Part {
                    buffer: slot.params.vk,
                    offset: 0,
                    bytes: size_of::<Params>() as u64,
                },
                Kind::Read | Kind::ReadWrite => find(b.name),
            };
            [vk::DescriptorBufferInfo::default()
                .buffer(part.buffer)
                .offset(part.offset)
                .range(part.bytes)]
        })
        .collect();
    let writes: Vec<_> = bindings
        .iter()
        .zip(&infos)
        .map(|(b, info)| {
            vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(b.number)
                .descriptor_type(descriptor_type(b.kind))
                .buffer_info(info)
        })
        .collect();
    // SAFETY: the set is new and not in use; the buffers are alive.
    unsafe { gpu.vk.update_descriptor_sets(&writes, &[]) };
}

/// A copy in pieces, so that a large one does not starve what computes beside it.
pub(crate) fn copy_in_pieces(
    gpu: &Gpu,
    commands: vk::CommandBuffer,
    from: &Buffer,
    to: &Buffer,
    [bytes, to_at]: [u64; 2],
) {
    const PIECE: u64 = 512 << 10;
    let regions: Vec<_> = (0..bytes)
        .step_by(PIECE as usize)
        .map(|at| {
            let size = PIECE.min(bytes - at);
            vk::BufferCopy::default()
                .src_offset(at)
                .dst_offset(to_at + at)
                .size(size)
        })
        .collect();
    if !regions.is_empty() {
        // SAFETY: the command buffer is being recorded; both buffers hold `bytes`.
        unsafe { gpu.vk.cmd_copy_buffer(commands, from.vk, to.vk, &regions) };
    }
}

/// Makes a semaphore whose value only rises.
pub(crate) fn timeline(gpu: &Gpu) -> Result<vk::Semaphore> {
    let mut kind =
        vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
    let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
    // SAFETY: the device is alive; timeline semaphores were asked for.
    unsafe { gpu.vk.create_semaphore(&info, None) }.map_err(failed("a semaphore"))
}
