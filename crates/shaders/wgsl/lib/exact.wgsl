// Integer arithmetic on floats: exact signs of products and sums, and IEEE results for subnormal numbers.

import package::lib::ieee::{parts, round_quotient};

// Exact signs, unaffected by rounding.

struct Wide { hi: u32, lo: u32 }

// Returns the exact product of two 24-bit numbers.
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

// Compares |a * b| with |c * d| for finite operands. Returns -1, 0 or 1.
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
    // Both products are in [2^46, 2^48): normalize them to [2^47, 2^48).
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

// Returns the exact sign of a * b - c * d for finite operands.
fn sign_of_difference(a: f32, b: f32, c: f32, d: f32) -> i32 {
    let left_negative = ((bitcast<u32>(a) ^ bitcast<u32>(b)) >> 31u) == 1u;
    let right_negative = ((bitcast<u32>(c) ^ bitcast<u32>(d)) >> 31u) == 1u;
    // Compares bits, because a device may flush subnormals in float comparisons.
    let zero_left = (bitcast<u32>(a) << 1u) == 0u || (bitcast<u32>(b) << 1u) == 0u;
    let zero_right = (bitcast<u32>(c) << 1u) == 0u || (bitcast<u32>(d) << 1u) == 0u;
    let left_sign = select(select(1, -1, left_negative), 0, zero_left);
    let right_sign = select(select(1, -1, right_negative), 0, zero_right);
    if left_sign != right_sign {
        return select(-1, 1, left_sign > right_sign);
    }
    return left_sign * compare_products(a, b, c, d);
}

// IEEE sums and products in integer arithmetic, for the rare operands that a device may flush. Operands must be finite.

fn soft_multiply(a: u32, b: u32) -> u32 {
    let sign = (a ^ b) & 0x80000000u;
    let xa = a & 0x7fffffffu;
    let xb = b & 0x7fffffffu;
    if xa == 0u || xb == 0u { return sign; }
    let pa = parts(xa);
    let pb = parts(xb);
    let product = multiply_24(pa.mantissa, pb.mantissa);
    let large = product.hi >= 0x800000u;
    let drop = select(22u, 23u, large);
    let quotient = (product.hi << (24u - drop)) | (product.lo >> drop);
    let rest = product.lo & ((1u << drop) - 1u);
    return sign | round_quotient(quotient, rest != 0u, pa.exponent + pb.exponent - select(127, 126, large));
}

fn soft_add(a: u32, b: u32) -> u32 {
    let swap = (a & 0x7fffffffu) < (b & 0x7fffffffu);
    let big = select(a, b, swap);
    let small = select(b, a, swap);
    if (big & 0x7fffffffu) == 0u { return big & small; }
    let e = field(big);
    // Keeps six bits below the last place. The lowest one is sticky: it also records the bits shifted out.
    let m = mantissa(big) << 6u;
    let shift = e - field(small);
    let n = mantissa(small) << 6u;
    let kept = select(n >> (shift & 31u), 0u, shift > 31u);
    let lost = select(0u, 1u, select((kept << (shift & 31u)) != n, n != 0u, shift > 31u));
    let opposite = ((a ^ b) >> 31u) == 1u;
    let sum = select(m + (kept | lost), m - (kept | lost), opposite);
    if sum == 0u { return 0u; }
    return (big & 0x80000000u) | round_sum(sum, i32(e));
}

// Rounds sum * 2^(e - 156) to nearest even. Returns the bits without sign.
fn round_sum(sum: u32, e: i32) -> u32 {
    let top = 31 - i32(countLeadingZeros(sum));
    let drop = max(top - 23, 7 - e);
    let exponent = e - 6 + drop;
    if drop <= 0 { return (sum << u32(-drop)) + (u32(exponent - 1) << 23u); }
    let kept = sum >> u32(drop);
    let rest = sum & ((1u << u32(drop)) - 1u);
    let half = 1u << u32(drop - 1);
    let up = rest > half || (rest == half && (kept & 1u) == 1u);
    return min(kept + select(0u, 1u, up) + (u32(exponent - 1) << 23u), 0x7f800000u);
}

// Returns the exponent field; 1 for subnormal numbers too.
fn field(bits: u32) -> u32 { return max((bits >> 23u) & 255u, 1u); }

fn mantissa(bits: u32) -> u32 {
    return (bits & 0x7fffffu) | select(0x800000u, 0u, ((bits >> 23u) & 255u) == 0u);
}
