// Rays through the driver's own tree: the stages of a ray-tracing pipeline.
//
// The crate `wesl` does not know the address spaces of payloads and some stage inputs. Attributes are placeholders for them,
// which the build replaces (build/rays.rs).

import package::geometry::queries::{is_invalid_ray, pixel_direction};
import package::geometry::shadow_ray::shadow_segment_of_hit;
import package::geometry::units::{is_finite_point, scale_bits, scaled_point, snapped3};
import package::lib::buffers::{hits, occluded, rays};
import package::lib::params::params;

@group(0) @binding(next) var scene: acceleration_structure;

// Result of a ray. Shadow rays and any-hit rays run no closest-hit shader, so `triangle` keeps its value unless the ray misses.
struct Payload { t: f32, u: f32, v: f32, triangle: u32 }

const NOTHING: u32 = 0xffffffffu;

@payload
var<private> found: Payload;
@incoming
var<private> incoming: Payload;
// The build turns this into the hit attributes of the driver.
var<private> barycentrics: vec2<f32>;

@closest_hit @incoming_payload(incoming)
fn closest_hit(@builtin(primitive_index) triangle: u32, @ray_t_current_max t: f32) {
    let weights = barycentrics;
    incoming = Payload(t, weights.x, weights.y, triangle);
}

@miss @incoming_payload(incoming)
fn miss() {
    incoming.triangle = NOTHING;
}

fn find_driver_closest(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32) {
    traceRay(scene, RayDesc(RAY_FLAG_FORCE_OPAQUE, 0xffu, t_min, t_max, origin, direction), &found);
}

fn finds_any(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32) -> bool {
    found.triangle = 0u;
    let flags = RAY_FLAG_FORCE_OPAQUE | RAY_FLAG_TERMINATE_ON_FIRST_HIT | RAY_FLAG_SKIP_CLOSEST_HIT_SHADER;
    traceRay(scene, RayDesc(flags, 0xffu, t_min, t_max, origin, direction), &found);
    return found.triangle != NOTHING;
}

fn as_hit() -> vec4<u32> {
    if found.triangle == NOTHING { return vec4<u32>(0x7f800000u, 0u, 0u, NOTHING); }
    return vec4<u32>(bitcast<u32>(found.t), bitcast<u32>(found.u), bitcast<u32>(found.v), found.triangle);
}

fn unscaled(v: vec3<f32>) -> vec3<f32> {
    if params.scale_exponent == 0 { return v; }
    let bits = bitcast<vec3<u32>>(v);
    let k = params.scale_exponent;
    return vec3<f32>(scale_bits(bits.x, k), scale_bits(bits.y, k), scale_bits(bits.z, k));
}

// Returns 1 if the hit is in shadow. `eye` is the start of the ray that hit, in scene units, as bits.
fn shade(hit: vec4<u32>, eye: vec3<u32>) -> u32 {
    if hit.w == NOTHING { return 0u; }
    let ray = shadow_segment_of_hit(hit, scaled_point(eye));
    if !ray.is_traced { return 0u; }
    return select(0u, 1u, finds_any(unscaled(snapped3(ray.origin)), unscaled(ray.direction), 0.0, 1.0));
}

fn meet_pixel(pixel: vec2<u32>) -> vec4<u32> {
    let direction = pixel_direction(pixel);
    found.triangle = NOTHING;
    if any(direction != vec3<f32>(0.0)) && is_finite_point(direction) && is_finite_point(params.eye) {
        find_driver_closest(params.eye, direction, 0.0, bitcast<f32>(0x7f7fffffu));
    }
    return as_hit();
}

@ray_generation
fn camera_closest(@ray_invocation_id id: vec3<u32>) {
    hits[id.y * params.width + id.x] = meet_pixel(id.xy);
}

@ray_generation
fn camera_shadow(@ray_invocation_id id: vec3<u32>) {
    let i = id.y * params.width + id.x;
    let hit = meet_pixel(id.xy);
    hits[i] = hit;
    occluded[i] = shade(hit, bitcast<vec3<u32>>(params.eye));
}

struct Given { origin: vec3<f32>, t_min: f32, direction: vec3<f32>, t_max: f32, is_traced: bool }

// Invalid rays are not traced. Drivers do not trace behind a ray's origin.
fn given(i: u32) -> Given {
    let first = rays[2u * i];
    let second = rays[2u * i + 1u];
    let a = bitcast<vec4<f32>>(first);
    let b = bitcast<vec4<f32>>(second);
    let t_min = max(a.w, 0.0);
    return Given(a.xyz, t_min, b.xyz, b.w, !is_invalid_ray(first, second) && t_min < b.w);
}

fn meet_given(i: u32) -> vec4<u32> {
    let ray = given(i);
    found.triangle = NOTHING;
    if ray.is_traced { find_driver_closest(ray.origin, ray.direction, ray.t_min, ray.t_max); }
    return as_hit();
}

fn given_number(id: vec3<u32>, size: vec3<u32>) -> u32 { return id.y * size.x + id.x; }

@ray_generation
fn given_closest(@ray_invocation_id id: vec3<u32>, @num_ray_invocations size: vec3<u32>) {
    let i = given_number(id, size);
    if i < params.count { hits[i] = meet_given(i); }
}

@ray_generation
fn given_shadow(@ray_invocation_id id: vec3<u32>, @num_ray_invocations size: vec3<u32>) {
    let i = given_number(id, size);
    if i >= params.count { return; }
    let hit = meet_given(i);
    hits[i] = hit;
    occluded[i] = shade(hit, rays[2u * i].xyz);
}

@ray_generation
fn given_any(@ray_invocation_id id: vec3<u32>, @num_ray_invocations size: vec3<u32>) {
    let i = given_number(id, size);
    if i >= params.count { return; }
    let ray = given(i);
    var is_hit = 0u;
    if ray.is_traced { is_hit = select(0u, 1u, finds_any(ray.origin, ray.direction, ray.t_min, ray.t_max)); }
    occluded[i] = is_hit;
}
