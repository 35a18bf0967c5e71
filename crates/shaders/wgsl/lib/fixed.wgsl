// Integers of 64, 128 and 192 bits in two's complement, held in registers. They suffice for the coordinates of nearly all
// triangles and rays: real models need 42 to 45 bits.

import package::lib::ieee::round_quotient;
import package::lib::integers::{add_32, mantissa_of, multiply_32, unit_of};

// Least significant words first.
struct Whole192 { low: vec3<u32>, high: vec3<u32> }
struct Vector64 { x: vec2<u32>, y: vec2<u32>, z: vec2<u32> }

// Returns a * b + c + d, which fits in 64 bits.
fn multiply_add(a: u32, b: u32, c: u32, d: u32) -> vec2<u32> {
    let p = multiply_32(a, b);
    let one = add_32(p.x, c);
    let two = add_32(one.x, d);
    return vec2<u32>(two.x, p.y + one.y + two.y);
}

fn add_64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = add_32(a.x, b.x);
    return vec2<u32>(low.x, a.y + b.y + low.y);
}

fn negated_64(a: vec2<u32>) -> vec2<u32> { return add_64(~a, vec2<u32>(1u, 0u)); }

fn sub_64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> { return add_64(a, negated_64(b)); }

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

fn multiply_128(m: vec4<u32>, d: vec2<u32>) -> Whole192 {
    let p0 = multiply_add(d.x, m.x, 0u, 0u);
    let p1 = multiply_add(d.x, m.y, p0.y, 0u);
    let p2 = multiply_add(d.x, m.z, p1.y, 0u);
    let p3 = multiply_add(d.x, m.w, p2.y, 0u);
    let q0 = multiply_add(d.y, m.x, p1.x, 0u);
    let q1 = multiply_add(d.y, m.y, p2.x, q0.y);
    let q2 = multiply_add(d.y, m.z, p3.x, q1.y);
    let q3 = multiply_add(d.y, m.w, p3.y, q2.y);
    let whole = Whole192(vec3<u32>(p0.x, q0.x, q1.x), vec3<u32>(q2.x, q3.x, q3.y));
    let of_m = d & vec2<u32>(sign_mask(m.w));
    let of_d = m & vec4<u32>(sign_mask(d.y));
    let excess = add_192(Whole192(vec3<u32>(0u), vec3<u32>(0u, of_m)), Whole192(vec3<u32>(0u, 0u, of_d.x), of_d.yzw));
    return add_192(whole, negated_192(excess));
}

fn add_192(a: Whole192, b: Whole192) -> Whole192 {
    let s0 = add_32(a.low.x, b.low.x);
    let s1 = add_carry(a.low.y, b.low.y, s0.y);
    let s2 = add_carry(a.low.z, b.low.z, s1.y);
    let s3 = add_carry(a.high.x, b.high.x, s2.y);
    let s4 = add_carry(a.high.y, b.high.y, s3.y);
    let s5 = add_carry(a.high.z, b.high.z, s4.y);
    return Whole192(vec3<u32>(s0.x, s1.x, s2.x), vec3<u32>(s3.x, s4.x, s5.x));
}

fn add_carry(a: u32, b: u32, carry: u32) -> vec2<u32> {
    let one = add_32(a, b);
    let two = add_32(one.x, carry);
    return vec2<u32>(two.x, one.y + two.y);
}

fn negated_192(a: Whole192) -> Whole192 {
    return add_192(Whole192(~a.low, ~a.high), Whole192(vec3<u32>(1u, 0u, 0u), vec3<u32>(0u)));
}

fn sign_192(a: Whole192) -> i32 {
    if any(a.low != vec3<u32>(0u)) || any(a.high != vec3<u32>(0u)) { return select(1, -1, (a.high.z >> 31u) == 1u); }
    return 0;
}

// Returns x . (p x q). For coordinates below 2^60 the result is below 2^183. A loop keeps the instruction count low.
fn triple_192(given_x: Vector64, given_p: Vector64, given_q: Vector64) -> Whole192 {
    var x = given_x;
    var p = given_p;
    var q = given_q;
    var sum = Whole192();
    for (var i = 0u; i < 3u; i += 1u) {
        sum = add_192(sum, multiply_128(minor_64(p.y, p.z, q.y, q.z), x.x));
        x = Vector64(x.y, x.z, x.x);
        p = Vector64(p.y, p.z, p.x);
        q = Vector64(q.y, q.z, q.x);
    }
    return sum;
}

// Converts a finite number to a multiple of 2^unit. `unit` is at most the number's own unit and at least that minus 38.
fn in_units(bits: u32, unit: i32) -> vec2<u32> {
    let mantissa = mantissa_of(bits);
    if mantissa == 0u { return vec2<u32>(0u); }
    let shift = u32(unit_of(bits) - unit);
    let within = shift & 31u;
    let low = mantissa << within;
    let size = select(vec2<u32>(low, select(mantissa >> ((32u - within) & 31u), 0u, within == 0u)), vec2<u32>(0u, low), shift >= 32u);
    if (bits >> 31u) == 1u { return negated_64(size); }
    return size;
}

// Approximates a positive number by mantissa * 2^exponent. The mantissa is in [1, 2); the relative error is below 2^-23.
struct About { mantissa: f32, exponent: i32 }

fn about_192(n: Whole192) -> About {
    var high = n.low.x;
    var next = 0u;
    var place = 0;
    if n.low.y != 0u { high = n.low.y; next = n.low.x; place = 32; }
    if n.low.z != 0u { high = n.low.z; next = n.low.y; place = 64; }
    if n.high.x != 0u { high = n.high.x; next = n.low.z; place = 96; }
    if n.high.y != 0u { high = n.high.y; next = n.high.x; place = 128; }
    if n.high.z != 0u { high = n.high.z; next = n.high.y; place = 160; }
    let shift = countLeadingZeros(high);
    let rest = select(next >> ((32u - shift) & 31u), 0u, shift == 0u);
    // 24 bits are exact in f32.
    return About(f32(((high << shift) | rest) >> 8u) * 1.1920928955078125e-7, place + 31 - i32(shift));
}

// Returns a / b * 2^exponent, with a relative error below 2^-20.
fn quotient_about(a: About, b: About, exponent: i32) -> About {
    let m = a.mantissa / b.mantissa;
    let e = a.exponent - b.exponent + exponent;
    if m < 1.0 { return About(m * 2.0, e - 1); }
    return About(min(m, 1.99999988), e);
}

// Compares two approximations. Returns -1 or 1 if they differ by more than their errors, else 0.
fn compare_about(a: About, b: About) -> i32 {
    let apart = a.exponent - b.exponent;
    if abs(apart) > 1 { return sign(apart); }
    let x = select(a.mantissa, 2.0 * a.mantissa, apart == 1);
    let y = select(b.mantissa, 2.0 * b.mantissa, apart == -1);
    // Mantissas close to each other are at most slightly above 2, and each has a relative error of at most 2^-20.
    if abs(x - y) < 7.62939453125e-6 { return 0; }
    return select(-1, 1, x > y);
}

// Returns n * 2^by modulo 2^192.
fn shifted_192(n: Whole192, by: u32) -> Whole192 {
    var w = n;
    for (var i = 0u; i < (by >> 5u); i += 1u) {
        w = Whole192(vec3<u32>(0u, w.low.xy), vec3<u32>(w.low.z, w.high.xy));
    }
    let within = by & 31u;
    if within == 0u { return w; }
    let up = vec3<u32>(within);
    let down = vec3<u32>(32u - within);
    let low = (w.low << up) | (vec3<u32>(0u, w.low.xy) >> down);
    return Whole192(low, (w.high << up) | (vec3<u32>(w.low.z, w.high.xy) >> down));
}

// Returns n * k modulo 2^192, for a positive n.
fn times_192(n: Whole192, k: u32) -> Whole192 {
    let p0 = multiply_add(n.low.x, k, 0u, 0u);
    let p1 = multiply_add(n.low.y, k, p0.y, 0u);
    let p2 = multiply_add(n.low.z, k, p1.y, 0u);
    let p3 = multiply_add(n.high.x, k, p2.y, 0u);
    let p4 = multiply_add(n.high.y, k, p3.y, 0u);
    let p5 = multiply_add(n.high.z, k, p4.y, 0u);
    return Whole192(vec3<u32>(p0.x, p1.x, p2.x), vec3<u32>(p3.x, p4.x, p5.x));
}

fn sub_192(a: Whole192, b: Whole192) -> Whole192 { return add_192(a, negated_192(b)); }

fn is_negative_192(a: Whole192) -> bool { return (a.high.z >> 31u) == 1u; }

fn size_192(a: Whole192) -> Whole192 {
    if is_negative_192(a) { return negated_192(a); }
    return a;
}

// Rounds n / d * 2^exponent once to a float and returns its bits. Both are below 2^186; n is not negative, d is positive.
fn rounded_192(n: Whole192, d: Whole192, exponent: i32) -> u32 {
    if sign_192(n) == 0 { return 0u; }
    let about_n = about_192(n);
    let about_d = about_192(d);
    // Aligns the leading bits of both. Six bits remain for the rest of the division.
    let a = shifted_192(n, u32(185 - about_n.exponent));
    let b = shifted_192(d, u32(185 - about_d.exponent));
    let below = is_negative_192(sub_192(a, b));
    let by = select(24u, 25u, below);
    let whole = shifted_192(a, by);
    // The estimate is off by less than 16. The remainder corrects it.
    var value = u32(about_n.mantissa / about_d.mantissa * select(16777216.0, 33554432.0, below));
    var rest = sub_192(whole, times_192(b, value));
    let step = i32(floor(f32(bitcast<i32>(rest.high.z)) / f32(b.high.z)));
    value = bitcast<u32>(bitcast<i32>(value) + step);
    rest = sub_192(whole, times_192(b, value));
    if is_negative_192(rest) {
        rest = add_192(rest, b);
        value -= 1u;
    }
    let less = sub_192(rest, b);
    if !is_negative_192(less) {
        rest = less;
        value += 1u;
    }
    let up = about_n.exponent - about_d.exponent + exponent;
    return round_quotient(value, sign_192(rest) != 0, up + select(127, 126, below));
}
