//! A device and a scene of one mesh.

use super::raw::*;
use crate::TreeUpdate;
use geom::{Hit, Point, Ray};
use std::ffi::{CString, c_void};
use std::ptr::NonNull;

/// Owns a device and a committed scene of one mesh.
pub(crate) struct EmbreeScene {
    functions: &'static Functions,
    device: NonNull<c_void>,
    scene: NonNull<c_void>,
    geometry: NonNull<c_void>,
    /// Embree's own buffer of vertices, and their number.
    vertices: NonNull<Point>,
    vertex_count: usize,
}

// SAFETY: Embree's manual allows queries of a committed scene from any thread at once. Vertices change through `&mut self`.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above.
unsafe impl Sync for EmbreeScene {}

type Trace = unsafe extern "C" fn(Handle, *mut RayHit, *mut Arguments);

impl EmbreeScene {
    /// Builds a scene over a mesh on `threads` threads, or on all cores if `threads` is 0. All scenes of the process
    /// use the largest requested number. [`EmbreeScene::update_tree`] rebuilds or refits the tree, by `tree_update`.
    ///
    /// # Errors
    /// The library is absent or incomplete, or it has no device.
    pub(crate) fn new(
        vertices: &[Point],
        triangles: &[[u32; 3]],
        threads: usize,
        tree_update: TreeUpdate,
    ) -> Result<Self, String> {
        let functions = functions()?;
        let config = CString::new(format!("threads={threads}")).expect("no zero byte");
        // SAFETY: the configuration is a string that ends with a zero byte.
        let device = NonNull::new(unsafe { (functions.new_device)(config.as_ptr()) });
        let device = device.ok_or("Embree has no device for this processor")?;
        let (quality, flags) = match tree_update {
            TreeUpdate::Rebuild => (MEDIUM, 0),
            TreeUpdate::Refit => (LOW, DYNAMIC),
        };
        // SAFETY: the device exists, and so do the objects that are made here. Each new buffer has the requested number
        // of elements, which are written in the stated format.
        let (scene, geometry, buffer) = unsafe {
            let scene = (functions.new_scene)(device.as_ptr());
            (functions.set_scene_build_quality)(scene, quality);
            (functions.set_scene_flags)(scene, flags);
            let geometry = (functions.new_geometry)(device.as_ptr(), TRIANGLES);
            if tree_update == TreeUpdate::Refit {
                (functions.set_geometry_build_quality)(geometry, REFIT);
            }
            let buffer = fill(functions, geometry, VERTICES, vertices);
            fill(functions, geometry, INDICES, triangles);
            (functions.commit_geometry)(geometry);
            (functions.attach_geometry)(scene, geometry);
            (functions.commit_scene)(scene);
            (scene, geometry, buffer)
        };
        Ok(Self {
            functions,
            device,
            scene: NonNull::new(scene).expect("Embree has memory"),
            geometry: NonNull::new(geometry).expect("Embree has memory"),
            vertices: buffer,
            vertex_count: vertices.len(),
        })
    }

    /// Returns the vertices, to be overwritten before [`EmbreeScene::update_tree`].
    pub(crate) fn vertices(&mut self) -> &mut [Point] {
        // SAFETY: Embree keeps the buffer as long as the geometry, and traces nothing while `self` is borrowed.
        unsafe { std::slice::from_raw_parts_mut(self.vertices.as_ptr(), self.vertex_count) }
    }

    /// Rebuilds or refits the tree in place, from the current vertices.
    pub(crate) fn update_tree(&mut self) {
        // SAFETY: both exist, and no query runs while `self` is borrowed.
        unsafe {
            (self.functions.update_geometry_buffer)(self.geometry.as_ptr(), VERTICES[0], 0);
            (self.functions.commit_geometry)(self.geometry.as_ptr());
            (self.functions.commit_scene)(self.scene.as_ptr());
        }
    }

    /// Returns the closest hit of a ray.
    pub(crate) fn closest(&self, ray: &Ray) -> Hit {
        self.trace(ray, self.functions.intersect_1).hit()
    }

    /// Returns whether a ray hits anything.
    pub(crate) fn is_occluded(&self, ray: &Ray) -> bool {
        // Embree marks a ray that hit something by a negative `t_max`.
        self.trace(ray, self.functions.occluded_1).t_max < 0.0
    }

    fn trace(&self, ray: &Ray, trace: Trace) -> RayHit {
        let mut arguments = Arguments::new();
        let mut found = RayHit::new(ray);
        // SAFETY: the scene is committed, and ray and arguments live as long as the call.
        unsafe { trace(self.scene.as_ptr(), &raw mut found, &raw mut arguments) };
        found
    }
}

/// Copies `elements` to a new buffer of `geometry`, and returns the buffer.
///
/// # Safety
/// The geometry exists, and the format is that of `T`.
unsafe fn fill<T: Copy>(
    functions: &Functions,
    geometry: Handle,
    [kind, format]: [u32; 2],
    elements: &[T],
) -> NonNull<T> {
    let (size, count) = (size_of::<T>(), elements.len());
    // SAFETY: the caller vouches for the geometry; the buffer is as long as the elements.
    unsafe {
        let buffer = (functions.set_new_geometry_buffer)(geometry, kind, 0, format, size, count);
        let buffer = NonNull::new(buffer.cast()).expect("Embree has memory");
        std::ptr::copy_nonoverlapping(elements.as_ptr(), buffer.as_ptr(), count);
        buffer
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: all exist until here.
        unsafe {
            (self.functions.release_geometry)(self.geometry.as_ptr());
            (self.functions.release_scene)(self.scene.as_ptr());
            (self.functions.release_device)(self.device.as_ptr());
        }
    }
}
