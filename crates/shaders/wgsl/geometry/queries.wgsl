// The rays of a query: a camera's, one per pixel, or explicit ones.

import package::geometry::ray::{FARTHEST, Prepared, Root, prepare, root_from};
import package::geometry::units::{is_extreme, is_finite_point, ordered, scaled_point};
import package::intersect::intersector::LEAVES_EXTREMES;
import package::intersect::line::set_line;
import package::lib::buffers::{counts, rays};
import package::lib::counters::LEFT_AT;
import package::lib::ieee::{add, mul};
import package::lib::params::params;

// Maps an invocation to a pixel: 128 invocations cover a block of 16 x 8 pixels in Morton order.
fn pixel_of(local: u32, group: vec3<u32>) -> vec2<u32> {
    let x = (local & 1u) | ((local >> 1u) & 2u) | ((local >> 2u) & 4u) | ((local >> 3u) & 8u);
    let y = ((local >> 1u) & 1u) | ((local >> 2u) & 2u) | ((local >> 3u) & 4u);
    return vec2<u32>(group.x * 16u + x, group.y * 8u + y);
}

// Camera rays: geom::Camera::ray.

fn along(corner: f32, across: f32, down: f32, x: f32, y: f32) -> f32 {
    return add(add(corner, mul(x, across)), mul(y, down));
}

// Returns the direction through the middle of a pixel.
fn through_pixel(pixel: vec2<u32>) -> vec3<f32> {
    let x = add(f32(pixel.x), 0.5);
    let y = add(f32(pixel.y), 0.5);
    return vec3<f32>(
        along(params.corner.x, params.across.x, params.down.x, x, y),
        along(params.corner.y, params.across.y, params.down.y, x, y),
        along(params.corner.z, params.across.z, params.down.z, x, y),
    );
}

// Returns the origin of camera rays, in scaled units.
fn eye() -> vec3<f32> { return params.scaled_eye; }

// Prepares a camera ray.
fn camera_ray(direction: vec3<f32>, origin: vec3<f32>, root: Root) -> Prepared {
    return prepare(origin, bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, root);
}

// Returns whether a ray's line surely misses the root box, before the ray is prepared: see "Rays that miss the root box" in
// docs/design/hits.md.
fn passes_by(d: vec3<f32>, root: Root) -> bool {
    let c = (root.low + root.high) * 0.5;
    // 2^-16 * D and 2^-60.
    let h = (root.high - root.low) * 0.5 + vec3<f32>(1.52587890625e-5 * root.reach + 8.673617379884035e-19);
    let size = abs(d);
    let apart = abs(d.yzx * c.zxy - d.zxy * c.yzx);
    // 2^-100 exceeds any value that a device flushes.
    let near = size.yzx * h.zxy + size.zxy * h.yzx + vec3<f32>(7.888609052210118e-31);
    // Products that overflow decide nothing.
    let tells = apart < vec3<f32>(3.0e38);
    return any(tells & (apart > near)) && root.reach < FARTHEST;
}

// Returns whether a pixel's ray surely hits nothing.
fn misses_root(direction: vec3<f32>, origin: vec3<f32>, root: Root) -> bool {
    return is_void_way(direction, origin) || passes_by(direction, root);
}

fn is_void_way(direction: vec3<f32>, origin: vec3<f32>) -> bool {
    let is_zero = all((bitcast<vec3<u32>>(direction) & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u));
    return is_zero || !is_finite_point(direction) || !is_finite_point(origin);
}

// Explicit rays, two rows each: origin and t_min, direction and t_max.

fn given_ray(i: u32) -> Prepared {
    let a = rays[2u * i];
    let b = rays[2u * i + 1u];
    let origin = scaled_point(a.xyz);
    return prepare(origin, b.xyz, a.w, b.w, root_from(origin));
}

// Returns whether a ray's rows are invalid, so that it hits nothing: the opposite of geom::Ray::is_valid.
fn is_void_ray(first: vec4<u32>, second: vec4<u32>) -> bool {
    let sizes = vec2<u32>(first.w, second.w) & vec2<u32>(0x7fffffffu);
    let is_interval = all(sizes <= vec2<u32>(0x7f800000u)) && ordered(first.w) < ordered(second.w);
    return is_void_way(bitcast<vec3<f32>>(second.xyz), bitcast<vec3<f32>>(first.xyz)) || !is_interval;
}

// Returns whether ray `i` misses here: it is invalid, or left to `extreme_*`. An origin may also be too far for the scene's scale.
fn is_void(i: u32) -> bool {
    let first = rays[2u * i];
    if is_void_ray(first, rays[2u * i + 1u]) { return true; }
    let origin = scaled_point(first.xyz);
    if !LEAVES_EXTREMES { return !is_finite_point(origin); }
    let is_left = is_extreme(origin);
    if is_left { atomicStore(&counts[LEFT_AT], 1u); }
    return is_left;
}

// Rays by index, for kernels that resolve what others left open: a camera's, or explicit ones if there is no picture.

fn way_through(i: u32) -> vec3<f32> { return through_pixel(vec2<u32>(i % params.width, i / params.width)); }

// The rows of a ray, and its origin in scaled units.
struct Asked { first: vec4<u32>, second: vec4<u32>, origin: vec3<f32> }

fn asked_of_pixel(i: u32) -> Asked {
    let first = vec4<u32>(bitcast<vec3<u32>>(params.eye), 0u);
    return Asked(first, vec4<u32>(bitcast<vec3<u32>>(way_through(i)), 0x7f800000u), eye());
}

@if(resolve_exact_together || shadow_left)
fn asked(i: u32) -> Asked { return asked_of_pixel(i); }
@else
fn asked(i: u32) -> Asked {
    if params.width > 0u { return asked_of_pixel(i); }
    let first = rays[2u * i];
    return Asked(first, rays[2u * i + 1u], scaled_point(first.xyz));
}

// Returns t_min and t_max.
fn limits_of(i: u32) -> vec2<u32> {
    let ray = asked(i);
    return vec2<u32>(ray.first.w, ray.second.w);
}

fn ray_of(i: u32) -> Prepared {
    let ray = asked(i);
    return prepare(ray.origin, ray.second.xyz, ray.first.w, ray.second.w, root_from(ray.origin));
}

// Sets the exact line of ray `i`.
fn set_line_of(i: u32) {
    let ray = asked(i);
    set_line(ray.first.xyz, ray.second.xyz, ray.first.w, ray.second.w, 0);
}
