//! Rays that every tree traces: through the pixels of an image, and from hits to a light.

use crate::{Mesh, Tracer};
use backend::QueryKind;
use geom::{Camera, CameraPose, Point, Ray};
use glam::Vec3;

/// Fraction of the distance to the light that a shadow ray skips, so that it misses the surface it starts from.
const SKIP: f32 = 1e-3;

/// Returns a camera of `size` pixels that looks at the centre of `mesh` at its start, from above one corner. The picture
/// may not show the whole mesh.
pub fn camera(mesh: &Mesh, size: [u32; 2]) -> Camera {
    let (centre, radius) = sphere(mesh);
    let eye = centre + radius * Vec3::new(0.9, 0.8, 1.6);
    let camera = Camera::look_at(CameraPose::new(eye.into(), centre.into()), size);
    camera.expect("a mesh has some extent")
}

/// For each hit of `primary`, returns a ray that starts near the hit and reaches a light at `t = 1`. The light is high
/// above the mesh.
pub fn shadow_rays(mesh: &Mesh, primary: &[Ray], tracer: &mut Tracer) -> Vec<Ray> {
    let (centre, radius) = sphere(mesh);
    let light = centre + radius * Vec3::new(-1.0, 3.0, 0.7);
    let hits = tracer.list(primary, QueryKind::Closest);
    let rays = primary.iter().zip(&hits.closest);
    rays.filter(|(_, hit)| hit.is_hit())
        .map(|(ray, hit)| to_light(ray, hit.t, light.into()))
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

/// Returns the centre of the mesh's bounding box at its start, and half its diagonal.
fn sphere(mesh: &Mesh) -> (Vec3, f32) {
    let positions = mesh.positions(mesh.start());
    let empty = geom::Aabb::EMPTY;
    let bounds = positions.iter().fold(empty, |b, &p| b.with_point(p));
    let [min, max] = [bounds.min, bounds.max].map(Vec3::from);
    (0.5 * (min + max), 0.5 * (max - min).length())
}
