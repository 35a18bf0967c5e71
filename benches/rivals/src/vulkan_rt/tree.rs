//! The driver's tree of a scene: a bottom-level structure of all triangles, and a top-level structure that contains it
//! as its one instance. Rays are traced through top-level structures only.

use super::support::RayTracing;
use crate::{RivalName, TreeUpdate};
use ash::vk;
use backend::Result;
use gpu_common::{AnimationBuffers, Engine, GpuDevice, check_limit};
use gpu_vulkan::commands::{BUILDS, KERNELS, RAYS};
use gpu_vulkan::errors::failed_for;
use gpu_vulkan::memory::{Buffer, BufferUse};
use gpu_vulkan::{NativeCommand, VulkanDevice};
use shaders::BufferName;
use std::sync::Arc;

/// Input of a build.
pub(crate) type Geometry<'a> = vk::AccelerationStructureGeometryKHR<'a>;
/// Parameters of a build.
type Info<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
type Level = vk::AccelerationStructureTypeKHR;
/// How the driver builds a tree.
pub(crate) type Flags = vk::BuildAccelerationStructureFlagsKHR;
type Mode = vk::BuildAccelerationStructureModeKHR;

/// Both structures, which are rebuilt or updated in place.
pub(crate) struct VulkanTree {
    bottom: Arc<Structure>,
    top: Arc<Structure>,
    /// Buffer with the only instance of `bottom`.
    instance: Buffer,
    flags: Flags,
    triangles: u32,
    /// Whether the next build can update the tree.
    is_updatable: bool,
}

/// Words of an instance in Vulkan's layout: three matrix rows, mask and index, flags and offset, address.
const INSTANCE_WORDS: usize = 16;

impl VulkanTree {
    /// Creates structures for the scene that the engine has loaded.
    pub(crate) fn new(
        engine: &mut Engine<VulkanDevice>,
        ray_tracing: &Arc<RayTracing>,
        finite_triangles: Option<&Buffer>,
        flags: Flags,
    ) -> Result<Self> {
        let scene = engine.scene();
        let triangles = scene.animation.triangle_count() as u64;
        let what = || "the driver's tree (triangles, maxPrimitiveCount)".to_owned();
        check_limit(what, triangles, ray_tracing.bounds.triangles)?;
        let triangles = triangles as u32;
        let geometry = [triangles_of(scene, &scene.positions[0], finite_triangles)];
        let about = info(Level::BOTTOM_LEVEL).flags(flags).geometries(&geometry);
        let bottom = Structure::new(ray_tracing, "the driver's tree", about, triangles)?;
        let instance = Buffer::new(
            &ray_tracing.gpu,
            "the tree's instance",
            64,
            BufferUse::Device,
        )?;
        let words = instance_of(&bottom);
        engine
            .gpu
            .upload(&[(bytemuck::cast_slice(&words), &instance)])?;
        let geometry = [instances_of(&instance)];
        let about = info(Level::TOP_LEVEL).flags(flags).geometries(&geometry);
        Ok(Self {
            bottom: Arc::new(bottom),
            top: Arc::new(Structure::new(ray_tracing, "the top-level tree", about, 1)?),
            instance,
            flags,
            triangles,
            is_updatable: false,
        })
    }

    /// Returns the bytes of device memory of both structures and their scratch buffers.
    pub(crate) fn held(&self) -> [u64; 2] {
        let [bottom, scratch] = self.bottom.held();
        let [top, top_scratch] = self.top.held();
        [bottom + top + self.instance.held(), scratch + top_scratch]
    }

    /// Returns the top-level structure.
    pub(crate) fn top(&self) -> vk::AccelerationStructureKHR {
        self.top.vk
    }

    /// Marks the tree as not built, because its recorded commands never ran.
    pub(crate) fn forget(&mut self) {
        self.is_updatable = false;
    }

    /// Returns the commands that build the tree, or update it if the flags allow updates and the tree was built.
    pub(crate) fn make(&mut self, from: Geometry<'static>) -> NativeCommand {
        let mode = if self.is_updatable {
            Mode::UPDATE
        } else {
            Mode::BUILD
        };
        self.is_updatable = self.flags.contains(Flags::ALLOW_UPDATE);
        let (flags, triangles) = (self.flags, self.triangles);
        let [bottom, top] = [&self.bottom, &self.top].map(Arc::clone);
        let instance = instances_of(&self.instance);
        Box::new(move |encoder| {
            let commands = &encoder.commands;
            let about = |level| info(level).flags(flags).mode(mode);
            commands.barrier(KERNELS, BUILDS);
            let geometry = [from];
            let info = about(Level::BOTTOM_LEVEL).geometries(&geometry);
            bottom.record(commands.vk(), info, triangles);
            commands.barrier(BUILDS, BUILDS);
            let geometry = [instance];
            let info = about(Level::TOP_LEVEL).geometries(&geometry);
            top.record(commands.vk(), info, 1);
            commands.barrier(BUILDS, RAYS);
            Ok(())
        })
    }
}

/// Returns the flags of the builds of a rival.
pub(crate) fn build_flags(name: RivalName, tree_update: TreeUpdate) -> Flags {
    let preference = match name {
        RivalName::VulkanRtFastTrace => Flags::PREFER_FAST_TRACE,
        _ => Flags::PREFER_FAST_BUILD,
    };
    match tree_update {
        TreeUpdate::Rebuild => preference,
        TreeUpdate::Refit => preference | Flags::ALLOW_UPDATE,
    }
}

fn info<'a>(level: Level) -> Info<'a> {
    Info::default().ty(level)
}

/// Returns opaque geometry, so that the driver calls no any-hit shader.
fn geometry<'a>(
    kind: vk::GeometryTypeKHR,
    data: vk::AccelerationStructureGeometryDataKHR<'a>,
) -> Geometry<'a> {
    Geometry::default()
        .geometry_type(kind)
        .geometry(data)
        .flags(vk::GeometryFlagsKHR::OPAQUE)
}

fn at(buffer: &Buffer) -> vk::DeviceOrHostAddressConstKHR {
    vk::DeviceOrHostAddressConstKHR {
        device_address: buffer.address(),
    }
}

/// Returns the scene's indexed triangles with vertices from `positions`. If `finite_triangles` is `Some`, returns its
/// triangles instead, which have no indices.
pub(crate) fn triangles_of<'a>(
    scene: &AnimationBuffers<VulkanDevice>,
    positions: &Buffer,
    finite_triangles: Option<&Buffer>,
) -> Geometry<'a> {
    let corners = scene.get(BufferName::Triangles, 0, 0);
    let corners = corners.expect("every scene has triangles");
    let vertices = match finite_triangles {
        None => scene.animation.vertex_count(),
        Some(_) => 3 * scene.animation.triangle_count(),
    };
    let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
        .vertex_format(vk::Format::R32G32B32_SFLOAT)
        .vertex_data(at(finite_triangles.unwrap_or(positions)))
        .vertex_stride(12)
        .max_vertex((vertices as u32).saturating_sub(1));
    let triangles = match finite_triangles {
        None => triangles
            .index_type(vk::IndexType::UINT32)
            .index_data(at(corners)),
        Some(_) => triangles.index_type(vk::IndexType::NONE_KHR),
    };
    let data = vk::AccelerationStructureGeometryDataKHR { triangles };
    geometry(vk::GeometryTypeKHR::TRIANGLES, data)
}

fn instances_of<'a>(instance: &Buffer) -> Geometry<'a> {
    let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(at(instance));
    let data = vk::AccelerationStructureGeometryDataKHR { instances };
    geometry(vk::GeometryTypeKHR::INSTANCES, data)
}

/// Returns an instance with the identity transform. All rays can hit it, from both sides.
fn instance_of(bottom: &Structure) -> [u32; INSTANCE_WORDS] {
    let mut words = [0; INSTANCE_WORDS];
    for diagonal in [0, 5, 10] {
        words[diagonal] = 1_f32.to_bits();
    }
    let flags = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE
        | vk::GeometryInstanceFlagsKHR::FORCE_OPAQUE;
    words[12] = 0xff << 24;
    words[13] = flags.as_raw() << 24;
    let address = bottom.address();
    (words[14], words[15]) = (address as u32, (address >> 32) as u32);
    words
}

/// An acceleration structure that is built and updated in place.
struct Structure {
    vk: vk::AccelerationStructureKHR,
    ray_tracing: Arc<RayTracing>,
    /// Scratch buffer for builds and updates.
    scratch: Buffer,
    /// Memory of the structure. Dropped after the structure.
    storage: Buffer,
}

impl Structure {
    /// Creates a structure that `info` describes, over `primitives` primitives.
    fn new(
        ray_tracing: &Arc<RayTracing>,
        what: &str,
        info: Info<'_>,
        primitives: u32,
    ) -> Result<Self> {
        let gpu = &ray_tracing.gpu;
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let kind = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        // SAFETY: `info` describes one geometry and outlives the call.
        unsafe {
            ray_tracing
                .structures
                .get_acceleration_structure_build_sizes(kind, &info, &[primitives], &mut sizes);
        }
        let bytes = sizes.acceleration_structure_size;
        let scratch = sizes.build_scratch_size.max(sizes.update_scratch_size);
        let storage = Buffer::new(gpu, what, bytes, BufferUse::Device)?;
        let scratch_bytes = scratch + ray_tracing.bounds.scratch_alignment;
        let scratch = Buffer::new(
            gpu,
            "scratch for the driver's builds",
            scratch_bytes,
            BufferUse::Device,
        )?;
        let made = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(storage.vk)
            .size(bytes)
            .ty(info.ty);
        // SAFETY: the buffer has the usage for acceleration structures and the size that the driver returned.
        let vk = unsafe {
            ray_tracing
                .structures
                .create_acceleration_structure(&made, None)
        }
        .map_err(failed_for(what, bytes))?;
        Ok(Self {
            vk,
            ray_tracing: Arc::clone(ray_tracing),
            scratch,
            storage,
        })
    }

    /// Returns the bytes of device memory of the structure and its scratch buffer.
    fn held(&self) -> [u64; 2] {
        [self.storage.held(), self.scratch.held()]
    }

    /// Returns the device address of the structure.
    fn address(&self) -> vk::DeviceAddress {
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default()
            .acceleration_structure(self.vk);
        let structures = &self.ray_tracing.structures;
        // SAFETY: the structure belongs to the device.
        unsafe { structures.get_acceleration_structure_device_address(&info) }
    }

    /// Records the build or update that `info` describes.
    fn record(&self, commands: vk::CommandBuffer, info: Info<'_>, primitives: u32) {
        let ray_tracing = &self.ray_tracing;
        let at = self.scratch.address();
        let scratch_data = vk::DeviceOrHostAddressKHR {
            device_address: at.next_multiple_of(ray_tracing.bounds.scratch_alignment),
        };
        let mut info = info
            .dst_acceleration_structure(self.vk)
            .scratch_data(scratch_data);
        if info.mode == Mode::UPDATE {
            info = info.src_acceleration_structure(self.vk);
        }
        let range =
            vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(primitives);
        // SAFETY: the command buffer is being recorded; structure and scratch have the sizes that the
        // driver returned, and all buffers of the geometry are alive.
        unsafe {
            ray_tracing.structures.cmd_build_acceleration_structures(
                commands,
                &[info],
                &[&[range]],
            );
        }
    }
}

impl Drop for Structure {
    fn drop(&mut self) {
        let structures = &self.ray_tracing.structures;
        // SAFETY: the device has finished. `VulkanRt::load` unloads the engine before it drops the old scene, and
        // `engine`, the first field of `VulkanRt`, is dropped before the last scene. Both wait for the device.
        unsafe { structures.destroy_acceleration_structure(self.vk, None) };
    }
}
