// Conversion from scene units to scaled units, and the sizes below which numbers are replaced by zero: see "Scale" and "Small
// numbers" in docs/design/hits.md. Powers of two are applied to bits, because a device may flush subnormal operands.

import package::lib::ieee::{decode_float, round_quotient};
import package::lib::params::params;

// Returns t in the ray's own units, as bits. A zero is positive.
fn in_ray_units(t: f32, exponent: i32) -> u32 {
    let bits = bitcast<u32>(scale_bits(bitcast<u32>(t), -exponent));
    return select(bits, 0u, bits == 0x80000000u);
}

// Returns x * 2^m, rounded once. Subnormal numbers, infinities and NaNs follow IEEE.
fn scale_bits(bits: u32, m: i32) -> f32 {
    let magnitude = bits & 0x7fffffffu;
    let exponent = i32(magnitude >> 23u);
    // Operand and result are normal.
    if u32(exponent - 1) < 254u && u32(exponent + m - 1) < 254u {
        return bitcast<f32>(bitcast<u32>(bitcast<i32>(bits) + (m << 23u)));
    }
    if magnitude == 0u || magnitude >= 0x7f800000u { return bitcast<f32>(bits); }
    let p = decode_float(magnitude);
    return bitcast<f32>((bits & 0x80000000u) | round_quotient(p.mantissa << 1u, false, p.exponent + m));
}

// Returns a point times 2^m, each coordinate rounded once.
fn scale_point(bits: vec3<u32>, m: i32) -> vec3<f32> {
    return vec3<f32>(scale_bits(bits.x, m), scale_bits(bits.y, m), scale_bits(bits.z, m));
}

// Returns the exponent e of the component with the largest magnitude, which is in [2^e, 2^(e+1)).
fn exponent_of(v: vec3<u32>) -> i32 {
    let magnitudes = v & vec3<u32>(0x7fffffffu);
    return decode_float(max(magnitudes.x, max(magnitudes.y, magnitudes.z))).exponent - 127;
}

// Returns a coordinate in scaled units. A result below 2^-64 becomes zero.
fn scaled_coordinate(bits: u32) -> f32 {
    var x = bitcast<f32>(bits);
    if params.scale_exponent != 0 { x = scale_bits(bits, -params.scale_exponent); }
    return snapped(x);
}

fn scaled_point(bits: vec3<u32>) -> vec3<f32> {
    return vec3<f32>(scaled_coordinate(bits.x), scaled_coordinate(bits.y), scaled_coordinate(bits.z));
}

// Replaces values below 2^-64 by zero.
fn snapped(x: f32) -> f32 { return select(x, 0.0, abs(x) < 5.421010862427522e-20); }

fn snapped3(v: vec3<f32>) -> vec3<f32> { return vec3<f32>(snapped(v.x), snapped(v.y), snapped(v.z)); }

// Returns whether all coordinates are finite, given as bits.
fn is_finite(bits: vec3<u32>) -> bool {
    return all((bits & vec3<u32>(0x7f800000u)) != vec3<u32>(0x7f800000u));
}

fn is_finite_point(v: vec3<f32>) -> bool { return is_finite(bitcast<vec3<u32>>(v)); }

// Replaces products, weights and distances below 2^-100 by zero.
fn flushed(x: f32) -> f32 { return select(x, 0.0, abs(x) < 7.888609052210118e-31); }

// Extreme rays: geom::CoordinateRange.

// Returns whether a ray from `origin`, in scaled units, is extreme. The host must know the range of the coordinates.
fn is_extreme(origin: vec3<f32>) -> bool {
    return params.extreme == 1u || has_extreme_origin(origin, params.tiny != 0u);
}

// The bounds are 2^40 and 2^-24. A NaN is extreme.
fn has_extreme_origin(origin: vec3<f32>, tiny: bool) -> bool {
    let size = abs(origin);
    let farthest = max(size.x, max(size.y, size.z));
    return !is_finite_point(origin) || farthest >= 1099511627776.0 || (tiny && farthest < 5.9604644775390625e-8);
}

// Maps floats to integers of the same order, and back.
fn ordered(bits: u32) -> i32 {
    let size = bitcast<i32>(bits & 0x7fffffffu);
    return select(size, -size, (bits >> 31u) == 1u);
}

fn bits_from_ordered(x: i32) -> u32 { return select(bitcast<u32>(x), bitcast<u32>(-x) | 0x80000000u, x < 0); }

// Returns 2^e, clamped to the range of normal floats.
fn power_of_two(e: i32) -> f32 { return bitcast<f32>(u32(clamp(e, -126, 127) + 127) << 23u); }
