// Computes pixels from hits: face normals, a colour per triangle, one lamp with shadows, a sky. Module `shading` of
// crate `abvh` computes the same bits on the host; docs/design/pictures.md explains why they are equal.

import package::geometry::queries::pixel_direction;
import package::geometry::triangle::points_of;
import package::geometry::units::{exponent_of, flushed, scale_point, snapped3};
import package::lib::buffers::{hits, occluded};
import package::lib::double_float::{add_each, mul_each, sub_each};
import package::lib::ieee::{add, mul, sub};
import package::lib::params::params;

// sRGB colour of each triangle, one byte per channel.
@group(0) @binding(next) var<storage, read> colours: array<u32>;

// The linear light of each sRGB level as bits, then the sRGB level of each step of linear light.
@group(0) @binding(next) var<storage, read> tones: array<u32>;

// Four bytes per pixel: red, green, blue, 255.
@group(0) @binding(next) var<storage, read_write> pixels: array<u32>;

const ZENITH = vec3<f32>(0.130, 0.270, 0.560);
const HORIZON = vec3<f32>(0.640, 0.740, 0.830);
const HAZE = vec3<f32>(0.400, 0.455, 0.510);
const FROM_ABOVE = vec3<f32>(0.300, 0.355, 0.440);
const FROM_THE_SIDE = vec3<f32>(0.195, 0.215, 0.250);
const FROM_BELOW = vec3<f32>(0.105, 0.095, 0.085);
const LAMP = vec3<f32>(0.880, 0.800, 0.690);

// Number of steps of linear light up to 1, and the last step.
const STEPS: f32 = 4096.0;
const LAST_STEP: u32 = 5120u;

fn mix1(a: f32, b: f32, s: f32) -> f32 { return add(a, mul(sub(b, a), s)); }

fn mix3(a: vec3<f32>, b: vec3<f32>, s: f32) -> vec3<f32> {
    return vec3<f32>(mix1(a.x, b.x, s), mix1(a.y, b.y, s), mix1(a.z, b.z, s));
}

fn dot_product(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return add(add(mul(a.x, b.x), mul(a.y, b.y)), mul(a.z, b.z));
}

// Scales by a power of two so that the largest component is in [1, 2). Components below 2^-40 become zero. Returns zero if the
// largest is subnormal, at least 2^127, or NaN.
fn scaled_near_one(v: vec3<f32>) -> vec3<f32> {
    let sizes = bitcast<vec3<u32>>(v) & vec3<u32>(0x7fffffffu);
    let e = max(sizes.x, max(sizes.y, sizes.z)) >> 23u;
    if e == 0u || e >= 254u { return vec3<f32>(0.0); }
    let w = mul_each(v, vec3<f32>(bitcast<f32>((254u - e) << 23u)));
    return select(w, vec3<f32>(0.0), abs(w) < vec3<f32>(9.094947017729282e-13));
}

// Normalizes to length 1, within a few units in the last place. Returns zero where `scaled_near_one` does. Uses
// Newton's method from an integer guess of 1 / sqrt, because a device's square root need not be correctly rounded.
fn unit(v: vec3<f32>) -> vec3<f32> {
    let w = scaled_near_one(v);
    let square = dot_product(w, w);
    if square == 0.0 { return w; }
    let half_square = mul(0.5, square);
    var y = bitcast<f32>(0x5f375a86u - (bitcast<u32>(square) >> 1u));
    for (var i = 0u; i < 3u; i += 1u) { y = mul(y, sub(1.5, mul(half_square, mul(y, y)))); }
    return mul_each(w, vec3<f32>(y));
}

// Returns the sky along a direction of length 1.
fn sky(direction: vec3<f32>) -> vec3<f32> {
    if direction.y < 0.0 {
        let x = min(mul(-2.2, direction.y), 1.0);
        return mix3(HORIZON, HAZE, mul(mul(x, x), sub(3.0, mul(2.0, x))));
    }
    let up = sub(1.0, direction.y);
    return mix3(HORIZON, ZENITH, sub(1.0, mul(mul(up, up), up)));
}

// Returns the ambient light on a surface.
fn ambient(normal: vec3<f32>) -> vec3<f32> {
    if normal.y < 0.0 { return mix3(FROM_THE_SIDE, FROM_BELOW, -normal.y); }
    return mix3(FROM_THE_SIDE, FROM_ABOVE, normal.y);
}

// Returns a point in units of 2^exponent. Coordinates below 2^-64 become zero.
fn scale_to_unit(v: vec3<u32>, exponent: i32) -> vec3<f32> { return snapped3(scale_point(v, -exponent)); }

// Interpolates a point within a triangle along one axis.
fn within(a: f32, e1: f32, e2: f32, u: f32, v: f32) -> f32 {
    return add(a, add(flushed(mul(e1, u)), flushed(mul(e2, v))));
}

fn cross_product(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return sub_each(mul_each(a.yzx, b.zxy), mul_each(a.zxy, b.yzx));
}

// Returns the light that leaves a hit towards the eye. `direction` is the ray's direction, of length 1.
fn surface_light(hit: vec4<u32>, in_shadow: bool, direction: vec3<f32>) -> vec3<f32> {
    let corners = points_of(hit.w);
    let exponent = max(exponent_of(corners[0]), max(exponent_of(corners[1]), exponent_of(corners[2])));
    let a = scale_to_unit(corners[0], exponent);
    let e1 = sub_each(scale_to_unit(corners[1], exponent), a);
    let e2 = sub_each(scale_to_unit(corners[2], exponent), a);
    var normal = unit(cross_product(scaled_near_one(e1), scaled_near_one(e2)));
    if dot_product(normal, direction) > 0.0 { normal = -normal; }
    var light = ambient(normal);
    if !in_shadow {
        let u = bitcast<f32>(hit.y);
        let v = bitcast<f32>(hit.z);
        let point = vec3<f32>(within(a.x, e1.x, e2.x, u, v), within(a.y, e1.y, e2.y, u, v), within(a.z, e1.z, e2.z, u, v));
        // The lamp is in scene units. Both points are converted to the larger unit.
        let lamp = bitcast<vec3<u32>>(params.light);
        let larger = max(exponent, exponent_of(lamp));
        let to_lamp = unit(sub_each(scale_to_unit(lamp, larger), scale_to_unit(bitcast<vec3<u32>>(point), larger - exponent)));
        let facing = max(dot_product(normal, to_lamp), 0.0);
        light = add_each(light, mul_each(LAMP, vec3<f32>(facing)));
    }
    let colour = colours[hit.w];
    return mul_each(vec3<f32>(linear(colour), linear(colour >> 8u), linear(colour >> 16u)), light);
}

// Returns the linear light of an sRGB level.
fn linear(srgb: u32) -> f32 { return bitcast<f32>(tones[srgb & 255u]); }

// Returns the sRGB level of linear light.
fn level(light: f32) -> u32 { return tones[256u + min(u32(add(mul(light, STEPS), 0.5)), LAST_STEP)]; }

@compute @workgroup_size(16, 8)
fn shade(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height { return; }
    let i = id.y * params.width + id.x;
    let direction = unit(pixel_direction(id.xy));
    let hit = hits[i];
    var light: vec3<f32>;
    if hit.w == 0xffffffffu {
        light = sky(direction);
    } else {
        light = surface_light(hit, occluded[i] != 0u, direction);
    }
    pixels[i] = level(light.x) | (level(light.y) << 8u) | (level(light.z) << 16u) | 0xff000000u;
}
