// Rasterization, last step: hits and shadows from the visibility buffer.

import package::geometry::layout::NO_LEAF;
import package::geometry::light::{from_triangle, is_occluded, scaled};
import package::geometry::queries::{camera_ray, eye, is_void_way, pixel_of, through_pixel};
import package::geometry::ray::{MISS, Prepared, permute, root_from};
import package::geometry::units::in_ray_units;
import package::intersect::intersector::store_occluded;
import package::intersect::sheared::{Turned, crossing, edges_of, turned_corners};
import package::intersect::watertight::distance_to;
import package::lib::buffers::{counts, hits, triangles};
import package::lib::ieee::{divide_by, divisor};
import package::lib::params::params;
import package::traversal::traverse::find_closest;

@group(0) @binding(next) var<storage, read> visibility: array<vec2<u32>>;

// Writes each pixel's hit from the visibility buffer, and traces its shadow ray: see docs/design/visibility-buffer.md. If the
// buffer is incomplete, each ray traverses the tree, as in `trace_and_shadow_camera`.
const NOT_SEEN: vec2<u32> = vec2<u32>(0xffffffffu);

fn write_miss(i: u32) {
    hits[i] = MISS;
    store_occluded(i, false, 3u);
}

// Traverses the tree. Returns the result in the format of the visibility buffer.
fn search(i: u32, ray: Prepared) -> vec2<u32> {
    let found = find_closest(ray);
    if found.leaf == NO_LEAF { return NOT_SEEN; }
    let corners = turned_corners(ray, found.leaf);
    return vec2<u32>(corners.triangle, bitcast<u32>(distance_to(ray, corners, edges_of(ray, corners))));
}

fn turn(ray: Prepared, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, triangle: u32) -> Turned {
    let p = permute(a, ray.axis);
    let q = permute(b, ray.axis);
    let r = permute(c, ray.axis);
    return Turned(vec3<f32>(p.x, q.x, r.x), vec3<f32>(p.y, q.y, r.y), vec3<f32>(p.z, q.z, r.z), triangle);
}

// Returns the same as `hit_of`, for a triangle that is hit at a known t.
fn hit_at(ray: Prepared, corners: Turned, t: u32) -> vec4<u32> {
    let c = crossing(edges_of(ray, corners));
    let by = divisor(c.det);
    let weights = vec2<f32>(divide_by(c.v, by), divide_by(c.w, by));
    return vec4<u32>(in_ray_units(bitcast<f32>(t), ray.exponent), bitcast<vec2<u32>>(weights), corners.triangle);
}

// Variants: intersector(watertight), layout(fast), arithmetic.
@compute @workgroup_size(128)
fn resolve(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>) {
    let pixel = pixel_of(local, group);
    if pixel.x >= params.width || pixel.y >= params.height { return; }
    let i = pixel.y * params.width + pixel.x;
    var seen = visibility[i];
    let tells = visibility[params.width * params.height].y == NOT_SEEN.y;
    let direction = through_pixel(pixel);
    let origin = eye();
    if (tells && seen.y == NOT_SEEN.y) || is_void_way(direction, origin) {
        write_miss(i);
        return;
    }
    let ray = camera_ray(direction, origin, root_from(origin));
    if !tells { seen = search(i, ray); }
    if seen.y == NOT_SEEN.y {
        write_miss(i);
        return;
    }
    atomicAdd(&counts[2], 1u);
    let triangle = seen.x;
    let a = scaled(triangles[3u * triangle]);
    let b = scaled(triangles[3u * triangle + 1u]);
    let c = scaled(triangles[3u * triangle + 2u]);
    let hit = hit_at(ray, turn(ray, a, b, c, triangle), seen.y);
    hits[i] = hit;
    store_occluded(i, is_occluded(from_triangle(a, b, c, hit, origin), triangle), 3u);
}
