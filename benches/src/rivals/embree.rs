//! Embree 4 (Wald, Woop, Benthin, Johnson, Ernst 2014) by its C interface, linked by the feature `embree`.
//!
//! Scenes have medium quality (binned SAH). Rays are traced singly or in packets of sixteen. The Python wheel `embreex`
//! contains the library. `LIBRARY_PATH` must name a folder that has it as `libembree4.so` to link, and
//! `LD_LIBRARY_PATH` to run.

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

// SAFETY: Embree's manual allows queries of a committed scene from any thread at the same time.
unsafe impl Send for EmbreeScene {}
// SAFETY: as for `Send`: concurrent queries of a committed scene are allowed, and changes require `&mut`.
unsafe impl Sync for EmbreeScene {}

/// Purpose for which a scene is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Made {
    /// Fastest rays.
    Fast,
    /// Robust rays, which cannot pass between adjacent triangles.
    Robust,
    /// Moving vertices: each commit after the first refits.
    Refitted,
}

/// Up to sixteen rays in Embree's format.
#[derive(Clone, Copy)]
pub struct Packet16 {
    rays: RayHits<16>,
    valid: Valid,
    /// Coherence hint for Embree.
    coherent: bool,
}

/// -1 for each lane that contains a ray.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Valid([i32; 16]);

impl Packet16 {
    /// Packs up to sixteen rays. `coherent` states that the rays are close together.
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
    /// Builds a scene over `triangles` on `threads` threads, or on all if 0. Scenes that exist at the same time share
    /// the largest number.
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
        // SAFETY: the device exists, and so does every object that is created from it here. A new buffer has as many
        // elements as requested. Coordinates and indices are written to it in the specified format.
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

    /// Rebuilds or refits, over the same triangles and in existing memory.
    pub fn rebuild(&mut self) {
        // SAFETY: both objects exist, and `&mut self` excludes concurrent queries of the scene.
        unsafe {
            rtcUpdateGeometryBuffer(self.geometry.as_ptr(), VERTICES[0], 0);
            rtcCommitGeometry(self.geometry.as_ptr());
            rtcCommitScene(self.scene.as_ptr());
        }
    }

    /// Writes the closest hits of rays, for as many rays as `out` has elements.
    pub fn closest(&self, rays: &[Ray], out: &mut [Hit]) {
        for (ray, out) in rays.iter().zip(out) {
            *out = self.ask(ray, rtcIntersect1).hit(0);
        }
    }

    /// Writes 1 for each ray that hits anything and 0 for the others, for as many rays as `out` has elements.
    pub fn occluded(&self, rays: &[Ray], out: &mut [u8]) {
        for (ray, out) in rays.iter().zip(out) {
            // Embree sets the upper bound of an occluded ray to a negative number.
            *out = u8::from(self.ask(ray, rtcOccluded1).t_max < [0.0]);
        }
    }

    /// Writes the closest hits of the rays of packets, for as many rays as `out` has elements.
    pub fn closest_packets(&self, packets: &[Packet16], out: &mut [Hit]) {
        for (packet, out) in packets.iter().zip(out.chunks_mut(16)) {
            let found = self.ask_packet(packet, rtcIntersect16);
            for (lane, out) in out.iter_mut().enumerate() {
                *out = found.hit(lane);
            }
        }
    }

    /// Writes 1 for each ray of packets that hits anything and 0 for the others, for as many rays as `out` has
    /// elements.
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
        // SAFETY: the scene is committed. The rays, their marks and the arguments outlive the call.
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
        // SAFETY: the scene is committed. The ray and the arguments outlive the call.
        unsafe { ask(self.scene.as_ptr(), &raw mut found, &raw mut arguments) };
        found
    }
}

/// Copies `elements` to a new buffer of `geometry`.
///
/// # Safety
/// The geometry must exist, and `format` must be that of `T`.
unsafe fn fill<T: Copy>(geometry: Handle, [kind, format]: [u32; 2], elements: &[T]) {
    // SAFETY: the caller guarantees the geometry and the format. The buffer is as long as the elements.
    unsafe {
        let (size, count) = (size_of::<T>(), elements.len());
        let buffer = rtcSetNewGeometryBuffer(geometry, kind, 0, format, size, count);
        assert!(!buffer.is_null(), "Embree has memory");
        std::ptr::copy_nonoverlapping(elements.as_ptr(), buffer.cast(), count);
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: all three objects exist until here, and each is released once.
        unsafe {
            rtcReleaseGeometry(self.geometry.as_ptr());
            rtcReleaseScene(self.scene.as_ptr());
            rtcReleaseDevice(self.device.as_ptr());
        }
    }
}
