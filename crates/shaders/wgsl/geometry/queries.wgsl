// The rays of a query: camera rays, one per pixel, or explicit rays.

import package::geometry::ray::{MAX_DISTANCE, PreparedRay, RelativeRoot, prepare_ray, root_relative_to};
import package::geometry::units::{is_extreme, is_finite_point, ordered, scaled_point};
import package::intersect::intersector::DEFERS_EXTREME_RAYS;
import package::intersect::line::set_line;
import package::lib::buffers::{counts, rays};
import package::lib::counters::FOUND_EXTREME;
import package::lib::ieee::{add, mul};
import package::lib::params::params;

// Maps an invocation to a pixel: 128 invocations cover a block of 16 x 8 pixels in Morton order.
fn pixel_of(local: u32, group: vec3<u32>) -> vec2<u32> {
    let x = (local & 1u) | ((local >> 1u) & 2u) | ((local >> 2u) & 4u) | ((local >> 3u) & 8u);
    let y = ((local >> 1u) & 1u) | ((local >> 2u) & 2u) | ((local >> 3u) & 4u);
    return vec2<u32>(group.x * 16u + x, group.y * 8u + y);
}

// Camera rays: geom::Camera::ray.

fn camera_coordinate(corner: f32, across: f32, down: f32, x: f32, y: f32) -> f32 {
    return add(add(corner, mul(x, across)), mul(y, down));
}

// Returns the direction through the middle of a pixel.
fn pixel_direction(pixel: vec2<u32>) -> vec3<f32> {
    let x = add(f32(pixel.x), 0.5);
    let y = add(f32(pixel.y), 0.5);
    return vec3<f32>(
        camera_coordinate(params.corner.x, params.across.x, params.down.x, x, y),
        camera_coordinate(params.corner.y, params.across.y, params.down.y, x, y),
        camera_coordinate(params.corner.z, params.across.z, params.down.z, x, y),
    );
}

// Returns the origin of camera rays, in scaled units.
fn eye() -> vec3<f32> { return params.scaled_eye; }

fn camera_ray(direction: vec3<f32>, origin: vec3<f32>, root: RelativeRoot) -> PreparedRay {
    return prepare_ray(origin, bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, root);
}

// Returns whether a ray's line certainly misses the root box, before the ray is prepared: see "Rays that miss the root box" in
// docs/design/hits.md.
fn surely_misses_root(direction: vec3<f32>, root: RelativeRoot) -> bool {
    let center = (root.low + root.high) * 0.5;
    // 2^-16 * D and 2^-60.
    let half_extent = (root.high - root.low) * 0.5 + vec3<f32>(1.52587890625e-5 * root.max_distance + 8.673617379884035e-19);
    let magnitudes = abs(direction);
    let separation = abs(direction.yzx * center.zxy - direction.zxy * center.yzx);
    // 2^-100 exceeds any value that a device flushes.
    let radius = magnitudes.yzx * half_extent.zxy + magnitudes.zxy * half_extent.yzx + vec3<f32>(7.888609052210118e-31);
    // An axis whose products overflow is inconclusive.
    let is_finite_axis = separation < vec3<f32>(3.0e38);
    return any(is_finite_axis & (separation > radius)) && root.max_distance < MAX_DISTANCE;
}

// Returns whether a pixel's ray certainly hits nothing.
fn misses_scene(direction: vec3<f32>, origin: vec3<f32>, root: RelativeRoot) -> bool {
    return is_untraceable(direction, origin) || surely_misses_root(direction, root);
}

fn is_untraceable(direction: vec3<f32>, origin: vec3<f32>) -> bool {
    let is_zero = all((bitcast<vec3<u32>>(direction) & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u));
    return is_zero || !is_finite_point(direction) || !is_finite_point(origin);
}

// Explicit rays, two rows each: origin and t_min, direction and t_max.

fn explicit_ray(i: u32) -> PreparedRay {
    let a = rays[2u * i];
    let b = rays[2u * i + 1u];
    let origin = scaled_point(a.xyz);
    return prepare_ray(origin, b.xyz, a.w, b.w, root_relative_to(origin));
}

// Returns whether a ray's rows are invalid, so that it hits nothing: the opposite of geom::Ray::is_valid.
fn is_invalid_ray(first: vec4<u32>, second: vec4<u32>) -> bool {
    let magnitudes = vec2<u32>(first.w, second.w) & vec2<u32>(0x7fffffffu);
    let is_interval = all(magnitudes <= vec2<u32>(0x7f800000u)) && ordered(first.w) < ordered(second.w);
    return is_untraceable(bitcast<vec3<f32>>(second.xyz), bitcast<vec3<f32>>(first.xyz)) || !is_interval;
}

// Returns whether this kernel treats explicit ray `i` as a miss, because it is invalid or because `extreme_*` traces
// it. The textbook intersectors trace extreme rays too, except those whose origin overflows in scaled units.
fn is_skipped(i: u32) -> bool {
    let first = rays[2u * i];
    if is_invalid_ray(first, rays[2u * i + 1u]) { return true; }
    let origin = scaled_point(first.xyz);
    if !DEFERS_EXTREME_RAYS { return !is_finite_point(origin); }
    let is_deferred = is_extreme(origin);
    if is_deferred { atomicStore(&counts[FOUND_EXTREME], 1u); }
    return is_deferred;
}

// Rays by index, for kernels that resolve undecided or extreme rays: a camera's, or explicit ones if `params.width` is 0.

fn direction_of_ray(i: u32) -> vec3<f32> { return pixel_direction(vec2<u32>(i % params.width, i / params.width)); }

// A ray of the query: its two rows, and its origin in scaled units.
struct QueryRay { first: vec4<u32>, second: vec4<u32>, origin: vec3<f32> }

fn camera_query_ray(i: u32) -> QueryRay {
    let first = vec4<u32>(bitcast<vec3<u32>>(params.eye), 0u);
    return QueryRay(first, vec4<u32>(bitcast<vec3<u32>>(direction_of_ray(i)), 0x7f800000u), eye());
}

@if(resolve_exact_camera || fallback_camera)
fn query_ray(i: u32) -> QueryRay { return camera_query_ray(i); }
@else
fn query_ray(i: u32) -> QueryRay {
    if params.width > 0u { return camera_query_ray(i); }
    let first = rays[2u * i];
    return QueryRay(first, rays[2u * i + 1u], scaled_point(first.xyz));
}

fn prepared_query_ray(i: u32) -> PreparedRay {
    let ray = query_ray(i);
    return prepare_ray(ray.origin, ray.second.xyz, ray.first.w, ray.second.w, root_relative_to(ray.origin));
}

// Sets the exact line of ray `i`.
fn set_line_of_query(i: u32) {
    let ray = query_ray(i);
    set_line(ray.first.xyz, ray.second.xyz, ray.first.w, ray.second.w, 0);
}
