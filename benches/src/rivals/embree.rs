//! Embree 3 (Wald, Woop, Benthin, Johnson, Ernst 2014), by its C interface: the feature `embree` links it.
//!
//! Scenes of medium quality (binned SAH), asked ray by ray. Debian has it as `libembree-dev`.

#![expect(unsafe_code, reason = "a C library")]

use crate::{Node, Rival};
use geom::{Ray, Triangle};
use std::ffi::{c_char, c_void};
use std::ptr::{NonNull, null, null_mut};

/// A scene of Embree's.
#[derive(Default)]
pub struct Embree {
    scene: Option<Scene>,
}

type Handle = *mut c_void;

/// Owns a device and a committed scene of one mesh.
struct Scene {
    device: NonNull<c_void>,
    scene: NonNull<c_void>,
}

// SAFETY: a committed scene may be asked from any thread at once, says Embree's manual.
unsafe impl Send for Scene {}
// SAFETY: likewise.
unsafe impl Sync for Scene {}

/// `RTCRayHit`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct RayHit {
    origin: [f32; 3],
    t_min: f32,
    direction: [f32; 3],
    time: f32,
    t_max: f32,
    mask: u32,
    id: u32,
    flags: u32,
    normal: [f32; 3],
    uv: [f32; 2],
    primitive: u32,
    geometry: u32,
    instance: u32,
}

/// `RTCIntersectContext`, as `rtcInitIntersectContext` makes it, with room for a member that some builds have.
#[repr(C)]
struct Context {
    flags: u32,
    filter: Handle,
    instance: u32,
    least_width: f32,
}

const NONE: u32 = u32::MAX;
/// `RTC_BUFFER_TYPE_INDEX` and `RTC_FORMAT_UINT3`.
const INDICES: [u32; 2] = [0, 0x5003];
/// `RTC_BUFFER_TYPE_VERTEX` and `RTC_FORMAT_FLOAT3`.
const VERTICES: [u32; 2] = [1, 0x9003];
/// `RTC_GEOMETRY_TYPE_TRIANGLE`.
const TRIANGLES: u32 = 0;
/// `RTC_BUILD_QUALITY_MEDIUM`.
const MEDIUM: u32 = 1;

#[link(name = "embree3")]
unsafe extern "C" {
    fn rtcNewDevice(config: *const c_char) -> Handle;
    fn rtcReleaseDevice(device: Handle);
    fn rtcNewScene(device: Handle) -> Handle;
    fn rtcReleaseScene(scene: Handle);
    fn rtcSetSceneBuildQuality(scene: Handle, quality: u32);
    fn rtcNewGeometry(device: Handle, kind: u32) -> Handle;
    fn rtcReleaseGeometry(geometry: Handle);
    fn rtcSetNewGeometryBuffer(
        geometry: Handle,
        kind: u32,
        slot: u32,
        format: u32,
        stride: usize,
        count: usize,
    ) -> Handle;
    fn rtcCommitGeometry(geometry: Handle);
    fn rtcAttachGeometry(scene: Handle, geometry: Handle) -> u32;
    fn rtcCommitScene(scene: Handle);
    fn rtcIntersect1(scene: Handle, context: *mut Context, ray: *mut RayHit);
    fn rtcOccluded1(scene: Handle, context: *mut Context, ray: *mut RayHit);
}

impl Scene {
    fn new(triangles: &[Triangle]) -> Self {
        // SAFETY: a null configuration is the default one.
        let device = NonNull::new(unsafe { rtcNewDevice(null()) }).expect("Embree has a device");
        // SAFETY: the device exists, and so do all that is made of it here. A new buffer holds as many
        // elements as were asked for, and numbers and indices are written to it in the stated format.
        let scene = unsafe {
            let scene = rtcNewScene(device.as_ptr());
            rtcSetSceneBuildQuality(scene, MEDIUM);
            let geometry = rtcNewGeometry(device.as_ptr(), TRIANGLES);
            fill(geometry, VERTICES, triangles.as_flattened());
            let corners: Vec<[u32; 3]> = (0..triangles.len() as u32)
                .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
                .collect();
            fill(geometry, INDICES, &corners);
            rtcCommitGeometry(geometry);
            rtcAttachGeometry(scene, geometry);
            rtcReleaseGeometry(geometry);
            rtcCommitScene(scene);
            scene
        };
        let scene = NonNull::new(scene).expect("Embree has memory");
        Self { device, scene }
    }

    fn ask(
        &self,
        ray: &Ray,
        ask: unsafe extern "C" fn(Handle, *mut Context, *mut RayHit),
    ) -> RayHit {
        let mut context = Context {
            flags: 0,
            filter: null_mut(),
            instance: NONE,
            least_width: 0.0,
        };
        let mut found = RayHit {
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
        };
        // SAFETY: the scene is committed, and ray and context live as long as the call.
        unsafe { ask(self.scene.as_ptr(), &raw mut context, &raw mut found) };
        found
    }
}

/// Copies `elements` to a new buffer of `geometry`.
///
/// # Safety
/// The geometry exists, and the format is that of `T`.
unsafe fn fill<T: Copy>(geometry: Handle, [kind, format]: [u32; 2], elements: &[T]) {
    // SAFETY: see above; the buffer is as long as the elements.
    unsafe {
        let (size, count) = (size_of::<T>(), elements.len());
        let buffer = rtcSetNewGeometryBuffer(geometry, kind, 0, format, size, count);
        assert!(!buffer.is_null(), "Embree has memory");
        std::ptr::copy_nonoverlapping(elements.as_ptr(), buffer.cast(), count);
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: both exist until here.
        unsafe {
            rtcReleaseScene(self.scene.as_ptr());
            rtcReleaseDevice(self.device.as_ptr());
        }
    }
}

impl Rival for Embree {
    const NAME: &'static str = "Embree 3, medium";
    const BUILDS_IN_PARALLEL: bool = true;
    const REFITS: bool = false;
    type Soup = Vec<Triangle>;

    fn soup(triangles: &[Triangle]) -> Self::Soup {
        triangles.to_vec()
    }

    fn build(&mut self, soup: &mut Self::Soup) {
        self.scene = Some(Scene::new(soup));
    }

    fn refit(&mut self, _: &Self::Soup) {}

    fn closest(&self, _: &Self::Soup, ray: &Ray) -> Option<(f32, u32)> {
        let found = self.scene.as_ref()?.ask(ray, rtcIntersect1);
        (found.primitive != NONE).then_some((found.t_max, found.primitive))
    }

    fn blocked(&self, _: &Self::Soup, ray: &Ray) -> bool {
        let scene = self.scene.as_ref();
        // Embree's sign for a ray that met something.
        scene.is_some_and(|scene| scene.ask(ray, rtcOccluded1).t_max < 0.0)
    }

    /// None: Embree keeps its nodes to itself.
    fn nodes(&self, _: &Self::Soup) -> Vec<Node> {
        Vec::new()
    }
}
