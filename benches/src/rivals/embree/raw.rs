//! What is called of Embree's C interface, and the forms of its rays.

use std::ffi::{c_char, c_void};
use std::ptr::null_mut;

/// A device, a scene or a geometry.
pub(super) type Handle = *mut c_void;

/// `RTCRayHit`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct RayHit {
    pub(super) origin: [f32; 3],
    pub(super) t_min: f32,
    pub(super) direction: [f32; 3],
    pub(super) time: f32,
    pub(super) t_max: f32,
    pub(super) mask: u32,
    pub(super) id: u32,
    pub(super) flags: u32,
    pub(super) normal: [f32; 3],
    pub(super) uv: [f32; 2],
    pub(super) primitive: u32,
    pub(super) geometry: u32,
    pub(super) instance: u32,
}

/// `RTCIntersectContext`, as `rtcInitIntersectContext` makes it, with room for a member that some builds have.
#[repr(C)]
pub(super) struct Context {
    flags: u32,
    filter: Handle,
    instance: u32,
    least_width: f32,
}

impl Context {
    pub(super) fn new(coherent: bool) -> Self {
        Self {
            flags: u32::from(coherent),
            filter: null_mut(),
            instance: NONE,
            least_width: 0.0,
        }
    }
}

/// `RTCRayHit16`.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct RayHit16 {
    pub(super) origin: [[f32; 16]; 3],
    pub(super) t_min: [f32; 16],
    pub(super) direction: [[f32; 16]; 3],
    pub(super) time: [f32; 16],
    pub(super) t_max: [f32; 16],
    pub(super) mask: [u32; 16],
    pub(super) id: [u32; 16],
    pub(super) flags: [u32; 16],
    pub(super) normal: [[f32; 16]; 3],
    pub(super) uv: [[f32; 16]; 2],
    pub(super) primitive: [u32; 16],
    pub(super) geometry: [u32; 16],
    pub(super) instance: [u32; 16],
}

pub(super) const NONE: u32 = u32::MAX;
/// `RTC_BUFFER_TYPE_INDEX` and `RTC_FORMAT_UINT3`.
pub(super) const INDICES: [u32; 2] = [0, 0x5003];
/// `RTC_BUFFER_TYPE_VERTEX` and `RTC_FORMAT_FLOAT3`.
pub(super) const VERTICES: [u32; 2] = [1, 0x9003];
/// `RTC_GEOMETRY_TYPE_TRIANGLE`.
pub(super) const TRIANGLES: u32 = 0;
/// `RTC_BUILD_QUALITY_MEDIUM`.
pub(super) const MEDIUM: u32 = 1;
/// `RTC_SCENE_FLAG_ROBUST`.
pub(super) const ROBUST: u32 = 1 << 2;

#[link(name = "embree3")]
unsafe extern "C" {
    pub(super) fn rtcNewDevice(config: *const c_char) -> Handle;
    pub(super) fn rtcReleaseDevice(device: Handle);
    pub(super) fn rtcNewScene(device: Handle) -> Handle;
    pub(super) fn rtcReleaseScene(scene: Handle);
    pub(super) fn rtcSetSceneBuildQuality(scene: Handle, quality: u32);
    pub(super) fn rtcSetSceneFlags(scene: Handle, flags: u32);
    pub(super) fn rtcUpdateGeometryBuffer(geometry: Handle, kind: u32, slot: u32);
    pub(super) fn rtcNewGeometry(device: Handle, kind: u32) -> Handle;
    pub(super) fn rtcReleaseGeometry(geometry: Handle);
    pub(super) fn rtcSetNewGeometryBuffer(
        geometry: Handle,
        kind: u32,
        slot: u32,
        format: u32,
        stride: usize,
        count: usize,
    ) -> Handle;
    pub(super) fn rtcCommitGeometry(geometry: Handle);
    pub(super) fn rtcAttachGeometry(scene: Handle, geometry: Handle) -> u32;
    pub(super) fn rtcCommitScene(scene: Handle);
    pub(super) fn rtcIntersect1(scene: Handle, context: *mut Context, ray: *mut RayHit);
    pub(super) fn rtcOccluded1(scene: Handle, context: *mut Context, ray: *mut RayHit);
    pub(super) fn rtcIntersect16(
        valid: *const i32,
        scene: Handle,
        context: *mut Context,
        rays: *mut RayHit16,
    );
    /// Asks for the rays alone, which come first in `RayHit16`.
    pub(super) fn rtcOccluded16(
        valid: *const i32,
        scene: Handle,
        context: *mut Context,
        rays: *mut RayHit16,
    );
}
