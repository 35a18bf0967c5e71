//! Embree's C interface, loaded at run time, and the structures of its rays.

use geom::{Hit, Point, Ray};
use libloading::Library;
use std::ffi::{c_char, c_void};
use std::ptr::null_mut;
use std::sync::OnceLock;

/// A device, a scene or a geometry.
pub(super) type Handle = *mut c_void;

/// `RTCRayHit`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct RayHit {
    origin: Point,
    t_min: f32,
    direction: Point,
    time: f32,
    pub(super) t_max: f32,
    mask: u32,
    id: u32,
    flags: u32,
    normal: Point,
    uv: [f32; 2],
    primitive: u32,
    geometry: u32,
    instance: u32,
    instance_primitive: u32,
}

impl RayHit {
    /// Returns a ray without a hit.
    pub(super) fn new(ray: &Ray) -> Self {
        Self {
            origin: ray.origin,
            t_min: ray.t_min,
            direction: ray.direction,
            time: 0.0,
            t_max: ray.t_max,
            mask: NONE,
            id: 0,
            flags: 0,
            normal: [0.0; 3],
            uv: [0.0; 2],
            primitive: NONE,
            geometry: NONE,
            instance: NONE,
            instance_primitive: NONE,
        }
    }

    /// Returns the hit.
    pub(super) fn hit(&self) -> Hit {
        Hit {
            t: self.t_max,
            u: self.uv[0],
            v: self.uv[1],
            triangle: self.primitive,
        }
    }
}

/// `RTCIntersectArguments` or `RTCOccludedArguments`.
#[repr(C)]
pub(super) struct Arguments {
    flags: u32,
    features: u32,
    context: Handle,
    filter: Handle,
    intersect: Handle,
    /// Exists only in builds with `RTC_MIN_WIDTH`. Other builds do not read this last member.
    least_width: f32,
}

impl Arguments {
    /// Returns the defaults of `rtcInitIntersectArguments`.
    pub(super) fn new() -> Self {
        Self {
            flags: 0,
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
/// `RTC_SCENE_FLAG_DYNAMIC`.
pub(super) const DYNAMIC: u32 = 1;

/// Declares the table of functions and its loader.
macro_rules! functions {
    ($($field:ident = $symbol:literal: fn($($of:ty),*) $(-> $to:ty)?;)+) => {
        /// Embree's functions.
        pub(super) struct Functions {
            $(pub(super) $field: unsafe extern "C" fn($($of),*) $(-> $to)?,)+
            /// Keeps the library open.
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
    intersect_1 = b"rtcIntersect1\0": fn(Handle, *mut RayHit, *mut Arguments);
    // Reads and writes the ray alone, which comes first in `RTCRayHit`.
    occluded_1 = b"rtcOccluded1\0": fn(Handle, *mut RayHit, *mut Arguments);
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
/// No library with one of these names is found, or it lacks a function.
pub(super) fn functions() -> Result<&'static Functions, String> {
    static LOADED: OnceLock<Result<Functions, String>> = OnceLock::new();
    let loaded = LOADED.get_or_init(|| {
        let mut found = NAMES.iter().filter_map(|name| {
            // SAFETY: Embree's static initialisers only set up the library's own state.
            unsafe { Library::new(name) }.ok()
        });
        let library = found.next().ok_or("the library libembree4 was not found")?;
        // SAFETY: libraries with this name are Embree 4.
        unsafe { Functions::of(library) }.map_err(|e| format!("libembree4 is incomplete: {e}"))
    });
    loaded.as_ref().map_err(Clone::clone)
}
