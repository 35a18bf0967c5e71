//! The way into Vulkan: the system's loader, or a driver itself where none is installed.
//!
//! Containers of data centres often hold NVIDIA's driver without a loader. Its library answers
//! `vk_icdGetInstanceProcAddr`, as the [interface between loader and drivers] has it.
//!
//! [interface between loader and drivers]: https://github.com/KhronosGroup/Vulkan-Loader/blob/main/docs/LoaderDriverInterface.md

use ash::{Entry, StaticFn, vk};
use host::NVIDIA_LIBRARIES;
use libloading::{Library, Symbol};

/// The version of that interface which is asked for: the first with a way to name it.
const INTERFACE: u32 = 2;

type Negotiate = unsafe extern "system" fn(*mut u32) -> vk::Result;

/// Opens the loader, else a driver.
///
/// # Errors
/// Why there is no loader, if no driver answers either.
pub(crate) fn open() -> Result<Entry, String> {
    // SAFETY: the loader is the system's own; the entry keeps its library open.
    let loader = unsafe { Entry::load() };
    loader.or_else(|why| {
        let mut drivers = NVIDIA_LIBRARIES.iter().filter_map(|name| driver(name));
        drivers.next().ok_or_else(|| why.to_string())
    })
}

fn driver(name: &str) -> Option<Entry> {
    // SAFETY: a driver's initialisers are made to be run by any program.
    let library = unsafe { Library::new(name) }.ok()?;
    // SAFETY: the names and types are those of the interface.
    let entry = unsafe {
        if let Ok(negotiate) = library.get(b"vk_icdNegotiateLoaderICDInterfaceVersion\0") {
            let (negotiate, mut version): (Symbol<'_, Negotiate>, _) = (negotiate, INTERFACE);
            negotiate(&raw mut version).result().ok()?;
        }
        let get: Symbol<'_, vk::PFN_vkGetInstanceProcAddr> =
            library.get(b"vk_icdGetInstanceProcAddr\0").ok()?;
        Entry::from_static_fn(StaticFn {
            get_instance_proc_addr: *get,
        })
    };
    // Drivers leave threads and handlers behind that must find it until the process ends.
    std::mem::forget(library);
    Some(entry)
}
