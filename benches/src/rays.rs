//! Rays that every tree traces: through the pixels of an image, from hits to a light, and in random directions.

use crate::{Mesh, Tracer};
use backend::QueryKind;
use geom::{Camera, CameraPose, Hit, Point, Ray};
use glam::Vec3;

/// Fraction of the distance to the light that a shadow ray skips, so that it misses the surface it starts from.
const SKIP: f32 = 1e-3;

/// Returns a camera of `size` pixels that sees all of `mesh` at its start, from above one corner.
pub fn camera(mesh: &Mesh, size: [u32; 2]) -> Camera {
    let (centre, radius) = sphere(mesh);
    let eye = centre + radius * Vec3::new(0.9, 0.8, 1.6);
    let camera = Camera::look_at(CameraPose::new(eye.into(), centre.into()), size);
    camera.expect("a mesh has some extent")
}

/// Returns a ray over `(0, 1)` from near each hit of `primary` to [`light`].
pub fn shadow_rays(mesh: &Mesh, primary: &[Ray], tracer: &mut Tracer) -> Vec<Ray> {
    let light = light(mesh);
    from_hits(primary, tracer, |ray, hit| to_light(ray, hit.t, light))
}

/// Returns a ray in a random direction from each hit of `primary`, with the cosine distribution of a Lambertian
/// surface.
pub fn diffuse_rays(mesh: &Mesh, primary: &[Ray], tracer: &mut Tracer) -> Vec<Ray> {
    let (triangles, mut next) = (mesh.triangles(mesh.start()), random_numbers());
    from_hits(primary, tracer, |ray, hit| {
        let [a, b, c] = triangles[hit.triangle as usize].map(Vec3::from);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let (from, along) = (Vec3::from(ray.origin), Vec3::from(ray.direction));
        let up = if normal.dot(along) > 0.0 {
            -normal
        } else {
            normal
        };
        let start = from + (hit.t * (1.0 - SKIP)) * along;
        Ray::new(start.into(), (up * 1.000_1 + on_sphere(&mut next)).into())
    })
}

fn from_hits(
    primary: &[Ray],
    tracer: &mut Tracer,
    mut next: impl FnMut(&Ray, &Hit) -> Ray,
) -> Vec<Ray> {
    let hits = tracer.list(primary, QueryKind::Closest);
    let rays = primary.iter().zip(&hits.closest);
    rays.filter(|(_, hit)| hit.is_hit())
        .map(|(ray, hit)| next(ray, hit))
        .collect()
}

/// Returns a camera's rays in blocks of `columns` by `rows` pixels.
pub fn blocks(camera: &Camera, [columns, rows]: [u32; 2]) -> Vec<Ray> {
    let across = || (0..camera.width).step_by(columns as usize);
    let down = (0..camera.height).step_by(rows as usize);
    let corners = down.flat_map(|y| across().map(move |x| [x, y]));
    let block =
        |[x, y]: [u32; 2]| (0..columns * rows).map(move |i| [x + i % columns, y + i / columns]);
    let within = corners
        .flat_map(block)
        .filter(|[x, y]| *x < camera.width && *y < camera.height);
    within.map(|[x, y]| camera.ray(x, y)).collect()
}

/// Returns a generator of numbers in `[0, 1)`, with a fixed seed.
pub fn random_numbers() -> impl FnMut() -> f32 {
    let mut state = 1_u64;
    move || {
        // Knuth's generator. Its upper bits are good enough.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    }
}

/// Returns the position of a light high above the mesh.
pub fn light(mesh: &Mesh) -> Point {
    let (centre, radius) = sphere(mesh);
    (centre + radius * Vec3::new(-1.0, 3.0, 0.7)).into()
}

/// Returns `count` rays between random points on the bounding sphere of the mesh at its start, from a fixed seed.
pub fn random_rays(mesh: &Mesh, count: usize) -> Vec<Ray> {
    let (centre, radius) = sphere(mesh);
    let mut next = random_numbers();
    let mut ray = |_| {
        let [from, to] = [(); 2].map(|()| centre + radius * on_sphere(&mut next));
        Ray::new(from.into(), (to - from).into())
    };
    (0..count).map(&mut ray).collect()
}

/// Returns a random point on the unit sphere.
fn on_sphere(next: &mut impl FnMut() -> f32) -> Vec3 {
    let (z, angle) = (2.0 * next() - 1.0, std::f32::consts::TAU * next());
    let (across, (y, x)) = ((1.0 - z * z).sqrt(), angle.sin_cos());
    Vec3::new(across * x, across * y, z)
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
