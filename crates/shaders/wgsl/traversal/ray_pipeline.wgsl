// Rays through the driver's own tree: the stages of a ray-tracing pipeline.

import package::geometry::queries::{is_invalid_ray, pixel_direction};
import package::geometry::ray::MISS;
import package::geometry::record::NO_TRIANGLE;
import package::geometry::shadow_ray::shadow_segment_of_hit;
import package::geometry::units::{is_finite_point, scale_point, scaled_point, snapped3};
import package::lib::buffers::{hits, occluded, rays};
import package::lib::params::params;

@group(0) @binding(next) var scene: acceleration_structure;

// Result of a ray. Shadow rays run no closest-hit shader, so `triangle` keeps its value unless the ray misses.
struct Payload { t: f32, u: f32, v: f32, triangle: u32 }

var<ray_payload> payload: Payload;
var<incoming_ray_payload> incoming: Payload;
// The build turns this into the hit attributes of the driver.
var<private> barycentrics: vec2<f32>;

@closest_hit @incoming_payload(incoming)
fn closest_hit(@builtin(primitive_index) triangle: u32, @builtin(ray_t_current_max) t: f32) {
    let weights = barycentrics;
    incoming = Payload(t, weights.x, weights.y, triangle);
}

@miss @incoming_payload(incoming)
fn miss() {
    incoming.triangle = NO_TRIANGLE;
}

fn driver_trace_closest(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32) {
    traceRay(scene, RayDesc(RAY_FLAG_FORCE_OPAQUE, 0xffu, t_min, t_max, origin, direction), &payload);
}

fn driver_trace_any(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32) -> bool {
    payload.triangle = 0u;
    let flags = RAY_FLAG_FORCE_OPAQUE | RAY_FLAG_TERMINATE_ON_FIRST_HIT | RAY_FLAG_SKIP_CLOSEST_HIT_SHADER;
    traceRay(scene, RayDesc(flags, 0xffu, t_min, t_max, origin, direction), &payload);
    return payload.triangle != NO_TRIANGLE;
}

fn hit_of_payload() -> vec4<u32> {
    if payload.triangle == NO_TRIANGLE { return MISS; }
    return vec4<u32>(bitcast<u32>(payload.t), bitcast<u32>(payload.u), bitcast<u32>(payload.v), payload.triangle);
}

fn unscaled(v: vec3<f32>) -> vec3<f32> {
    if params.scale_exponent == 0 { return v; }
    return scale_point(bitcast<vec3<u32>>(v), params.scale_exponent);
}

// Returns 1 if the hit is in shadow. `origin` is the start of the ray that hit, in scene units, as bits.
fn trace_shadow(hit: vec4<u32>, origin: vec3<u32>) -> u32 {
    if hit.w == NO_TRIANGLE { return 0u; }
    let ray = shadow_segment_of_hit(hit, scaled_point(origin));
    if !ray.is_traced { return 0u; }
    return select(0u, 1u, driver_trace_any(unscaled(snapped3(ray.origin)), unscaled(ray.direction), 0.0, 1.0));
}

fn trace_pixel(pixel: vec2<u32>) -> vec4<u32> {
    let direction = pixel_direction(pixel);
    payload.triangle = NO_TRIANGLE;
    if any(direction != vec3<f32>(0.0)) && is_finite_point(direction) && is_finite_point(params.eye) {
        driver_trace_closest(params.eye, direction, 0.0, bitcast<f32>(0x7f7fffffu));
    }
    return hit_of_payload();
}

@ray_generation
fn camera_closest(@builtin(ray_invocation_id) id: vec3<u32>) {
    hits[id.y * params.width + id.x] = trace_pixel(id.xy);
}

@ray_generation
fn camera_shadow(@builtin(ray_invocation_id) id: vec3<u32>) {
    let i = id.y * params.width + id.x;
    let hit = trace_pixel(id.xy);
    hits[i] = hit;
    occluded[i] = trace_shadow(hit, bitcast<vec3<u32>>(params.eye));
}

struct ExplicitRay { origin: vec3<f32>, t_min: f32, direction: vec3<f32>, t_max: f32, is_traced: bool }

// Invalid rays are not traced. A negative t_min becomes 0, because drivers do not trace behind a ray's origin.
fn load_ray(i: u32) -> ExplicitRay {
    let first = rays[2u * i];
    let second = rays[2u * i + 1u];
    let a = bitcast<vec4<f32>>(first);
    let b = bitcast<vec4<f32>>(second);
    let t_min = max(a.w, 0.0);
    return ExplicitRay(a.xyz, t_min, b.xyz, b.w, !is_invalid_ray(first, second) && t_min < b.w);
}

fn trace_explicit(i: u32) -> vec4<u32> {
    let ray = load_ray(i);
    payload.triangle = NO_TRIANGLE;
    if ray.is_traced { driver_trace_closest(ray.origin, ray.direction, ray.t_min, ray.t_max); }
    return hit_of_payload();
}

fn ray_index(id: vec3<u32>, size: vec3<u32>) -> u32 { return id.y * size.x + id.x; }

@ray_generation
fn explicit_closest(@builtin(ray_invocation_id) id: vec3<u32>, @builtin(num_ray_invocations) size: vec3<u32>) {
    let i = ray_index(id, size);
    if i < params.count { hits[i] = trace_explicit(i); }
}

@ray_generation
fn explicit_shadow(@builtin(ray_invocation_id) id: vec3<u32>, @builtin(num_ray_invocations) size: vec3<u32>) {
    let i = ray_index(id, size);
    if i >= params.count { return; }
    let hit = trace_explicit(i);
    hits[i] = hit;
    occluded[i] = trace_shadow(hit, rays[2u * i].xyz);
}
