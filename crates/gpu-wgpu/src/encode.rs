//! A dispatch: its kernel, parameters, groups and the buffers it is bound to.

use crate::device::Gpu;
use crate::pipelines::Pipeline;
use backend::{BackendError, Result};
use shaders::{Kind, Params};
use std::num::NonZeroU64;
use wgpu::{BindGroup, Buffer, BufferBinding};

/// A kernel to run.
pub(crate) struct Work {
    pub(crate) kernel: &'static str,
    pub(crate) params: Params,
    pub(crate) groups: Groups,
}

/// How many workgroups a dispatch has.
#[derive(Clone, Copy)]
pub(crate) enum Groups {
    /// Enough for so many invocations, in as many rows as it takes.
    Linear(u32),
    /// One for each block of 16 x 8 pixels.
    Pixels(u32, u32),
}

impl Groups {
    /// Workgroups along both axes, where one axis may have no more than `limit`.
    pub(crate) fn count(self, workgroup: u32, limit: u32) -> Result<[u32; 2]> {
        let [x, y] = match self {
            Self::Linear(count) => {
                let all = count.div_ceil(workgroup);
                let rows = all.div_ceil(limit).max(1);
                [all.div_ceil(rows), rows]
            }
            Self::Pixels(width, height) => [width.div_ceil(16), height.div_ceil(8)],
        };
        let need = x.max(y);
        if need > limit {
            return Err(BackendError::Limit {
                what: "a dispatch (workgroups along one axis)".to_owned(),
                need: u64::from(need),
                limit: u64::from(limit),
            });
        }
        Ok([x, y])
    }
}

/// Binds a kernel to its parameters and to the buffers that `find` gives by their names in the kernel.
pub(crate) fn bind<'a>(
    gpu: &Gpu,
    pipeline: &Pipeline,
    params: &'a Buffer,
    find: impl Fn(&'static str) -> &'a Buffer,
) -> Result<BindGroup> {
    let bindings = pipeline.kernel.bindings;
    let entries: Vec<_> = bindings
        .iter()
        .map(|b| wgpu::BindGroupEntry {
            binding: b.number,
            resource: match b.kind {
                Kind::Uniform => wgpu::BindingResource::Buffer(one_row(params)),
                Kind::Read | Kind::ReadWrite => find(b.name).as_entire_binding(),
            },
        })
        .collect();
    let desc = wgpu::BindGroupDescriptor {
        label: Some(pipeline.kernel.name),
        layout: &pipeline.layout,
        entries: &entries,
    };
    gpu.guard(pipeline.kernel.name, 0, || {
        gpu.device.create_bind_group(&desc)
    })
}

fn one_row(params: &Buffer) -> BufferBinding<'_> {
    BufferBinding {
        buffer: params,
        offset: 0,
        size: NonZeroU64::new(size_of::<Params>() as u64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_groups_than_one_axis_holds_go_into_rows() {
        assert_eq!(Groups::Linear(0).count(128, 65535), Ok([0, 1]));
        assert_eq!(Groups::Linear(129).count(128, 65535), Ok([2, 1]));
        let [x, y] = Groups::Linear(128 * 100_000).count(128, 65535).unwrap();
        assert!(y == 2 && x * y >= 100_000 && x <= 65535);
        let tall = Groups::Pixels(16, 8 * 70_000).count(128, 65535);
        assert!(matches!(
            tall,
            Err(BackendError::Limit { need: 70_000, .. })
        ));
    }
}
