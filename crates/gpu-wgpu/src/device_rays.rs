//! Rays in buffers of the program's own, which kernels bind as they are.

use crate::wgpu_device::WgpuDevice;
use gpu_common::LentRays;
use std::collections::VecDeque;
use wgpu::Buffer;

/// The rays lent last.
#[derive(Default)]
pub(crate) struct DeviceRays {
    lent: Vec<LentRays<Buffer>>,
    /// For queries to come.
    due: VecDeque<LentRays<Buffer>>,
}

impl DeviceRays {
    pub(crate) fn take(&mut self) -> Option<LentRays<Buffer>> {
        self.due.pop_front()
    }
}

impl WgpuDevice {
    /// Has the next queries of [`backend::Rays::OnDevice`] trace these, which kernels can bind: each the next of them.
    pub fn lend_rays(&mut self, rays: Vec<LentRays<Buffer>>) {
        if self.rays.lent != rays {
            // Groups keep the others alive until they are made anew.
            self.gpu.count(|t| t.buffers += 1);
        }
        self.rays.due = rays.iter().cloned().collect();
        self.rays.lent = rays;
    }
}
