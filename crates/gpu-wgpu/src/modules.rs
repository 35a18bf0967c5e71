//! Kernels as wgpu takes them. Unsafe code is here and in `instance`.
#![expect(
    unsafe_code,
    reason = "wgpu asks for trust in kernels that it does not check itself"
)]

use crate::gpu::Gpu;
use backend::Result;
use gpu_common::KernelForm;
use shaders::{Code, Kernel};
use wgpu::{ShaderModule, ShaderModuleDescriptor, ShaderRuntimeChecks, ShaderSource};

/// A kernel in one of its forms.
pub(crate) fn load(
    gpu: &Gpu,
    form: KernelForm,
    kernel: &Kernel,
    code: Code,
) -> Result<ShaderModule> {
    let load = || match form {
        KernelForm::Best if gpu.takes_spirv() => pass_through(&gpu.device, kernel, code),
        KernelForm::Best | KernelForm::TrustedWgsl => trusted(&gpu.device, kernel, code),
        KernelForm::CheckedWgsl => gpu.device.create_shader_module(wgsl(kernel, code)),
    };
    gpu.guard(kernel.name, 0, load)
}

fn wgsl(kernel: &Kernel, code: Code) -> ShaderModuleDescriptor<'_> {
    ShaderModuleDescriptor {
        label: Some(kernel.name),
        source: ShaderSource::Wgsl(code.wgsl.into()),
    }
}

/// The very words that `gpu-vulkan` loads.
fn pass_through(device: &wgpu::Device, kernel: &Kernel, code: Code) -> ShaderModule {
    let [x, y, z] = kernel.workgroup;
    let entry = wgpu::PassthroughShaderEntryPoint {
        name: kernel.entry.into(),
        workgroup_size: (x, y, z),
    };
    let desc = wgpu::ShaderModuleDescriptorPassthrough {
        label: Some(kernel.name),
        entry_points: vec![entry].into(),
        spirv: Some(code.spirv.into()),
        ..Default::default()
    };
    // SAFETY: the words were validated by the build that made them; their bindings are those of the layout.
    unsafe { device.create_shader_module_passthrough(desc) }
}

fn trusted(device: &wgpu::Device, kernel: &Kernel, code: Code) -> ShaderModule {
    // Every check by name: nothing is left to a default that may change.
    let checks = ShaderRuntimeChecks {
        bounds_checks: false,
        force_loop_bounding: false,
        ray_query_initialization_tracking: false,
        task_shader_dispatch_tracking: false,
        mesh_shader_primitive_indices_clamp: false,
        int_div_checks: false,
    };
    // SAFETY: kernels stay within buffers whose sizes follow from a checked record of the tree and a
    // checked animation, their loops pop a finite stack, and they divide no integers by what may be zero.
    unsafe { device.create_shader_module_trusted(wgsl(kernel, code), checks) }
}
