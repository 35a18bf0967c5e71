// Decides whether a ray hits a triangle, and rounds t and weights of the hit once each, if about 48 bits suffice: "What is
// reported" in docs/design/exact-arithmetic.md.

import package::geometry::ray::{PreparedRay, max_component, permute};
import package::geometry::units::in_ray_units;
import package::intersect::sheared::permuted_corners;
import package::lib::double_float::{
    DoubleFloat3, add_double, add_each, fast_two_sum, mul_each, multiply_double, negate_double, two_product, two_sum,
};
import package::lib::ieee::{add, division_remainder, divisor, mul, sub};

// `is_rounded`: the triangle is surely hit, and `hit` and `t` are rounded once. `is_missed`: the line surely passes beside the
// triangle. `t` is in scaled units.
struct RoundedHit { hit: vec4<u32>, t: f32, is_rounded: bool, is_missed: bool }

// 2^-44: bounds the error of an edge function, relative to the magnitudes of its two products.
const EDGE_ERROR: f32 = 5.684341886080802e-14;
// 2^-66: bounds the error of a sheared coordinate, relative to the terms that cancel in it.
const SHEAR_ERROR: f32 = 1.3552527156068805e-20;
// 2^-60: bounds the same error where a coordinate of zero may represent one below 2^-64.
const SNAP_ERROR: f32 = 8.673617379884035e-19;
// 2^-118: bounds the parts of an edge function that underflow.
const UNDERFLOW_ERROR: f32 = 3.0092655e-36;

// Returns x * dz - dx * z for three corners, where x and z are exact. All sums are exact except that of the least significant
// parts.
fn shear_in_double_float(x: DoubleFloat3, z: DoubleFloat3, dx: f32, dz: f32) -> DoubleFloat3 {
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
struct DoubleFloatEdges { value: DoubleFloat3, sizes: vec3<f32> }

fn double_float_edges(x: DoubleFloat3, y: DoubleFloat3) -> DoubleFloatEdges {
    let p = multiply_double(DoubleFloat3(x.high.zxy, x.low.zxy), DoubleFloat3(y.high.yzx, y.low.yzx));
    let q = multiply_double(DoubleFloat3(y.high.zxy, y.low.zxy), DoubleFloat3(x.high.yzx, x.low.yzx));
    return DoubleFloatEdges(add_double(p, negate_double(q)), abs(p.high) + abs(q.high));
}

// Returns the sum of the three numbers in all three components.
fn sum_components(a: DoubleFloat3) -> DoubleFloat3 {
    let two = add_double(DoubleFloat3(a.high.xxx, a.low.xxx), DoubleFloat3(a.high.yyy, a.low.yyy));
    return add_double(two, DoubleFloat3(a.high.zzz, a.low.zzz));
}

// A quotient, and whether it is the exact one rounded once.
struct RoundedQuotient { value: f32, certain: bool }

// Divides n by d, both sums of two floats. `error` bounds the error of the quotient before its own roundings.
fn round_quotient_once(n: vec2<f32>, d: vec2<f32>, error: f32) -> RoundedQuotient {
    let d_divisor = divisor(d.x);
    let guess = mul(n.x, d_divisor.inverse);
    let q = add(guess, mul(division_remainder(n.x, guess, d_divisor), d_divisor.inverse));
    let remainder = add(division_remainder(n.x, q, d_divisor), sub(n.y, mul(q, d.y)));
    let correction = mul(remainder, d_divisor.inverse);
    let value = add(q, correction);
    let residual = sub(correction, sub(value, q));
    // 2^-43
    let error_bound = error + 1.1368683772161603e-13 * abs(value);
    let low = add(value, sub(residual, error_bound));
    let high = add(value, add(residual, error_bound));
    // 2^-75, below which parts underflow, and 2^100.
    let magnitude = abs(n.x);
    let is_usual = magnitude > 2.6469779601696886e-23 && magnitude < 1.2676506002282294e30;
    return RoundedQuotient(value, is_usual && low == high);
}

fn has_zero(v: vec3<f32>) -> bool { return any(v == vec3<f32>(0.0)); }

fn exact_difference(corners: vec3<f32>, start: f32) -> DoubleFloat3 { return two_sum(corners, vec3<f32>(-start)); }

// A ray's line. Origin and direction are in the order of `axes`, and scaled as in `PreparedRay`. But the direction keeps its small
// components. t in the ray's own units is t * 2^-exponent.
struct PermutedLine { axes: vec3<u32>, origin: vec3<f32>, direction: vec3<f32>, exponent: i32 }

// Returns the line of a ray. `direction` is scaled as in `PreparedRay`, but keeps its small components.
fn permuted_line(ray: PreparedRay, direction: vec3<f32>) -> PermutedLine {
    return PermutedLine(ray.axes, ray.permuted_origin, permute(direction, ray.axis), ray.exponent);
}

// Returns the hit of a leaf's triangle. The ray's limits are not tested.
fn round_hit(permuted: PermutedLine, leaf: u32) -> RoundedHit {
    let corners = permuted_corners(permuted.axes, leaf);
    let x = exact_difference(corners.x, permuted.origin.x);
    let y = exact_difference(corners.y, permuted.origin.y);
    let z = exact_difference(corners.z, permuted.origin.z);
    let d = permuted.direction;
    let p = shear_in_double_float(x, z, d.x, d.z);
    let q = shear_in_double_float(y, z, d.y, d.z);
    let edges = double_float_edges(p, q);
    let det = sum_components(edges.value);
    let magnitude = abs(det.high.x);

    // Error bounds.
    let deepest = 1.01 * max_component(abs(z.high));
    let max_coordinate = 2.0 * (max(max_component(abs(x.high)), max_component(abs(y.high))) + deepest);
    let small = has_zero(corners.x) || has_zero(corners.y) || has_zero(corners.z) || has_zero(permuted.origin);
    let snap_error = select(0.0, SNAP_ERROR, small);
    let shear_error = SHEAR_ERROR * max_coordinate + snap_error;
    let extent = max_component(abs(p.high)) + max_component(abs(q.high));
    let edge_errors = EDGE_ERROR * edges.sizes + vec3<f32>(2.02 * shear_error * (extent + shear_error) + UNDERFLOW_ERROR);
    let error = 1.01 * (edge_errors.x + edge_errors.y + edge_errors.z) + EDGE_ERROR * magnitude;

    // t is numerator / (det * dz).
    let numerator = sum_components(multiply_double(edges.value, z));
    let by = two_product(det.high, d.zzz);
    let denominator = fast_two_sum(by.high, add_each(by.low, mul_each(det.low, d.zzz)));
    let n = vec2<f32>(numerator.high.x, numerator.low.x);
    let inverse = 1.02 / magnitude;
    let t_error = (2.0 * deepest * error + snap_error * magnitude) * inverse;
    let t = round_quotient_once(n, vec2<f32>(denominator.high.x, denominator.low.x), t_error);

    let determinant = vec2<f32>(det.high.x, det.low.x);
    let weights = edges.value;
    let share = abs(weights.high.yz) * inverse;
    let u = round_quotient_once(
        vec2<f32>(weights.high.y, weights.low.y), determinant, (edge_errors.y + error * share.x) * inverse,
    );
    let v = round_quotient_once(
        vec2<f32>(weights.high.z, weights.low.z), determinant, (edge_errors.z + error * share.y) * inverse,
    );
    let bits = in_ray_units(t.value, permuted.exponent);
    let hit = vec4<u32>(bits, bitcast<u32>(u.value), bitcast<u32>(v.value), corners.triangle);
    // Where an edge function is above its error, its least significant part changes no sign.
    let is_positive = edges.value.high > 1.01 * edge_errors;
    let is_negative = edges.value.high < -1.01 * edge_errors;
    let is_inside = all(is_positive) || all(is_negative);
    // The bounds hold if det is far above its error. A subnormal t would be rounded twice.
    let is_clear = 512.0 * error < magnitude && ((bits >> 23u) & 255u) - 1u < 254u;
    let is_rounded = is_inside && is_clear && t.certain && u.certain && v.certain;
    return RoundedHit(hit, t.value, is_rounded, any(is_positive) && any(is_negative));
}
