//! The device that traces.

use crate::backends::{find_backend, open_best};
use crate::{Error, Result};
use backend::{Backend, BackendError, BackendName};

/// A device that traces.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Device {
    /// A GPU through Vulkan, else a GPU through wgpu, else the host. A driver that runs shaders on the host's cores is
    /// tried only if the host fails.
    #[default]
    Auto,
    /// The host's cores.
    Cpu,
    /// The scalar reference on the host's cores. Its hits are those of `Cpu`. Its code is short, but slow.
    CpuRef,
    /// Compute shaders through Vulkan. `None` selects the first GPU or, without a GPU, the first adapter. A string of
    /// digits selects an adapter by index, any other string the adapter with that name, or else the only adapter whose
    /// name contains it.
    #[cfg(feature = "vulkan")]
    Vulkan(Option<String>),
    /// Compute shaders through wgpu. The adapter is selected as for `Vulkan`.
    #[cfg(feature = "wgpu")]
    Wgpu(Option<String>),
    /// Compute shaders on a wgpu device that the program opened: see [`crate::own_device`].
    #[cfg(feature = "wgpu")]
    Own(Box<crate::own_device::OwnDevice>),
}

impl Device {
    /// Opens the device. The host uses `threads` threads.
    pub(crate) fn open(&self, threads: usize) -> Result<Box<dyn Backend>> {
        let (name, adapter) = match self {
            Self::Auto => {
                let best = open_best(None, threads, Ok::<_, BackendError>);
                let (opened, _) = best.map_err(|none| Error::NoDevice(none.reason))?;
                return Ok(opened);
            }
            Self::Cpu => (BackendName::Cpu, None),
            Self::CpuRef => (BackendName::CpuRef, None),
            #[cfg(feature = "vulkan")]
            Self::Vulkan(adapter) => (BackendName::Vulkan, adapter.as_deref()),
            #[cfg(feature = "wgpu")]
            Self::Wgpu(adapter) => (BackendName::Wgpu, adapter.as_deref()),
            #[cfg(feature = "wgpu")]
            Self::Own(device) => return device.open(),
        };
        let entry = find_backend(name).expect("a device has a backend");
        entry.open(adapter, threads).map_err(Error::NoDevice)
    }
}
