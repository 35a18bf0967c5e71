// Rounds t and weights of a hit of `exact` once each, if about 48 bits suffice: "What is reported" in
// docs/design/exact-arithmetic.md.

import package::geometry::ray::{PreparedRay, max_component, permute};
import package::geometry::units::{in_ray_units, scale_bits};
import package::intersect::sheared::turned_corners;
import package::lib::double_float::{
    DoubleFloat3, add_double, add_each, fast_two_sum, mul_each, multiply_double, negate_double, two_product, two_sum,
};
import package::lib::ieee::{add, division_remainder, divisor, mul, sub};
import package::lib::params::params;

// A hit to write, valid if `sure`.
struct Reported { hit: vec4<u32>, sure: bool }

// 2^-44: bounds the error of an edge function, relative to the magnitudes of its two products.
const EDGE: f32 = 5.684341886080802e-14;
// 2^-66: bounds the error of a sheared coordinate, relative to the terms that cancel in it.
const CANCELLED: f32 = 1.3552527156068805e-20;
// 2^-60: bounds the same error where a coordinate of zero may represent one below 2^-64.
const FLUSHED: f32 = 8.673617379884035e-19;
// 2^-118: bounds the parts of an edge function that underflow.
const UNDERFLOWN: f32 = 3.0092655e-36;

// Returns x * dz - dx * z for three corners, where x and z are exact. All sums are exact except that of the least significant
// parts.
fn exactly_sheared(x: DoubleFloat3, z: DoubleFloat3, dx: f32, dz: f32) -> DoubleFloat3 {
    let by_x = vec3<f32>(dz);
    let by_z = vec3<f32>(-dx);
    let p = two_product(x.high, by_x);
    let q = two_product(z.high, by_z);
    let r = two_product(x.low, by_x);
    let s = two_product(z.low, by_z);
    let first = two_sum(p.high, q.high);
    let second = two_sum(p.low, q.low);
    let third = two_sum(r.high, s.high);
    let two = two_sum(first.low, second.high);
    let three = two_sum(two.high, third.high);
    let least = add_each(add_each(second.low, two.low), add_each(add_each(third.low, three.low), add_each(r.low, s.low)));
    let sum = two_sum(first.high, three.high);
    return fast_two_sum(sum.high, add_each(sum.low, least));
}

// The edge functions U, V and W, and for each the sum of the magnitudes of its products.
struct ExactEdges { value: DoubleFloat3, sizes: vec3<f32> }

fn exact_edges(x: DoubleFloat3, y: DoubleFloat3) -> ExactEdges {
    let p = multiply_double(DoubleFloat3(x.high.zxy, x.low.zxy), DoubleFloat3(y.high.yzx, y.low.yzx));
    let q = multiply_double(DoubleFloat3(y.high.zxy, y.low.zxy), DoubleFloat3(x.high.yzx, x.low.yzx));
    return ExactEdges(add_double(p, negate_double(q)), abs(p.high) + abs(q.high));
}

// Returns the sum of the three numbers in all three components.
fn total_of(a: DoubleFloat3) -> DoubleFloat3 {
    let two = add_double(DoubleFloat3(a.high.xxx, a.low.xxx), DoubleFloat3(a.high.yyy, a.low.yyy));
    return add_double(two, DoubleFloat3(a.high.zzz, a.low.zzz));
}

// A quotient, and whether it is the exact one rounded once.
struct Rounded { value: f32, sure: bool }

// Divides n by d, both sums of two floats. `error` bounds the error of the quotient before its own roundings.
fn round_once(n: vec2<f32>, d: vec2<f32>, error: f32) -> Rounded {
    let by = divisor(d.x);
    let guess = mul(n.x, by.inverse);
    let q = add(guess, mul(division_remainder(n.x, guess, by), by.inverse));
    let rest = add(division_remainder(n.x, q, by), sub(n.y, mul(q, d.y)));
    let more = mul(rest, by.inverse);
    let value = add(q, more);
    let beyond = sub(more, sub(value, q));
    // 2^-43
    let doubt = error + 1.1368683772161603e-13 * abs(value);
    let low = add(value, sub(beyond, doubt));
    let high = add(value, add(beyond, doubt));
    // 2^-75, below which parts underflow, and 2^100.
    let size = abs(n.x);
    let is_usual = size > 2.6469779601696886e-23 && size < 1.2676506002282294e30;
    return Rounded(value, is_usual && low == high);
}

fn has_zero(v: vec3<f32>) -> bool { return any(v == vec3<f32>(0.0)); }

fn exactly_from(corners: vec3<f32>, start: f32) -> DoubleFloat3 { return two_sum(corners, vec3<f32>(-start)); }

// Returns the prepared direction including small components, which filters take as zero.
fn unflushed(given: vec3<u32>, exponent: i32) -> vec3<f32> {
    return vec3<f32>(scale_bits(given.x, exponent), scale_bits(given.y, exponent), scale_bits(given.z, exponent));
}

// Rounds the hit of a triangle that is surely hit by a ray with the direction `given`.
fn surely_reported(ray: PreparedRay, leaf: u32, given: vec3<u32>) -> Reported {
    let k = turned_corners(ray, leaf);
    let x = exactly_from(k.x, ray.permuted_origin.x);
    let y = exactly_from(k.y, ray.permuted_origin.y);
    let z = exactly_from(k.z, ray.permuted_origin.z);
    let d = permute(unflushed(given, -ray.exponent - params.scale_exponent), ray.axis);
    let p = exactly_sheared(x, z, d.x, d.z);
    let q = exactly_sheared(y, z, d.y, d.z);
    let edges = exact_edges(p, q);
    let det = total_of(edges.value);
    let size = abs(det.high.x);

    // Error bounds.
    let deepest = 1.01 * max_component(abs(z.high));
    let reach = 2.0 * (max(max_component(abs(x.high)), max_component(abs(y.high))) + deepest);
    let small = has_zero(k.x) || has_zero(k.y) || has_zero(k.z) || has_zero(ray.permuted_origin);
    let flushed = select(0.0, FLUSHED, small);
    let slack = CANCELLED * reach + flushed;
    let wide = max_component(abs(p.high)) + max_component(abs(q.high));
    let errors = EDGE * edges.sizes + vec3<f32>(2.02 * slack * (wide + slack) + UNDERFLOWN);
    let error = 1.01 * (errors.x + errors.y + errors.z) + EDGE * size;

    // t is numerator / (det * dz).
    let numerator = total_of(multiply_double(edges.value, z));
    let by = two_product(det.high, d.zzz);
    let denominator = fast_two_sum(by.high, add_each(by.low, mul_each(det.low, d.zzz)));
    let n = vec2<f32>(numerator.high.x, numerator.low.x);
    let inverse = 1.02 / size;
    let t_error = (2.0 * deepest * error + flushed * size) * inverse;
    let t = round_once(n, vec2<f32>(denominator.high.x, denominator.low.x), t_error);

    let whole = vec2<f32>(det.high.x, det.low.x);
    let weights = edges.value;
    let share = abs(weights.high.yz) * inverse;
    let u = round_once(vec2<f32>(weights.high.y, weights.low.y), whole, (errors.y + error * share.x) * inverse);
    let v = round_once(vec2<f32>(weights.high.z, weights.low.z), whole, (errors.z + error * share.y) * inverse);
    let bits = in_ray_units(t.value, ray.exponent);
    let hit = vec4<u32>(bits, bitcast<u32>(u.value), bitcast<u32>(v.value), k.triangle);
    // The bounds hold if det is far above its error. A subnormal t would be rounded twice.
    let is_clear = 512.0 * error < size && ((bits >> 23u) & 255u) - 1u < 254u;
    return Reported(hit, is_clear && t.sure && u.sure && v.sure);
}
