//! The functions of Embree's C interface that are called, and its ray structures.

use geom::{Hit, Ray};
use std::ffi::{c_char, c_void};
use std::ptr::null_mut;

/// Pointer to a device, a scene or a geometry.
pub(super) type Handle = *mut c_void;

/// `RTCRayHit` for one ray, `RTCRayHit16` for sixteen.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct RayHits<const N: usize> {
    origin: [[f32; N]; 3],
    t_min: [f32; N],
    direction: [[f32; N]; 3],
    time: [f32; N],
    pub(super) t_max: [f32; N],
    mask: [u32; N],
    id: [u32; N],
    flags: [u32; N],
    normal: [[f32; N]; 3],
    uv: [[f32; N]; 2],
    primitive: [u32; N],
    geometry: [u32; N],
    instance: [u32; N],
    instance_primitive: [u32; N],
}

impl<const N: usize> RayHits<N> {
    /// Converts at most `N` rays.
    pub(super) fn new(rays: &[Ray]) -> Self {
        let at = |lane: usize| rays.get(lane);
        let parts = |part: fn(&Ray) -> [f32; 3]| {
            [0, 1, 2].map(|axis| std::array::from_fn(|i| at(i).map_or(0.0, |ray| part(ray)[axis])))
        };
        Self {
            origin: parts(|ray| ray.origin),
            t_min: std::array::from_fn(|i| at(i).map_or(0.0, |ray| ray.t_min)),
            direction: parts(|ray| ray.direction),
            time: [0.0; N],
            t_max: std::array::from_fn(|i| at(i).map_or(0.0, |ray| ray.t_max)),
            mask: [NONE; N],
            id: [0; N],
            flags: [0; N],
            normal: [[0.0; N]; 3],
            uv: [[0.0; N]; 2],
            primitive: [NONE; N],
            geometry: [NONE; N],
            instance: [NONE; N],
            instance_primitive: [NONE; N],
        }
    }

    /// Returns the hit of the ray in `lane`.
    pub(super) fn hit(&self, lane: usize) -> Hit {
        Hit {
            t: self.t_max[lane],
            u: self.uv[0][lane],
            v: self.uv[1][lane],
            triangle: self.primitive[lane],
        }
    }
}

/// `RTCIntersectArguments` or `RTCOccludedArguments`, including a member that exists only in some builds.
#[repr(C)]
pub(super) struct Arguments {
    flags: u32,
    features: u32,
    context: Handle,
    filter: Handle,
    intersect: Handle,
    least_width: f32,
}

impl Arguments {
    /// Initializes arguments as `rtcInitIntersectArguments` does, with the coherence hint if `coherent`.
    pub(super) fn new(coherent: bool) -> Self {
        Self {
            flags: u32::from(coherent) << 16,
            features: u32::MAX,
            context: null_mut(),
            filter: null_mut(),
            intersect: null_mut(),
            least_width: 0.0,
        }
    }
}

pub(super) const NONE: u32 = u32::MAX;
/// `RTC_BUFFER_TYPE_INDEX` and `RTC_FORMAT_UINT3`.
pub(super) const INDICES: [u32; 2] = [0, 0x5003];
/// `RTC_BUFFER_TYPE_VERTEX` and `RTC_FORMAT_FLOAT3`.
pub(super) const VERTICES: [u32; 2] = [1, 0x9003];
/// `RTC_GEOMETRY_TYPE_TRIANGLE`.
pub(super) const TRIANGLES: u32 = 0;
/// `RTC_BUILD_QUALITY_LOW`, `_MEDIUM` and `_REFIT`.
pub(super) const LOW: u32 = 0;
pub(super) const MEDIUM: u32 = 1;
pub(super) const REFIT: u32 = 3;
/// `RTC_SCENE_FLAG_DYNAMIC` and `_ROBUST`.
pub(super) const DYNAMIC: u32 = 1;
pub(super) const ROBUST: u32 = 1 << 2;

#[link(name = "embree4")]
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
    pub(super) fn rtcSetGeometryBuildQuality(geometry: Handle, quality: u32);
    pub(super) fn rtcIntersect1(scene: Handle, ray: *mut RayHits<1>, how: *mut Arguments);
    /// Reads and writes only the ray, the first member of `RTCRayHit`.
    pub(super) fn rtcOccluded1(scene: Handle, ray: *mut RayHits<1>, how: *mut Arguments);
    pub(super) fn rtcIntersect16(
        valid: *const i32,
        scene: Handle,
        rays: *mut RayHits<16>,
        how: *mut Arguments,
    );
    /// Reads and writes only the rays, the first member of `RTCRayHit16`.
    pub(super) fn rtcOccluded16(
        valid: *const i32,
        scene: Handle,
        rays: *mut RayHits<16>,
        how: *mut Arguments,
    );
}
