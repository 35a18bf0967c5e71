// Correctly rounded division, whatever the device's own division does: the
// native quotient of the mantissas is only a guess, and the exact integer
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

fn divide(a: f32, b: f32) -> f32 {
    let ua = bitcast<u32>(a);
    let ub = bitcast<u32>(b);
    let sign = (ua ^ ub) & 0x80000000u;
    let xa = ua & 0x7fffffffu;
    let xb = ub & 0x7fffffffu;
    if xa >= 0x7f800000u || xb >= 0x7f800000u || xa == 0u || xb == 0u {
        return divide_special(sign, xa, xb);
    }
    let pa = parts(xa);
    let pb = parts(xb);
    let below = pa.mantissa < pb.mantissa;
    let shift = select(24u, 25u, below);
    let exponent = pa.exponent - pb.exponent + select(127, 126, below);

    let guess = f32(pa.mantissa) / f32(pb.mantissa) * select(16777216.0, 33554432.0, below);
    var quotient = u32(guess);
    // |remainder| stays far below 2^31, so wrapping arithmetic gives it exactly.
    var remainder = bitcast<i32>((pa.mantissa << shift) - quotient * pb.mantissa);
    let divisor = i32(pb.mantissa);
    let step = i32(f32(remainder) / f32(divisor));
    quotient = bitcast<u32>(bitcast<i32>(quotient) + step);
    remainder -= step * divisor;
    if remainder < 0 { remainder += divisor; quotient -= 1u; }
    if remainder < 0 { remainder += divisor; quotient -= 1u; }
    if remainder >= divisor { remainder -= divisor; quotient += 1u; }
    if remainder >= divisor { remainder -= divisor; quotient += 1u; }

    return bitcast<f32>(sign | round_quotient(quotient, remainder != 0, exponent));
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
