// Scene units to scaled units, and the sizes below which numbers count as zero:
// see "Scale" and "Small numbers" in docs/design/hits.md. Powers of two are applied
// to bits, since a device may flush subnormal operands.

import package::lib::ieee::{parts, round_quotient};
import package::lib::params::params;

// t in the ray's own units, as bits; a zero is a positive one.
fn in_ray_units(t: f32, exponent: i32) -> u32 {
    let bits = bitcast<u32>(scale_bits(bitcast<u32>(t), -exponent));
    return select(bits, 0u, bits == 0x80000000u);
}

// x * 2^m, rounded once; subnormal numbers, infinities and NaNs as IEEE has them.
fn scale_bits(bits: u32, m: i32) -> f32 {
    let magnitude = bits & 0x7fffffffu;
    let exponent = i32(magnitude >> 23u);
    // Normal, and the result too.
    if u32(exponent - 1) < 254u && u32(exponent + m - 1) < 254u {
        return bitcast<f32>(bitcast<u32>(bitcast<i32>(bits) + (m << 23u)));
    }
    if magnitude == 0u || magnitude >= 0x7f800000u { return bitcast<f32>(bits); }
    let p = parts(magnitude);
    return bitcast<f32>((bits & 0x80000000u) | round_quotient(p.mantissa << 1u, false, p.exponent + m));
}

// A coordinate in scaled units; below 2^-64 it is zero.
fn scaled_coordinate(bits: u32) -> f32 {
    var x = bitcast<f32>(bits);
    if params.scale_exponent != 0 { x = scale_bits(bits, -params.scale_exponent); }
    return snapped(x);
}

fn scaled_point(bits: vec3<u32>) -> vec3<f32> {
    return vec3<f32>(scaled_coordinate(bits.x), scaled_coordinate(bits.y), scaled_coordinate(bits.z));
}

// 2^-64
fn snapped(x: f32) -> f32 { return select(x, 0.0, abs(x) < 5.421010862427522e-20); }

fn snapped3(v: vec3<f32>) -> vec3<f32> { return vec3<f32>(snapped(v.x), snapped(v.y), snapped(v.z)); }

fn is_finite_point(v: vec3<f32>) -> bool {
    return all((bitcast<vec3<u32>>(v) & vec3<u32>(0x7f800000u)) != vec3<u32>(0x7f800000u));
}

// Products, weights and distances below 2^-100 are zero.
fn flushed(x: f32) -> f32 { return select(x, 0.0, abs(x) < 7.888609052210118e-31); }

// Which rays are extreme: geom::Range.

// By its start in scaled units, at a moment of which the host knows how far coordinates reach.
fn is_extreme(origin: vec3<f32>) -> bool {
    return params.extreme == 1u || starts_beyond(origin, params.tiny != 0u);
}

// 2^40 and 2^-24; a NaN is extreme.
fn starts_beyond(origin: vec3<f32>, tiny: bool) -> bool {
    let size = abs(origin);
    let farthest = max(size.x, max(size.y, size.z));
    return !is_finite_point(origin) || farthest >= 1099511627776.0 || (tiny && farthest < 5.9604644775390625e-8);
}

// Floats in order as whole numbers, and back.
fn ordered(bits: u32) -> i32 {
    let size = bitcast<i32>(bits & 0x7fffffffu);
    return select(size, -size, (bits >> 31u) == 1u);
}

fn from_ordered(x: i32) -> u32 { return select(bitcast<u32>(x), bitcast<u32>(-x) | 0x80000000u, x < 0); }

// 2^e within the range of normal floats.
fn power_of_two(e: i32) -> f32 { return bitcast<f32>(u32(clamp(e, -126, 127) + 127) << 23u); }
