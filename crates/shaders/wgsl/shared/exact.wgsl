// Signs that rounding cannot spoil, in integer arithmetic.

struct Wide { hi: u32, lo: u32 }

// The exact product of two 24-bit numbers.
fn multiply_24(a: u32, b: u32) -> Wide {
    let a1 = a >> 12u;
    let a0 = a & 0xfffu;
    let b1 = b >> 12u;
    let b0 = b & 0xfffu;
    let middle = a1 * b0 + a0 * b1;
    let low = a0 * b0 + ((middle & 0xfffu) << 12u);
    let high = a1 * b1 + (middle >> 12u) + (low >> 24u);
    return Wide(high, low & 0xffffffu);
}

// Compares |a * b| with |c * d|, all finite: -1, 0 or 1.
fn compare_products(a: f32, b: f32, c: f32, d: f32) -> i32 {
    let xa = bitcast<u32>(a) & 0x7fffffffu;
    let xb = bitcast<u32>(b) & 0x7fffffffu;
    let xc = bitcast<u32>(c) & 0x7fffffffu;
    let xd = bitcast<u32>(d) & 0x7fffffffu;
    let left_zero = xa == 0u || xb == 0u;
    let right_zero = xc == 0u || xd == 0u;
    if left_zero || right_zero {
        return select(0, 1, !left_zero) - select(0, 1, !right_zero);
    }
    let pa = parts(xa);
    let pb = parts(xb);
    let pc = parts(xc);
    let pd = parts(xd);
    var left = multiply_24(pa.mantissa, pb.mantissa);
    var right = multiply_24(pc.mantissa, pd.mantissa);
    var left_exponent = pa.exponent + pb.exponent;
    var right_exponent = pc.exponent + pd.exponent;
    // Both products lie in [2^46, 2^48): bring them to [2^47, 2^48).
    if left.hi < 0x800000u {
        left = double(left);
        left_exponent -= 1;
    }
    if right.hi < 0x800000u {
        right = double(right);
        right_exponent -= 1;
    }
    if left_exponent != right_exponent {
        return select(-1, 1, left_exponent > right_exponent);
    }
    if left.hi != right.hi {
        return select(-1, 1, left.hi > right.hi);
    }
    return select(0, 1, left.lo > right.lo) - select(0, 1, left.lo < right.lo);
}

fn double(w: Wide) -> Wide {
    return Wide((w.hi << 1u) | (w.lo >> 23u), (w.lo << 1u) & 0xffffffu);
}

// The exact sign of a * b - c * d, all finite.
fn sign_of_difference(a: f32, b: f32, c: f32, d: f32) -> i32 {
    let left_negative = ((bitcast<u32>(a) ^ bitcast<u32>(b)) >> 31u) == 1u;
    let right_negative = ((bitcast<u32>(c) ^ bitcast<u32>(d)) >> 31u) == 1u;
    // By bits: a device may flush subnormals when it compares.
    let zero_left = (bitcast<u32>(a) << 1u) == 0u || (bitcast<u32>(b) << 1u) == 0u;
    let zero_right = (bitcast<u32>(c) << 1u) == 0u || (bitcast<u32>(d) << 1u) == 0u;
    let left_sign = select(select(1, -1, left_negative), 0, zero_left);
    let right_sign = select(select(1, -1, right_negative), 0, zero_right);
    if left_sign != right_sign {
        return select(-1, 1, left_sign > right_sign);
    }
    return left_sign * compare_products(a, b, c, d);
}
