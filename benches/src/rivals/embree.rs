//! Embree 4 (Wald, Woop, Benthin, Johnson, Ernst 2014), by its C interface: the feature `embree` links it.
//!
//! Scenes of medium quality (binned SAH), asked ray by ray or by packets of sixteen. The Python wheel `embreex` holds
//! the library: `LIBRARY_PATH` must name a folder with it as `libembree4.so` to link, `LD_LIBRARY_PATH` to run.

#![expect(unsafe_code, reason = "a C library")]

mod raw;

use geom::{Hit, Ray, Triangle};
use raw::*;
use std::ffi::{CString, c_void};
use std::ptr::NonNull;

/// Owns a device and a committed scene of one mesh.
pub struct EmbreeScene {
    device: NonNull<c_void>,
    scene: NonNull<c_void>,
    geometry: NonNull<c_void>,
}

// SAFETY: a committed scene may be asked from any thread at once, says Embree's manual.
unsafe impl Send for EmbreeScene {}
// SAFETY: likewise.
unsafe impl Sync for EmbreeScene {}

/// What a scene is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Made {
    /// The fastest rays.
    Fast,
    /// Rays that pass between no neighbours.
    Robust,
    /// Vertices that move: each commit but the first refits.
    Refitted,
}

/// Up to sixteen rays in the form that Embree asks for.
#[derive(Clone, Copy)]
pub struct Packet16 {
    rays: RayHits<16>,
    valid: Valid,
    /// What Embree is told of them.
    coherent: bool,
}

/// -1 for each lane that holds a ray.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Valid([i32; 16]);

impl Packet16 {
    /// Packs rays, of which there are at most sixteen. Those that are `coherent` lie close together.
    pub fn new(rays: &[Ray], coherent: bool) -> Self {
        let valid = |lane| if lane < rays.len() { -1 } else { 0 };
        Self {
            rays: RayHits::new(rays),
            valid: Valid(std::array::from_fn(valid)),
            coherent,
        }
    }
}

impl EmbreeScene {
    /// Builds over `triangles`, on as many threads (0: on all). All scenes alive at a time share the largest number.
    pub fn new(triangles: &[Triangle], threads: usize, made: Made) -> Self {
        let config = CString::new(format!("threads={threads}")).expect("no zero byte within");
        // SAFETY: the configuration is a string that ends with a zero byte.
        let device = NonNull::new(unsafe { rtcNewDevice(config.as_ptr()) });
        let device = device.expect("Embree has a device");
        let corners: Vec<[u32; 3]> = (0..triangles.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
        let (quality, flags) = match made {
            Made::Fast => (MEDIUM, 0),
            Made::Robust => (MEDIUM, ROBUST),
            Made::Refitted => (LOW, DYNAMIC),
        };
        // SAFETY: the device exists, and so do all that is made of it here. A new buffer holds as many
        // elements as were asked for, and numbers and indices are written to it in the stated format.
        let (scene, geometry) = unsafe {
            let scene = rtcNewScene(device.as_ptr());
            rtcSetSceneBuildQuality(scene, quality);
            rtcSetSceneFlags(scene, flags);
            let geometry = rtcNewGeometry(device.as_ptr(), TRIANGLES);
            if made == Made::Refitted {
                rtcSetGeometryBuildQuality(geometry, REFIT);
            }
            fill(geometry, VERTICES, triangles.as_flattened());
            fill(geometry, INDICES, &corners);
            rtcCommitGeometry(geometry);
            rtcAttachGeometry(scene, geometry);
            rtcCommitScene(scene);
            (scene, geometry)
        };
        Self {
            device,
            scene: NonNull::new(scene).expect("Embree has memory"),
            geometry: NonNull::new(geometry).expect("Embree has memory"),
        }
    }

    /// Builds anew or refits, over the same triangles and in the memory at hand.
    pub fn rebuild(&mut self) {
        // SAFETY: both exist, and nobody else asks the scene meanwhile.
        unsafe {
            rtcUpdateGeometryBuffer(self.geometry.as_ptr(), VERTICES[0], 0);
            rtcCommitGeometry(self.geometry.as_ptr());
            rtcCommitScene(self.scene.as_ptr());
        }
    }

    /// The closest hits of rays, for as many as there is room for; likewise below.
    pub fn closest(&self, rays: &[Ray], out: &mut [Hit]) {
        for (ray, out) in rays.iter().zip(out) {
            *out = self.ask(ray, rtcIntersect1).hit(0);
        }
    }

    /// 1 for a ray that hits anything.
    pub fn occluded(&self, rays: &[Ray], out: &mut [u8]) {
        for (ray, out) in rays.iter().zip(out) {
            // Embree's sign for a ray that met something.
            *out = u8::from(self.ask(ray, rtcOccluded1).t_max < [0.0]);
        }
    }

    /// The closest hits of the rays of packets.
    pub fn closest_packets(&self, packets: &[Packet16], out: &mut [Hit]) {
        for (packet, out) in packets.iter().zip(out.chunks_mut(16)) {
            let found = self.ask_packet(packet, rtcIntersect16);
            for (lane, out) in out.iter_mut().enumerate() {
                *out = found.hit(lane);
            }
        }
    }

    /// Likewise, 1 for a ray that hits anything.
    pub fn occluded_packets(&self, packets: &[Packet16], out: &mut [u8]) {
        for (packet, out) in packets.iter().zip(out.chunks_mut(16)) {
            let found = self.ask_packet(packet, rtcOccluded16);
            for (out, t) in out.iter_mut().zip(&found.t_max) {
                *out = u8::from(*t < 0.0);
            }
        }
    }

    fn ask_packet(
        &self,
        packet: &Packet16,
        ask: unsafe extern "C" fn(*const i32, Handle, *mut RayHits<16>, *mut Arguments),
    ) -> RayHits<16> {
        let mut arguments = Arguments::new(packet.coherent);
        let (valid, mut rays) = (packet.valid, packet.rays);
        let scene = self.scene.as_ptr();
        // SAFETY: the scene is committed; rays, their marks and the arguments live as long as the call.
        unsafe {
            ask(valid.0.as_ptr(), scene, &raw mut rays, &raw mut arguments);
        }
        rays
    }

    fn ask(
        &self,
        ray: &Ray,
        ask: unsafe extern "C" fn(Handle, *mut RayHits<1>, *mut Arguments),
    ) -> RayHits<1> {
        let mut arguments = Arguments::new(false);
        let mut found = RayHits::new(std::slice::from_ref(ray));
        // SAFETY: the scene is committed, and ray and arguments live as long as the call.
        unsafe { ask(self.scene.as_ptr(), &raw mut found, &raw mut arguments) };
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

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: all exist until here.
        unsafe {
            rtcReleaseGeometry(self.geometry.as_ptr());
            rtcReleaseScene(self.scene.as_ptr());
            rtcReleaseDevice(self.device.as_ptr());
        }
    }
}
