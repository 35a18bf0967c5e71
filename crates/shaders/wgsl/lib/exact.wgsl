// Integer arithmetic on floats: exact signs of differences of products, and IEEE sums and products of subnormal
// numbers.

import package::lib::ieee::{decode_float, round_quotient};
import package::lib::integers::mantissa_of;

// A product of two 24-bit numbers, as two parts of 24 bits.
struct Product48 { high: u32, low: u32 }

// Returns the exact product of two 24-bit numbers.
fn multiply_24(a: u32, b: u32) -> Product48 {
    let a1 = a >> 12u;
    let a0 = a & 0xfffu;
    let b1 = b >> 12u;
    let b0 = b & 0xfffu;
    let middle = a1 * b0 + a0 * b1;
    let low = a0 * b0 + ((middle & 0xfffu) << 12u);
    let high = a1 * b1 + (middle >> 12u) + (low >> 24u);
    return Product48(high, low & 0xffffffu);
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
    let pa = decode_float(xa);
    let pb = decode_float(xb);
    let pc = decode_float(xc);
    let pd = decode_float(xd);
    var left = multiply_24(pa.mantissa, pb.mantissa);
    var right = multiply_24(pc.mantissa, pd.mantissa);
    var left_exponent = pa.exponent + pb.exponent;
    var right_exponent = pc.exponent + pd.exponent;
    // Both products are in [2^46, 2^48): normalize them to [2^47, 2^48).
    if left.high < 0x800000u {
        left = doubled(left);
        left_exponent -= 1;
    }
    if right.high < 0x800000u {
        right = doubled(right);
        right_exponent -= 1;
    }
    if left_exponent != right_exponent {
        return select(-1, 1, left_exponent > right_exponent);
    }
    if left.high != right.high {
        return select(-1, 1, left.high > right.high);
    }
    return select(0, 1, left.low > right.low) - select(0, 1, left.low < right.low);
}

fn doubled(w: Product48) -> Product48 {
    return Product48((w.high << 1u) | (w.low >> 23u), (w.low << 1u) & 0xffffffu);
}

// Returns the exact sign of a * b - c * d for finite operands.
fn sign_of_difference(a: f32, b: f32, c: f32, d: f32) -> i32 {
    let left_negative = ((bitcast<u32>(a) ^ bitcast<u32>(b)) >> 31u) == 1u;
    let right_negative = ((bitcast<u32>(c) ^ bitcast<u32>(d)) >> 31u) == 1u;
    // Compares bits, because a device may flush subnormals in float comparisons.
    let left_zero = (bitcast<u32>(a) << 1u) == 0u || (bitcast<u32>(b) << 1u) == 0u;
    let right_zero = (bitcast<u32>(c) << 1u) == 0u || (bitcast<u32>(d) << 1u) == 0u;
    let left_sign = select(select(1, -1, left_negative), 0, left_zero);
    let right_sign = select(select(1, -1, right_negative), 0, right_zero);
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
    let pa = decode_float(xa);
    let pb = decode_float(xb);
    let product = multiply_24(pa.mantissa, pb.mantissa);
    let has_carry = product.high >= 0x800000u;
    let dropped_bits = select(22u, 23u, has_carry);
    let quotient = (product.high << (24u - dropped_bits)) | (product.low >> dropped_bits);
    let remainder = product.low & ((1u << dropped_bits) - 1u);
    return sign | round_quotient(quotient, remainder != 0u, pa.exponent + pb.exponent - select(127, 126, has_carry));
}

fn soft_add(a: u32, b: u32) -> u32 {
    let is_swapped = (a & 0x7fffffffu) < (b & 0x7fffffffu);
    let larger = select(a, b, is_swapped);
    let smaller = select(b, a, is_swapped);
    if (larger & 0x7fffffffu) == 0u { return larger & smaller; }
    let exponent = exponent_field(larger);
    // Keeps six bits below the last place. The lowest one is sticky: it also records the bits shifted out.
    let larger_mantissa = mantissa_of(larger) << 6u;
    let shift = exponent - exponent_field(smaller);
    let smaller_mantissa = mantissa_of(smaller) << 6u;
    let aligned = select(smaller_mantissa >> (shift & 31u), 0u, shift > 31u);
    let sticky = select(0u, 1u, select((aligned << (shift & 31u)) != smaller_mantissa, smaller_mantissa != 0u, shift > 31u));
    let is_difference = ((a ^ b) >> 31u) == 1u;
    let sum = select(larger_mantissa + (aligned | sticky), larger_mantissa - (aligned | sticky), is_difference);
    if sum == 0u { return 0u; }
    return (larger & 0x80000000u) | round_sum(sum, i32(exponent));
}

// Rounds sum * 2^(e - 156) to nearest even. Returns the bits without sign.
fn round_sum(sum: u32, e: i32) -> u32 {
    let top_bit = 31 - i32(countLeadingZeros(sum));
    let dropped_bits = max(top_bit - 23, 7 - e);
    let exponent = e - 6 + dropped_bits;
    if dropped_bits <= 0 { return (sum << u32(-dropped_bits)) + (u32(exponent - 1) << 23u); }
    let truncated = sum >> u32(dropped_bits);
    let remainder = sum & ((1u << u32(dropped_bits)) - 1u);
    let half = 1u << u32(dropped_bits - 1);
    let rounds_up = remainder > half || (remainder == half && (truncated & 1u) == 1u);
    return min(truncated + select(0u, 1u, rounds_up) + (u32(exponent - 1) << 23u), 0x7f800000u);
}

// Returns the exponent field; 1 for subnormal numbers too.
fn exponent_field(bits: u32) -> u32 { return max((bits >> 23u) & 255u, 1u); }
