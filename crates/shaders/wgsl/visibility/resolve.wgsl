// Rasterization, last step: writes each pixel's hit from the visibility buffer, and traces its shadow ray. If the buffer is
// incomplete, each ray traverses the tree, as in `trace_and_shadow_camera`. See docs/design/visibility-buffer.md.

import package::geometry::node::NO_LEAF;
import package::geometry::shadow_ray::{is_occluded, scaled_vertex, shadow_segment};
import package::geometry::queries::{camera_ray, eye, is_untraceable, pixel_direction, pixel_of};
import package::geometry::ray::{PreparedRay, permute, root_relative_to};
import package::geometry::units::in_ray_units;
@if(WATERTIGHT)
import package::intersect::intersector::store_occluded;
@if(EXACT)
import package::intersect::filter::rounds_within;
@if(EXACT)
import package::intersect::intersector::{direction_of, hit_of, initial_best};
@if(MOLLER_TRUMBORE || WOOP)
import package::intersect::intersector::{has_hit, hit_of, initial_best, intersect_single, search_limit};
@if(EXACT)
import package::intersect::round_hit::{permuted_line, round_hit};
import package::intersect::sheared::{PermutedTriangle, edges_of, permuted_corners, undivided_hit};
import package::intersect::watertight::distance_to;
import package::lib::buffers::{counts, hits, triangles};
import package::lib::counters::{HIT_COUNT, OCCLUDED_COUNT};
import package::lib::ieee::{divide_by, divisor};
import package::lib::params::params;
import package::traversal::finish::{write_hit_and_shadow, write_miss};
import package::traversal::traverse::find_closest;
import package::visibility::cover::KEYS_PER_PIXEL;

@group(0) @binding(next) var<storage, read> visibility: array<vec2<u32>>;

// Key of a pixel whose ray hits nothing.
const NO_KEY: vec2<u32> = vec2<u32>(0xffffffffu);

fn permute_triangle(ray: PreparedRay, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, triangle: u32) -> PermutedTriangle {
    let p = permute(a, ray.axis);
    let q = permute(b, ray.axis);
    let r = permute(c, ray.axis);
    return PermutedTriangle(vec3<f32>(p.x, q.x, r.x), vec3<f32>(p.y, q.y, r.y), vec3<f32>(p.z, q.z, r.z), triangle);
}

// Returns the same as `hit_of`, for a triangle that is hit at a known t.
fn hit_at(ray: PreparedRay, corners: PermutedTriangle, t: u32) -> vec4<u32> {
    let undivided = undivided_hit(edges_of(ray, corners));
    let det_divisor = divisor(undivided.det);
    let weights = vec2<f32>(divide_by(undivided.v, det_divisor), divide_by(undivided.w, det_divisor));
    return vec4<u32>(in_ray_units(bitcast<f32>(t), ray.exponent), bitcast<vec2<u32>>(weights), corners.triangle);
}

// Traverses the tree. Returns the result in the format of the visibility buffer.
@if(WATERTIGHT)
fn traverse_to_key(i: u32, ray: PreparedRay) -> vec2<u32> {
    let best = find_closest(ray);
    if best.leaf == NO_LEAF { return NO_KEY; }
    let corners = permuted_corners(ray.axes, best.leaf);
    return vec2<u32>(corners.triangle, bitcast<u32>(distance_to(ray, corners, edges_of(ray, corners))));
}

// Writes the hit and the shadow of ray `i`.
@if(WATERTIGHT)
fn resolve_pixel(i: u32, ray: PreparedRay, is_complete: bool, origin: vec3<f32>) {
    var key = visibility[i];
    if !is_complete { key = traverse_to_key(i, ray); }
    if key.y == NO_KEY.y {
        write_miss(i);
        return;
    }
    atomicAdd(&counts[HIT_COUNT], 1u);
    let triangle = key.x;
    let a = scaled_vertex(triangles[3u * triangle]);
    let b = scaled_vertex(triangles[3u * triangle + 1u]);
    let c = scaled_vertex(triangles[3u * triangle + 2u]);
    let hit = hit_at(ray, permute_triangle(ray, a, b, c, triangle), key.y);
    hits[i] = hit;
    store_occluded(i, is_occluded(shadow_segment(a, b, c, hit, origin), triangle), OCCLUDED_COUNT);
}

// Writes the hit and the shadow of ray `i`. If the hit on the first key's leaf can be rounded and its t is less than
// the second key's, it is the first hit. Otherwise the ray traverses the tree.
@if(EXACT)
fn resolve_pixel(i: u32, ray: PreparedRay, is_complete: bool, origin: vec3<f32>) {
    var best = initial_best(ray);
    var hit = vec4<u32>(0u);
    var is_first = false;
    if is_complete {
        best.leaf = visibility[2u * i].x;
        let rounded = round_hit(permuted_line(ray, direction_of(i, ray)), best.leaf);
        hit = rounded.hit;
        is_first = rounded.is_rounded && rounds_within(ray, vec2<f32>(rounded.t))
            && bitcast<u32>(rounded.t) < visibility[2u * i + 1u].y;
    }
    if is_first {
        atomicAdd(&counts[HIT_COUNT], 1u);
    } else {
        best = find_closest(ray);
        hit = hit_of(i, ray, best);
    }
    write_hit_and_shadow(i, hit, best, origin);
}

// Writes the hit and the shadow of ray `i`. If the first key's leaf is hit and the hit's t is less than the second
// key's, it is the first hit. Otherwise the ray traverses the tree.
@if(MOLLER_TRUMBORE || WOOP)
fn resolve_pixel(i: u32, ray: PreparedRay, is_complete: bool, origin: vec3<f32>) {
    var best = initial_best(ray);
    var is_first = false;
    if is_complete {
        best = intersect_single(ray, visibility[2u * i].x);
        is_first = has_hit(best) && bitcast<u32>(search_limit(best)) < visibility[2u * i + 1u].y;
    }
    if !is_first { best = find_closest(ray); }
    write_hit_and_shadow(i, hit_of(i, ray, best), best, origin);
}

// Variants: intersector, arithmetic.
// Parameters: search.
@compute @workgroup_size(128)
fn resolve(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>) {
    let pixel = pixel_of(local, group);
    if pixel.x >= params.width || pixel.y >= params.height { return; }
    let i = pixel.y * params.width + pixel.x;
    let is_complete = visibility[KEYS_PER_PIXEL * params.width * params.height].y == NO_KEY.y;
    let direction = pixel_direction(pixel);
    let origin = eye();
    if (is_complete && visibility[KEYS_PER_PIXEL * i].y == NO_KEY.y) || is_untraceable(direction, origin) {
        write_miss(i);
        return;
    }
    resolve_pixel(i, camera_ray(direction, origin, root_relative_to(origin)), is_complete, origin);
}
