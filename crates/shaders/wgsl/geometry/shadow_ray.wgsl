// Shadow rays: the ray from a hit to the light, and whether it is occluded.

import package::geometry::ray::{PreparedRay, prepare_scaled_ray, root_relative_to};
import package::geometry::record::corners_of;
import package::geometry::triangle::point_of;
import package::geometry::units::{flushed, is_finite_point, scaled_point, snapped3};
import package::intersect::intersector::{BestHit, trace_any};
import package::intersect::line::set_line;
import package::lib::buffers::{nodes, triangles};
import package::lib::double_float::sub_each;
import package::lib::ieee::{add, mul, sub};
import package::lib::params::params;

// The shadow ray: see "Shadow rays" in docs/design/hits.md.

fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return add(add(flushed(mul(a.x, b.x)), flushed(mul(a.y, b.y))), flushed(mul(a.z, b.z)));
}

fn sign_of(x: f32) -> f32 {
    return select(0.0, 1.0, x > 0.0) - select(0.0, 1.0, x < 0.0);
}

fn offset_coordinate(p: f32, normal: f32, side: f32, delta: f32) -> f32 {
    return add(p, mul(mul(sign_of(normal), side), delta));
}

// A segment from near the hit to the light, over t in (0, 1). If `is_traced` is false, nothing can occlude it.
// Coordinates of the origin may be below 2^-64. Kernels in rounded arithmetic then replace them by zero; the exact line
// keeps them.
struct ShadowSegment { origin: vec3<f32>, direction: vec3<f32>, is_traced: bool }

// Computes the segment from the corners of the triangle that was hit, all in scaled units. `eye` is the origin of the ray.
fn shadow_segment(v0: vec3<f32>, v1: vec3<f32>, v2: vec3<f32>, hit: vec4<u32>, eye: vec3<f32>) -> ShadowSegment {
    let e1 = sub_each(v1, v0);
    let e2 = sub_each(v2, v0);
    let u = bitcast<f32>(hit.y);
    let v = bitcast<f32>(hit.z);
    var point = vec3<f32>(
        add(v0.x, add(mul(u, e1.x), mul(v, e2.x))),
        add(v0.y, add(mul(u, e1.y), mul(v, e2.y))),
        add(v0.z, add(mul(u, e1.z), mul(v, e2.z))),
    );
    point = snapped3(point);
    let normal = vec3<f32>(
        flushed(sub(mul(e1.y, e2.z), mul(e1.z, e2.y))),
        flushed(sub(mul(e1.z, e2.x), mul(e1.x, e2.z))),
        flushed(sub(mul(e1.x, e2.y), mul(e1.y, e2.x))),
    );
    let light = params.light;
    var side = sign_of(dot3(normal, sub_each(light, point)));
    if side == 0.0 { side = sign_of(dot3(normal, sub_each(eye, point))); }
    let scene_extent = sub_each(bitcast<vec3<f32>>(nodes[1].xyz), bitcast<vec3<f32>>(nodes[0].xyz));
    let largest_coordinate = max(abs(point.x), max(abs(point.y), abs(point.z)));
    let triangle_extent = max(abs(e1), abs(e2));
    // `params.clearance` limits the scene's extent. The triangle's own extent counts too. With the driver's own
    // tree, the root box is that of all key frames known at loading. A triangle in a later key frame may exceed it.
    let offset_extent = max(
        min(max(scene_extent.x, max(scene_extent.y, scene_extent.z)), params.clearance),
        max(triangle_extent.x, max(triangle_extent.y, triangle_extent.z)),
    );
    // 4 * 2^-24 and 32 * 2^-24
    let delta = add(mul(2.384185791015625e-7, largest_coordinate), mul(1.9073486328125e-6, offset_extent));
    point = vec3<f32>(
        offset_coordinate(point.x, normal.x, side, delta),
        offset_coordinate(point.y, normal.y, side, delta),
        offset_coordinate(point.z, normal.z, side, delta),
    );
    let direction = sub_each(light, point);
    let is_traced = any(direction != vec3<f32>(0.0)) && is_finite_point(direction) && is_finite_point(point);
    return ShadowSegment(point, direction, is_traced);
}

// The segment from a hit to the light, computed from the triangle's vertices.

fn scaled_vertex(vertex: u32) -> vec3<f32> { return scaled_point(point_of(vertex)); }

// Returns the segment in scaled units. `eye` is the origin of the ray that hit.
fn shadow_segment_of_hit(hit: vec4<u32>, eye: vec3<f32>) -> ShadowSegment {
    let v0 = scaled_vertex(triangles[3u * hit.w]);
    let v1 = scaled_vertex(triangles[3u * hit.w + 1u]);
    let v2 = scaled_vertex(triangles[3u * hit.w + 2u]);
    return shadow_segment(v0, v1, v2, hit, eye);
}

// Returns the segment from the best hit to the light, computed from the corners in the leaf's record.

@if(WATERTIGHT || EXACT)
fn shadow_segment_of_best(best: BestHit, hit: vec4<u32>, eye: vec3<f32>) -> ShadowSegment {
    let k = corners_of(best.leaf);
    return shadow_segment(k.a, k.b, k.c, hit, eye);
}

// Returns the segment from the best hit to the light, computed from the triangle's vertices.
@else
fn shadow_segment_of_best(best: BestHit, hit: vec4<u32>, eye: vec3<f32>) -> ShadowSegment {
    return shadow_segment_of_hit(hit, eye);
}

// Prepares the ray along a segment.

fn shadow_ray(segment: ShadowSegment) -> PreparedRay {
    let origin = snapped3(segment.origin);
    // Origin and direction are already in scaled units.
    return prepare_scaled_ray(origin, segment.direction, root_relative_to(origin));
}

// Sets the exact line of a segment. The segment is in scaled units, but corners are in scene units.
fn set_line_of_segment(segment: ShadowSegment) {
    set_line(bitcast<vec3<u32>>(segment.origin), bitcast<vec3<u32>>(segment.direction), 0u, 0x3f800000u, params.scale_exponent);
}

// Returns whether the segment from a hit to the light is occluded, except by triangle `ignore`.
fn is_occluded(segment: ShadowSegment, ignore: u32) -> bool {
    if !segment.is_traced { return false; }
    return trace_any(shadow_ray(segment), ignore);
}
