//! Embree's C interface, loaded at run time, and the structures of its rays.

use geom::{Hit, Ray};
use libloading::Library;
use std::ffi::{c_char, c_void};
use std::ptr::null_mut;
use std::sync::OnceLock;

/// A device, a scene or a geometry.
pub(super) type Handle = *mut c_void;

/// `RTCRayHit` of one ray, `RTCRayHit16` of sixteen.
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
    /// Packs up to `N` rays.
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

    /// Returns the hit of the ray in a lane.
    pub(super) fn hit(&self, lane: usize) -> Hit {
        Hit {
            t: self.t_max[lane],
            u: self.uv[0][lane],
            v: self.uv[1][lane],
            triangle: self.primitive[lane],
        }
    }
}

/// `RTCIntersectArguments` or `RTCOccludedArguments`, including a member that some builds omit.
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
    /// Returns the defaults of `rtcInitIntersectArguments`, with the flag for coherent rays if they are.
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

/// Declares the table of functions and its loader.
macro_rules! functions {
    ($($field:ident = $symbol:literal: fn($($of:ty),*) $(-> $to:ty)?;)+) => {
        /// Embree's functions.
        pub(super) struct Functions {
            $(pub(super) $field: unsafe extern "C" fn($($of),*) $(-> $to)?,)+
            /// Holds the functions' code.
            _library: Library,
        }

        impl Functions {
            /// Finds every function of a library.
            ///
            /// # Safety
            /// The library is Embree 4, whose functions have these signatures.
            unsafe fn of(library: Library) -> Result<Self, libloading::Error> {
                Ok(Self {
                    // SAFETY: the caller vouches for the signatures.
                    $($field: *unsafe { library.get($symbol)? },)+
                    _library: library,
                })
            }
        }
    };
}

functions! {
    new_device = b"rtcNewDevice\0": fn(*const c_char) -> Handle;
    release_device = b"rtcReleaseDevice\0": fn(Handle);
    get_device_property = b"rtcGetDeviceProperty\0": fn(Handle, u32) -> isize;
    new_scene = b"rtcNewScene\0": fn(Handle) -> Handle;
    release_scene = b"rtcReleaseScene\0": fn(Handle);
    set_scene_build_quality = b"rtcSetSceneBuildQuality\0": fn(Handle, u32);
    set_scene_flags = b"rtcSetSceneFlags\0": fn(Handle, u32);
    update_geometry_buffer = b"rtcUpdateGeometryBuffer\0": fn(Handle, u32, u32);
    new_geometry = b"rtcNewGeometry\0": fn(Handle, u32) -> Handle;
    release_geometry = b"rtcReleaseGeometry\0": fn(Handle);
    set_new_geometry_buffer = b"rtcSetNewGeometryBuffer\0": fn(Handle, u32, u32, u32, usize, usize) -> Handle;
    commit_geometry = b"rtcCommitGeometry\0": fn(Handle);
    attach_geometry = b"rtcAttachGeometry\0": fn(Handle, Handle) -> u32;
    commit_scene = b"rtcCommitScene\0": fn(Handle);
    set_geometry_build_quality = b"rtcSetGeometryBuildQuality\0": fn(Handle, u32);
    intersect_1 = b"rtcIntersect1\0": fn(Handle, *mut RayHits<1>, *mut Arguments);
    // Reads and writes the ray alone, which comes first in `RTCRayHit`.
    occluded_1 = b"rtcOccluded1\0": fn(Handle, *mut RayHits<1>, *mut Arguments);
    intersect_16 = b"rtcIntersect16\0": fn(*const i32, Handle, *mut RayHits<16>, *mut Arguments);
    // Reads and writes the rays alone, as above.
    occluded_16 = b"rtcOccluded16\0": fn(*const i32, Handle, *mut RayHits<16>, *mut Arguments);
}

/// Names of the library, by the platforms' conventions.
const NAMES: [&str; 4] = [
    "libembree4.so.4",
    "libembree4.so",
    "libembree4.dylib",
    "embree4.dll",
];

/// Loads the library once for the process.
///
/// # Errors
/// No library with this name is found, or it lacks a function.
pub(super) fn functions() -> Result<&'static Functions, String> {
    static LOADED: OnceLock<Result<Functions, String>> = OnceLock::new();
    let loaded = LOADED.get_or_init(|| {
        let mut found = NAMES.iter().filter_map(|name| {
            // SAFETY: Embree's initialisers only register tasks of its own.
            unsafe { Library::new(name) }.ok()
        });
        let library = found.next().ok_or("the library libembree4 was not found")?;
        // SAFETY: libraries with this name are Embree 4.
        unsafe { Functions::of(library) }.map_err(|e| format!("libembree4 is incomplete: {e}"))
    });
    loaded.as_ref().map_err(Clone::clone)
}
