//! wgpu's instance, for compute alone: no window system is asked for.
#![cfg_attr(
    target_os = "linux",
    expect(
        unsafe_code,
        reason = "wgpu asks for trust where its extensions are chosen for it"
    )
)]

use wgpu::{Backends, InstanceFlags};

/// An instance without a window, with nothing left to a default that depends on the build.
pub(crate) fn instance(validation: bool) -> wgpu::Instance {
    let mut desc = wgpu::InstanceDescriptor::new_without_display_handle();
    desc.backends = Backends::VULKAN | Backends::METAL | Backends::DX12;
    desc.flags = match validation {
        true => InstanceFlags::VALIDATION | InstanceFlags::DEBUG,
        false => InstanceFlags::empty(),
    };
    #[cfg(target_os = "linux")]
    if let Some(instance) = windowless(&desc) {
        return instance;
    }
    wgpu::Instance::new(desc)
}

/// Vulkan without the window systems that wgpu enables by itself; `None` where Vulkan cannot be had.
///
/// With Wayland's extension, a layer of Mesa's looks for a compositor and complains on standard error where there is none.
#[cfg(target_os = "linux")]
fn windowless(desc: &wgpu::InstanceDescriptor) -> Option<wgpu::Instance> {
    use wgpu::hal::vulkan::{Api, CreateInstanceCallbackArgs, Instance};
    const WINDOWS: [&std::ffi::CStr; 3] = [
        c"VK_KHR_wayland_surface",
        c"VK_KHR_xcb_surface",
        c"VK_KHR_xlib_surface",
    ];
    let hal = wgpu::hal::InstanceDescriptor {
        name: "abvh",
        flags: desc.flags,
        memory_budget_thresholds: desc.memory_budget_thresholds,
        backend_options: desc.backend_options.clone(),
        telemetry: None,
        display: None,
    };
    let forgo = |args: CreateInstanceCallbackArgs<'_, '_, '_>| {
        args.extensions.retain(|name| !WINDOWS.contains(name));
    };
    // SAFETY: wgpu-hal uses these three only to make a surface, and looks first whether they are enabled.
    let made = unsafe { Instance::init_with_callback(&hal, Some(Box::new(forgo))) };
    // SAFETY: the instance was made by this very crate a moment ago, and nothing else holds it.
    made.ok()
        .map(|made| unsafe { wgpu::Instance::from_hal::<Api>(made) })
}
