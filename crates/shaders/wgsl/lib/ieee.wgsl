// IEEE arithmetic that does not depend on the device: single operations, and correctly rounded division.

import package::lib::params::params;

// Single IEEE operations. The build decorates them with NoContraction, so that no driver fuses or regroups them.

@if(!OPAQUE)
fn add(a: f32, b: f32) -> f32 { return a + b; }

@if(!OPAQUE)
fn sub(a: f32, b: f32) -> f32 { return a - b; }

@if(!OPAQUE)
fn mul(a: f32, b: f32) -> f32 { return a * b; }

// Single IEEE operations for shader translators that cannot guarantee NoContraction. Each result passes through an integer
// xor with a zero that the compiler does not know, so nothing can be fused or regrouped across it.

@if(OPAQUE)
fn opaque_zero(x: f32) -> f32 { return bitcast<f32>(bitcast<u32>(x) ^ params.zero); }

@if(OPAQUE)
fn add(a: f32, b: f32) -> f32 { return opaque_zero(a + b); }

@if(OPAQUE)
fn sub(a: f32, b: f32) -> f32 { return opaque_zero(a - b); }

@if(OPAQUE)
fn mul(a: f32, b: f32) -> f32 { return opaque_zero(a * b); }

// Correctly rounded division that does not rely on the device's division: its reciprocal only gives a guess, which the exact
// remainder corrects. Zeros, infinities, NaNs and subnormals follow IEEE.

struct DecodedFloat { mantissa: u32, exponent: i32 }

// A finite, non-zero number as mantissa * 2^(exponent - 150), with the mantissa in [2^23, 2^24).
fn decode_float(bits: u32) -> DecodedFloat {
    let exponent = i32((bits >> 23u) & 255u);
    let fraction = bits & 0x7fffffu;
    if exponent != 0 {
        return DecodedFloat(fraction | 0x800000u, exponent);
    }
    let shift = countLeadingZeros(fraction) - 8u;
    return DecodedFloat(fraction << shift, 1 - i32(shift));
}

// A divisor prepared for one or more divisions: its upper and lower 12 bits, and an approximate reciprocal.
struct Divisor { value: f32, high: f32, low: f32, inverse: f32 }

fn upper_bits(x: f32) -> f32 { return bitcast<f32>(bitcast<u32>(x) & 0xfffff000u); }

fn divisor(b: f32) -> Divisor {
    let high = upper_bits(b);
    return Divisor(b, high, sub(b, high), 1.0 / b);
}

fn divide(a: f32, b: f32) -> f32 { return divide_by(a, divisor(b)); }

fn divide_by(a: f32, by: Divisor) -> f32 {
    let exponent_a = (bitcast<u32>(a) >> 23u) & 255u;
    let exponent_b = (bitcast<u32>(by.value) >> 23u) & 255u;
    // Both operands are between 2^-60 and 2^61, and the quotient is above 2^-101.
    if exponent_a - 67u <= 120u && exponent_b - 67u <= 120u && exponent_a + 100u >= exponent_b { return divide_normal(a, by); }
    return divide_special_range(bitcast<u32>(a), bitcast<u32>(by.value));
}

// Divides operands between 2^-60 and 2^61 whose quotient is above 2^-101. So only a correction that is too small to change the
// quotient can be subnormal. After one correction, the quotient is one of the two floats next to a / b. A second exact
// remainder selects between them, since no quotient is half way between two floats.
fn divide_normal(a: f32, by: Divisor) -> f32 {
    let guess = mul(a, by.inverse);
    let quotient = add(guess, mul(division_remainder(a, guess, by), by.inverse));
    let remainder = division_remainder(a, quotient, by);
    let is_below_quotient = ((bitcast<u32>(remainder) ^ bitcast<u32>(by.value) ^ bitcast<u32>(quotient)) >> 31u) == 0u;
    let neighbour = bitcast<f32>(bitcast<u32>(quotient) + select(0xffffffffu, 1u, is_below_quotient));
    return select(quotient, neighbour, 2.0 * abs(remainder) > abs(mul(sub(neighbour, quotient), by.value)));
}

struct Quotient { value: u32, sticky: bool }

// Returns the integer quotient of a * 2^shift and b, in [2^24, 2^25). The reciprocal that it starts from is off by a few units
// in the last place.
fn integer_quotient(a: u32, shift: u32, b: u32) -> Quotient {
    let inverse = 1.0 / f32(b);
    var value = u32(f32(a) * inverse * select(16777216.0, 33554432.0, shift == 25u));
    // |remainder| is far below 2^31, so wrapping arithmetic is exact.
    var remainder = bitcast<i32>((a << shift) - value * b);
    let signed_b = i32(b);
    let step = i32(f32(remainder) * inverse);
    value = bitcast<u32>(bitcast<i32>(value) + step);
    remainder -= step * signed_b;
    if remainder < 0 { remainder += signed_b; value -= 1u; }
    if remainder < 0 { remainder += signed_b; value -= 1u; }
    if remainder >= signed_b { remainder -= signed_b; value += 1u; }
    return Quotient(value, remainder != 0);
}

// Divides where an operand or the quotient is, or may be, zero, subnormal, infinite or NaN.
fn divide_special_range(a: u32, b: u32) -> f32 {
    let sign = (a ^ b) & 0x80000000u;
    let magnitude_a = a & 0x7fffffffu;
    let magnitude_b = b & 0x7fffffffu;
    if magnitude_a >= 0x7f800000u || magnitude_b >= 0x7f800000u || magnitude_a == 0u || magnitude_b == 0u {
        return divide_special(sign, magnitude_a, magnitude_b);
    }
    let pa = decode_float(magnitude_a);
    let pb = decode_float(magnitude_b);
    let is_below_one = pa.mantissa < pb.mantissa;
    let exponent = pa.exponent - pb.exponent + select(127, 126, is_below_one);
    let quotient = integer_quotient(pa.mantissa, select(24u, 25u, is_below_one), pb.mantissa);
    return bitcast<f32>(sign | round_quotient(quotient.value, quotient.sticky, exponent));
}

// Rounds a 25-bit quotient with a sticky bit to nearest even. Returns the bits without sign.
fn round_quotient(quotient: u32, sticky: bool, exponent: i32) -> u32 {
    if exponent >= 255 {
        return 0x7f800000u;
    }
    let dropped_bits = select(1u, u32(2 - exponent), exponent <= 0);
    if dropped_bits > 26u {
        return 0u;
    }
    let truncated = select(quotient >> (dropped_bits & 31u), 0u, dropped_bits > 31u);
    let remainder = quotient - (truncated << dropped_bits);
    let half = 1u << (dropped_bits - 1u);
    let rounds_up = remainder > half || (remainder == half && (sticky || (truncated & 1u) == 1u));
    let rounded = truncated + select(0u, 1u, rounds_up);
    // The hidden bit adds one to the exponent field; a carry out of the mantissa adds another.
    return select(rounded + (u32(max(exponent, 1) - 1) << 23u), rounded, exponent <= 0);
}

fn divide_special(sign: u32, magnitude_a: u32, magnitude_b: u32) -> f32 {
    let inf = 0x7f800000u;
    let nan = magnitude_a > inf || magnitude_b > inf || (magnitude_a == inf && magnitude_b == inf)
        || (magnitude_a == 0u && magnitude_b == 0u);
    if nan {
        return bitcast<f32>(0x7fc00000u | (params.zero & 0u));
    }
    let infinite = magnitude_a == inf || magnitude_b == 0u;
    return bitcast<f32>(sign | select(0u, inf, infinite));
}

// Remainder a - q * b, on devices whose fused multiply-add rounds once. It is exact if q is within one unit in
// the last place of a / b.

@if(FUSED)
fn division_remainder(a: f32, q: f32, by: Divisor) -> f32 { return fma(-q, by.value, a); }

// Remainder a - q * b. Products of halves are exact. So is each difference if q is within one unit in the last place of
// a / b (Dekker 1971).
@else
fn division_remainder(a: f32, q: f32, by: Divisor) -> f32 {
    let high = upper_bits(q);
    let low = sub(q, high);
    return sub(sub(sub(sub(a, mul(high, by.high)), mul(high, by.low)), mul(low, by.high)), mul(low, by.low));
}
