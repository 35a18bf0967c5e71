//! Rays that every tree traces: through the pixels of an image, and from hits to a light.

use crate::{Mesh, Tracer};
use backend::QueryKind;
use geom::{Camera, Point, Ray};
use glam::Vec3;
use scene::Viewpoint;

/// Fraction of the distance to the light that a shadow ray skips, so that it misses the surface it starts from.
const SKIP: f32 = 1e-3;
/// Vertical field of view of the camera.
const FOV_DEGREES: f32 = 40.0;

/// Returns the program's camera for a picture of `size` pixels, which shows every key frame of `mesh`.
pub fn camera(mesh: &Mesh, size: [u32; 2]) -> Camera {
    let view = Viewpoint::framing(&mesh.animation, FOV_DEGREES, size);
    view.camera(size).expect("every scene can be framed")
}

/// For each hit of `primary`, returns a ray that starts near the hit and reaches the program's light at `t = 1`.
pub fn shadow_rays(mesh: &Mesh, primary: &[Ray], tracer: &mut Tracer) -> Vec<Ray> {
    // The light does not depend on the size of the picture.
    let light = Viewpoint::framing(&mesh.animation, FOV_DEGREES, [1, 1]).light;
    let hits = tracer.list(primary, QueryKind::Closest);
    let rays = primary.iter().zip(&hits.closest);
    rays.filter(|(_, hit)| hit.is_hit())
        .map(|(ray, hit)| to_light(ray, hit.t, light))
        .collect()
}

fn to_light(ray: &Ray, t: f32, light: Point) -> Ray {
    let [from, along, light] = [ray.origin, ray.direction, light].map(Vec3::from);
    let point = from + t * along;
    let origin = point + SKIP * (light - point);
    Ray {
        t_max: 1.0,
        ..Ray::new(origin.into(), (light - origin).into())
    }
}
