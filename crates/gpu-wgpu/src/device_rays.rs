//! Rays in buffers of the program's own, which kernels bind as they are.

use crate::wgpu_device::WgpuDevice;
use gpu_common::LentRays;
use wgpu::Buffer;

/// The rays lent last.
#[derive(Default)]
pub(crate) struct DeviceRays {
    lent: Option<LentRays<Buffer>>,
    /// Whether a query is to come that traces them.
    is_due: bool,
}

impl DeviceRays {
    pub(crate) fn take(&mut self) -> Option<LentRays<Buffer>> {
        let is_due = std::mem::take(&mut self.is_due);
        self.lent.clone().filter(|_| is_due)
    }
}

impl WgpuDevice {
    /// Has the next query of [`backend::Rays::OnDevice`] trace these, which kernels can bind.
    pub fn lend_rays(&mut self, rays: LentRays<Buffer>) {
        let is_other = self.rays.lent.as_ref() != Some(&rays);
        if is_other {
            // Groups keep the others alive until they are made anew.
            self.gpu.count(|t| t.buffers += 1);
        }
        self.rays = DeviceRays {
            lent: Some(rays),
            is_due: true,
        };
    }
}
