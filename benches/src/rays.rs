//! Rays that every tree is asked: through a picture's pixels, and from what they hit to a light.

use crate::{Mesh, Tracer};
use backend::QueryKind;
use fastrand::Rng;
use geom::{Camera, Hit, Point, Ray};
use glam::Vec3;
use std::f32::consts::TAU;

/// The part of the way to the light that a shadow ray skips, so as not to meet what it left.
const SKIP: f32 = 1e-3;

/// A camera of so many pixels that has all of `mesh` at its start in view, from above one corner.
///
/// # Panics
/// If the mesh is a single point.
#[must_use]
pub fn camera(mesh: &Mesh, size: [u32; 2]) -> Camera {
    let (centre, radius) = mesh.sphere();
    let eye = centre + radius * Vec3::new(0.9, 0.8, 1.6);
    let camera = Camera::look_at(eye.into(), centre.into(), [0.0, 1.0, 0.0], 40.0, size);
    camera.expect("a mesh has some extent")
}

/// Where a light stands high above the mesh.
#[must_use]
pub fn light(mesh: &Mesh) -> Point {
    let (centre, radius) = mesh.sphere();
    (centre + radius * Vec3::new(-1.0, 3.0, 0.7)).into()
}

/// A ray over `(0, 1)` from nearly each hit of `primary` up to [`light`].
#[must_use]
pub fn shadow_rays(mesh: &Mesh, primary: &[Ray], tracer: &mut Tracer) -> Vec<Ray> {
    let light = Vec3::from(light(mesh));
    from_hits(primary, tracer, |ray, hit| {
        let point = Vec3::from(ray.origin) + hit.t * Vec3::from(ray.direction);
        let origin = point + SKIP * (light - point);
        Ray {
            t_max: 1.0,
            ..Ray::new(origin.into(), (light - origin).into())
        }
    })
}

/// A ray in a random direction from each hit of `primary`, likelier the closer to the normal (Lambert).
#[must_use]
pub fn diffuse_rays(mesh: &Mesh, primary: &[Ray], tracer: &mut Tracer) -> Vec<Ray> {
    let (triangles, mut random) = (mesh.triangles(mesh.start()), random());
    from_hits(primary, tracer, |ray, hit| {
        let [a, b, c] = triangles[hit.triangle as usize].map(Vec3::from);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let (from, along) = (Vec3::from(ray.origin), Vec3::from(ray.direction));
        let side = if normal.dot(along) > 0.0 { -1.0 } else { 1.0 };
        let start = from + (hit.t * (1.0 - SKIP)) * along;
        let direction = normal * side * 1.000_1 + direction(&mut random);
        Ray::new(start.into(), direction.into())
    })
}

fn from_hits(
    primary: &[Ray],
    tracer: &mut Tracer,
    mut next: impl FnMut(&Ray, &Hit) -> Ray,
) -> Vec<Ray> {
    let hits = tracer.list(primary, QueryKind::Closest);
    let rays = primary.iter().zip(&hits.closest);
    let rays = rays.filter(|(_, hit)| hit.is_hit());
    rays.map(|(ray, hit)| next(ray, hit)).collect()
}

/// A camera's rays in blocks of so many columns and rows of pixels.
#[must_use]
pub fn blocks(camera: &Camera, [columns, rows]: [u32; 2]) -> Vec<Ray> {
    let across = || (0..camera.width).step_by(columns as usize);
    let down = (0..camera.height).step_by(rows as usize);
    let corners = down.flat_map(|y| across().map(move |x| [x, y]));
    let all = corners
        .flat_map(|[x, y]| (0..columns * rows).map(move |i| [x + i % columns, y + i / columns]));
    let within = all.filter(|[x, y]| *x < camera.width && *y < camera.height);
    within.map(|[x, y]| camera.ray(x, y)).collect()
}

/// So many rays from anywhere on the sphere round the mesh at its start to anywhere else on it, always the same ones.
#[must_use]
pub fn random_rays(mesh: &Mesh, count: usize) -> Vec<Ray> {
    let ((centre, radius), mut random) = (mesh.sphere(), random());
    let mut ray = || {
        let [from, to] = [(); 2].map(|()| radius * direction(&mut random));
        Ray::new((centre + from).into(), (to - from).into())
    };
    (0..count).map(|_| ray()).collect()
}

/// Numbers at random, always the same ones.
#[must_use]
pub fn random() -> Rng {
    Rng::with_seed(1)
}

/// Any, of length 1.
fn direction(random: &mut Rng) -> Vec3 {
    let (z, angle) = (2.0 * random.f32() - 1.0, TAU * random.f32());
    let (across, (y, x)) = ((1.0 - z * z).sqrt(), angle.sin_cos());
    Vec3::new(across * x, across * y, z)
}
