//! One acceleration structure and the room it lies in.

use crate::support::RayTracing;
use ash::vk;
use backend::Result;
use gpu_vulkan::errors::failed_for;
use gpu_vulkan::memory::{Buffer, BufferUse};
use std::sync::Arc;

/// An acceleration structure. Built and updated in place.
pub(crate) struct Structure {
    pub(crate) vk: vk::AccelerationStructureKHR,
    rays: Arc<RayTracing>,
    /// Room for a build or an update.
    scratch: Buffer,
    /// Dropped after the structure that lies in it.
    storage: Buffer,
}

impl Structure {
    /// Room for what `info` describes, built with any of `flags`, over so many primitives.
    pub(crate) fn new(
        rays: &Arc<RayTracing>,
        what: &str,
        info: vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        flags: &[vk::BuildAccelerationStructureFlagsKHR],
        primitives: u32,
    ) -> Result<Self> {
        let gpu = &rays.gpu;
        let (mut bytes, mut scratch) = (0, 0);
        for &flags in flags {
            let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
            let kind = vk::AccelerationStructureBuildTypeKHR::DEVICE;
            // SAFETY: `info` describes one geometry and outlives the call.
            unsafe {
                rays.structures.get_acceleration_structure_build_sizes(
                    kind,
                    &info.flags(flags),
                    &[primitives],
                    &mut sizes,
                );
            }
            bytes = sizes.acceleration_structure_size.max(bytes);
            let most = sizes.build_scratch_size.max(sizes.update_scratch_size);
            scratch = most.max(scratch);
        }
        let storage = Buffer::new(gpu, what, bytes, BufferUse::Device)?;
        let room = scratch + rays.bounds.scratch_alignment;
        let scratch = Buffer::new(gpu, "room for the driver's builds", room, BufferUse::Device)?;
        let made = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(storage.vk)
            .size(bytes)
            .ty(info.ty);
        // SAFETY: the buffer may hold acceleration structures and is as large as asked for.
        let vk = unsafe { rays.structures.create_acceleration_structure(&made, None) }
            .map_err(failed_for(what, bytes))?;
        Ok(Self {
            vk,
            rays: Arc::clone(rays),
            scratch,
            storage,
        })
    }

    /// Bytes of device memory, and of the room to make it.
    pub(crate) fn held(&self) -> [u64; 2] {
        [self.storage.held(), self.scratch.held()]
    }

    /// Where the device finds it.
    pub(crate) fn address(&self) -> vk::DeviceAddress {
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default()
            .acceleration_structure(self.vk);
        let structures = &self.rays.structures;
        // SAFETY: the structure belongs to the device.
        unsafe { structures.get_acceleration_structure_device_address(&info) }
    }

    /// Records a build of what `info` describes, or an update in place.
    pub(crate) fn record(
        &self,
        commands: vk::CommandBuffer,
        info: vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        primitives: u32,
    ) {
        let rays = &self.rays;
        let at = self.scratch.address();
        let scratch_data = vk::DeviceOrHostAddressKHR {
            device_address: at.next_multiple_of(rays.bounds.scratch_alignment),
        };
        let mut info = info
            .dst_acceleration_structure(self.vk)
            .scratch_data(scratch_data);
        if info.mode == vk::BuildAccelerationStructureModeKHR::UPDATE {
            info = info.src_acceleration_structure(self.vk);
        }
        let range =
            vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(primitives);
        // SAFETY: the command buffer is being recorded; structure and room are as large as the
        // driver asked for, and all buffers of the geometry live.
        unsafe {
            rays.structures
                .cmd_build_acceleration_structures(commands, &[info], &[&[range]]);
        }
    }
}

impl Drop for Structure {
    fn drop(&mut self) {
        let structures = &self.rays.structures;
        // SAFETY: the backend waits for the device before it drops its trees.
        unsafe { structures.destroy_acceleration_structure(self.vk, None) };
    }
}
