//! How a device is opened.

use std::path::PathBuf;

/// How to open a device.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// An adapter's index; the first GPU, else the first adapter, if not given.
    pub adapter: Option<usize>,
    /// Folder in which compiled kernels are kept for runs to come, where the device can; nothing is kept without one.
    pub cache: Option<PathBuf>,
    /// Whether to run under the interface's validation layer.
    pub validation: Validation,
    /// In which form kernels go in, where the interface takes more than one.
    pub kernels: KernelForm,
}

/// Whether to run under a validation layer, with synchronisation validation where the interface has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validation {
    /// Without it.
    #[default]
    Off,
    /// With it where it is installed.
    IfInstalled,
    /// With it, or not at all. wgpu cannot tell whether it is installed.
    Required,
}

/// In which form kernels go in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KernelForm {
    /// SPIR-V where the device takes it, else WGSL.
    #[default]
    Best,
    /// WGSL, without checks added.
    TrustedWgsl,
    /// WGSL, with checks of bounds and loops added.
    CheckedWgsl,
}
