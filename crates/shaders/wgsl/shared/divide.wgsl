// Correctly rounded division, whatever the device's own division does: its
// inverse of the divisor's mantissa gives only a guess, and the exact integer
// remainder puts it right. Zeros, infinities, NaNs and subnormals as IEEE has them.

struct Parts { mantissa: u32, exponent: i32 }

// A finite, non-zero number as mantissa * 2^(exponent - 150), mantissa in [2^23, 2^24).
fn parts(bits: u32) -> Parts {
    let exponent = i32((bits >> 23u) & 255u);
    let fraction = bits & 0x7fffffu;
    if exponent != 0 {
        return Parts(fraction | 0x800000u, exponent);
    }
    let shift = countLeadingZeros(fraction) - 8u;
    return Parts(fraction << shift, 1 - i32(shift));
}

// A number to divide by, several times perhaps.
struct Divisor { bits: u32, mantissa: u32, inverse: f32 }

fn divisor(b: f32) -> Divisor {
    let bits = bitcast<u32>(b);
    let mantissa = (bits & 0x7fffffu) | 0x800000u;
    return Divisor(bits, mantissa, 1.0 / f32(mantissa));
}

fn divide(a: f32, b: f32) -> f32 { return divide_by(a, divisor(b)); }

fn divide_by(a: f32, by: Divisor) -> f32 {
    let ua = bitcast<u32>(a);
    let ea = (ua >> 23u) & 255u;
    let eb = (by.bits >> 23u) & 255u;
    let exponent = i32(ea) - i32(eb) + 126;
    if ea - 1u < 254u && eb - 1u < 254u && u32(exponent - 1) < 252u { return divide_normal(a, by); }
    return divide_rarely(ua, by.bits);
}

// Likewise where both numbers and the quotient are normal.
fn divide_normal(a: f32, by: Divisor) -> f32 {
    let ua = bitcast<u32>(a);
    let mantissa = (ua & 0x7fffffu) | 0x800000u;
    let below = mantissa < by.mantissa;
    let exponent = ((ua >> 23u) & 255u) + select(127u, 126u, below) - ((by.bits >> 23u) & 255u);
    let q = quotient_of(mantissa, select(24u, 25u, below), by.mantissa, by.inverse);
    let up = (q.value & 1u) & (select(0u, 1u, q.sticky) | (q.value >> 1u));
    let rounded = (q.value >> 1u) + ((exponent - 1u) << 23u) + up;
    return bitcast<f32>(((ua ^ by.bits) & 0x80000000u) | rounded);
}

struct Quotient { value: u32, sticky: bool }

// The quotient of a * 2^shift and b in whole numbers, in [2^24, 2^25), from a guess at 1 / b
// that is off by a few units in the last place.
fn quotient_of(a: u32, shift: u32, b: u32, inverse: f32) -> Quotient {
    var value = u32(f32(a) * inverse * select(16777216.0, 33554432.0, shift == 25u));
    // |remainder| stays far below 2^31, so wrapping arithmetic gives it exactly.
    var remainder = bitcast<i32>((a << shift) - value * b);
    let divisor = i32(b);
    let step = i32(f32(remainder) * inverse);
    value = bitcast<u32>(bitcast<i32>(value) + step);
    remainder -= step * divisor;
    if remainder < 0 { remainder += divisor; value -= 1u; }
    if remainder < 0 { remainder += divisor; value -= 1u; }
    if remainder >= divisor { remainder -= divisor; value += 1u; }
    return Quotient(value, remainder != 0);
}

// Where an operand or the quotient is zero, subnormal, infinite or a NaN, or may be.
fn divide_rarely(ua: u32, ub: u32) -> f32 {
    let sign = (ua ^ ub) & 0x80000000u;
    let xa = ua & 0x7fffffffu;
    let xb = ub & 0x7fffffffu;
    if xa >= 0x7f800000u || xb >= 0x7f800000u || xa == 0u || xb == 0u {
        return divide_special(sign, xa, xb);
    }
    let pa = parts(xa);
    let pb = parts(xb);
    let below = pa.mantissa < pb.mantissa;
    let exponent = pa.exponent - pb.exponent + select(127, 126, below);
    let q = quotient_of(pa.mantissa, select(24u, 25u, below), pb.mantissa, 1.0 / f32(pb.mantissa));
    return bitcast<f32>(sign | round_quotient(q.value, q.sticky, exponent));
}

// A 25-bit quotient with a sticky rest, rounded to nearest even, as bits without sign.
fn round_quotient(quotient: u32, sticky: bool, exponent: i32) -> u32 {
    if exponent >= 255 {
        return 0x7f800000u;
    }
    let drop = select(1u, u32(2 - exponent), exponent <= 0);
    if drop > 26u {
        return 0u;
    }
    let kept = select(quotient >> (drop & 31u), 0u, drop > 31u);
    let rest = quotient - (kept << drop);
    let half = 1u << (drop - 1u);
    let up = rest > half || (rest == half && (sticky || (kept & 1u) == 1u));
    let rounded = kept + select(0u, 1u, up);
    // The hidden bit adds one to the exponent field; a carry out of the mantissa adds another.
    return select(rounded + (u32(max(exponent, 1) - 1) << 23u), rounded, exponent <= 0);
}

fn divide_special(sign: u32, xa: u32, xb: u32) -> f32 {
    let inf = 0x7f800000u;
    let nan = xa > inf || xb > inf || (xa == inf && xb == inf) || (xa == 0u && xb == 0u);
    if nan {
        return bitcast<f32>(0x7fc00000u | (params.zero & 0u));
    }
    let infinite = xa == inf || xb == 0u;
    return bitcast<f32>(sign | select(0u, inf, infinite));
}
