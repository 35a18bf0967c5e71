// Integers of 64, 128 and 192 bits in two's complement, in registers. They suffice for the coordinates of nearly all
// triangles and rays: real models need 42 to 45 bits.

import package::lib::ieee::round_quotient;
import package::lib::integers::{add_32, mantissa_of, multiply_32, unit_of};

// Least significant words first.
struct Int192 { low: vec3<u32>, high: vec3<u32> }
struct Int64x3 { x: vec2<u32>, y: vec2<u32>, z: vec2<u32> }

// Returns a * b + c + d, which fits in 64 bits.
fn multiply_add(a: u32, b: u32, c: u32, d: u32) -> vec2<u32> {
    let p = multiply_32(a, b);
    let first = add_32(p.x, c);
    let second = add_32(first.x, d);
    return vec2<u32>(second.x, p.y + first.y + second.y);
}

fn add_64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = add_32(a.x, b.x);
    return vec2<u32>(low.x, a.y + b.y + low.y);
}

fn negate_64(a: vec2<u32>) -> vec2<u32> { return add_64(~a, vec2<u32>(1u, 0u)); }

fn sub_64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> { return add_64(a, negate_64(b)); }

// Returns all ones if the number with the highest word `high` is negative, else 0.
fn sign_mask(high: u32) -> u32 { return 0u - (high >> 31u); }

fn multiply_64(a: vec2<u32>, b: vec2<u32>) -> vec4<u32> {
    let p = multiply_add(a.x, b.x, 0u, 0u);
    let q = multiply_add(a.x, b.y, p.y, 0u);
    let r = multiply_add(a.y, b.x, q.x, 0u);
    let s = multiply_add(a.y, b.y, q.y, r.y);
    // As an unsigned word pair, a negative factor is too large by 2^64.
    let excess = add_64(b & vec2<u32>(sign_mask(a.y)), a & vec2<u32>(sign_mask(b.y)));
    let high = sub_64(s, excess);
    return vec4<u32>(p.x, r.x, high.x, high.y);
}

// a * d - b * c
fn minor_64(a: vec2<u32>, b: vec2<u32>, c: vec2<u32>, d: vec2<u32>) -> vec4<u32> {
    let p = multiply_64(a, d);
    let q = multiply_64(b, c);
    let low = sub_64(p.xy, q.xy);
    let borrow = p.y < q.y || (p.y == q.y && p.x < q.x);
    let high = sub_64(sub_64(p.zw, q.zw), vec2<u32>(select(0u, 1u, borrow), 0u));
    return vec4<u32>(low.x, low.y, high.x, high.y);
}

fn multiply_128(m: vec4<u32>, d: vec2<u32>) -> Int192 {
    let p0 = multiply_add(d.x, m.x, 0u, 0u);
    let p1 = multiply_add(d.x, m.y, p0.y, 0u);
    let p2 = multiply_add(d.x, m.z, p1.y, 0u);
    let p3 = multiply_add(d.x, m.w, p2.y, 0u);
    let q0 = multiply_add(d.y, m.x, p1.x, 0u);
    let q1 = multiply_add(d.y, m.y, p2.x, q0.y);
    let q2 = multiply_add(d.y, m.z, p3.x, q1.y);
    let q3 = multiply_add(d.y, m.w, p3.y, q2.y);
    let unsigned_product = Int192(vec3<u32>(p0.x, q0.x, q1.x), vec3<u32>(q2.x, q3.x, q3.y));
    let excess_of_m = d & vec2<u32>(sign_mask(m.w));
    let excess_of_d = m & vec4<u32>(sign_mask(d.y));
    let excess = add_192(
        Int192(vec3<u32>(0u), vec3<u32>(0u, excess_of_m)), Int192(vec3<u32>(0u, 0u, excess_of_d.x), excess_of_d.yzw),
    );
    return add_192(unsigned_product, negate_192(excess));
}

fn add_192(a: Int192, b: Int192) -> Int192 {
    let s0 = add_32(a.low.x, b.low.x);
    let s1 = add_carry(a.low.y, b.low.y, s0.y);
    let s2 = add_carry(a.low.z, b.low.z, s1.y);
    let s3 = add_carry(a.high.x, b.high.x, s2.y);
    let s4 = add_carry(a.high.y, b.high.y, s3.y);
    let s5 = add_carry(a.high.z, b.high.z, s4.y);
    return Int192(vec3<u32>(s0.x, s1.x, s2.x), vec3<u32>(s3.x, s4.x, s5.x));
}

fn add_carry(a: u32, b: u32, carry: u32) -> vec2<u32> {
    let first = add_32(a, b);
    let second = add_32(first.x, carry);
    return vec2<u32>(second.x, first.y + second.y);
}

fn negate_192(a: Int192) -> Int192 {
    return add_192(Int192(~a.low, ~a.high), Int192(vec3<u32>(1u, 0u, 0u), vec3<u32>(0u)));
}

fn select_192(a: Int192, b: Int192, takes_second: bool) -> Int192 {
    return Int192(select(a.low, b.low, takes_second), select(a.high, b.high, takes_second));
}

fn sign_192(a: Int192) -> i32 {
    if any(a.low != vec3<u32>(0u)) || any(a.high != vec3<u32>(0u)) { return select(1, -1, (a.high.z >> 31u) == 1u); }
    return 0;
}

// Returns x . (p x q). For coordinates below 2^60 the result is below 2^183. A loop keeps the instruction count low.
fn triple_product_192(given_x: Int64x3, given_p: Int64x3, given_q: Int64x3) -> Int192 {
    var x = given_x;
    var p = given_p;
    var q = given_q;
    var sum = Int192();
    for (var i = 0u; i < 3u; i += 1u) {
        sum = add_192(sum, multiply_128(minor_64(p.y, p.z, q.y, q.z), x.x));
        x = Int64x3(x.y, x.z, x.x);
        p = Int64x3(p.y, p.z, p.x);
        q = Int64x3(q.y, q.z, q.x);
    }
    return sum;
}

// Converts a finite number to a multiple of 2^unit. `unit` is at most the number's own unit and at least that minus 38.
fn to_fixed_point(bits: u32, unit: i32) -> vec2<u32> {
    let mantissa = mantissa_of(bits);
    if mantissa == 0u { return vec2<u32>(0u); }
    let shift = u32(unit_of(bits) - unit);
    let bit_shift = shift & 31u;
    let low = mantissa << bit_shift;
    let magnitude = select(
        vec2<u32>(low, select(mantissa >> ((32u - bit_shift) & 31u), 0u, bit_shift == 0u)), vec2<u32>(0u, low), shift >= 32u,
    );
    if (bits >> 31u) == 1u { return negate_64(magnitude); }
    return magnitude;
}

// Approximates a positive number by mantissa * 2^exponent. The mantissa is in [1, 2); the relative error is below 2^-23.
struct Approximation { mantissa: f32, exponent: i32 }

fn approximate_192(n: Int192) -> Approximation {
    var high = n.low.x;
    var next = 0u;
    var exponent = 0;
    if n.low.y != 0u { high = n.low.y; next = n.low.x; exponent = 32; }
    if n.low.z != 0u { high = n.low.z; next = n.low.y; exponent = 64; }
    if n.high.x != 0u { high = n.high.x; next = n.low.z; exponent = 96; }
    if n.high.y != 0u { high = n.high.y; next = n.high.x; exponent = 128; }
    if n.high.z != 0u { high = n.high.z; next = n.high.y; exponent = 160; }
    let shift = countLeadingZeros(high);
    let low_bits = select(next >> ((32u - shift) & 31u), 0u, shift == 0u);
    // 24 bits are exact in f32.
    return Approximation(f32(((high << shift) | low_bits) >> 8u) * 1.1920928955078125e-7, exponent + 31 - i32(shift));
}

// Returns n * 2^shift modulo 2^192.
fn shift_left_192(n: Int192, shift: u32) -> Int192 {
    var result = n;
    for (var i = 0u; i < (shift >> 5u); i += 1u) {
        result = Int192(vec3<u32>(0u, result.low.xy), vec3<u32>(result.low.z, result.high.xy));
    }
    let bit_shift = shift & 31u;
    if bit_shift == 0u { return result; }
    let up = vec3<u32>(bit_shift);
    let down = vec3<u32>(32u - bit_shift);
    let low = (result.low << up) | (vec3<u32>(0u, result.low.xy) >> down);
    return Int192(low, (result.high << up) | (vec3<u32>(result.low.z, result.high.xy) >> down));
}

// Returns n * k modulo 2^192, for a positive n.
fn multiply_192_by_word(n: Int192, k: u32) -> Int192 {
    let p0 = multiply_add(n.low.x, k, 0u, 0u);
    let p1 = multiply_add(n.low.y, k, p0.y, 0u);
    let p2 = multiply_add(n.low.z, k, p1.y, 0u);
    let p3 = multiply_add(n.high.x, k, p2.y, 0u);
    let p4 = multiply_add(n.high.y, k, p3.y, 0u);
    let p5 = multiply_add(n.high.z, k, p4.y, 0u);
    return Int192(vec3<u32>(p0.x, p1.x, p2.x), vec3<u32>(p3.x, p4.x, p5.x));
}

fn sub_192(a: Int192, b: Int192) -> Int192 { return add_192(a, negate_192(b)); }

fn is_negative_192(a: Int192) -> bool { return (a.high.z >> 31u) == 1u; }

fn abs_192(a: Int192) -> Int192 { return select_192(a, negate_192(a), is_negative_192(a)); }

// Rounds n / d * 2^exponent once to a float and returns its bits. Both are below 2^186; n is not negative, d is positive.
fn round_quotient_192(n: Int192, d: Int192, exponent: i32) -> u32 {
    if sign_192(n) == 0 { return 0u; }
    let approximate_n = approximate_192(n);
    let approximate_d = approximate_192(d);
    // Aligns the leading bits of both to bit 185. The dividend and the products below wrap modulo 2^192. Their
    // difference fits, because it is less than 16 times the divisor.
    let a = shift_left_192(n, u32(185 - approximate_n.exponent));
    let b = shift_left_192(d, u32(185 - approximate_d.exponent));
    let is_below_one = is_negative_192(sub_192(a, b));
    let shift = select(24u, 25u, is_below_one);
    let dividend = shift_left_192(a, shift);
    // The estimate is off by less than 16. The remainder corrects it.
    var quotient = u32(approximate_n.mantissa / approximate_d.mantissa * select(16777216.0, 33554432.0, is_below_one));
    var remainder = sub_192(dividend, multiply_192_by_word(b, quotient));
    let step = i32(floor(f32(bitcast<i32>(remainder.high.z)) / f32(b.high.z)));
    quotient = bitcast<u32>(bitcast<i32>(quotient) + step);
    remainder = sub_192(dividend, multiply_192_by_word(b, quotient));
    if is_negative_192(remainder) {
        remainder = add_192(remainder, b);
        quotient -= 1u;
    }
    let reduced = sub_192(remainder, b);
    if !is_negative_192(reduced) {
        remainder = reduced;
        quotient += 1u;
    }
    let quotient_exponent = approximate_n.exponent - approximate_d.exponent + exponent;
    return round_quotient(quotient, sign_192(remainder) != 0, quotient_exponent + select(127, 126, is_below_one));
}
