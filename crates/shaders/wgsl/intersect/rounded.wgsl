// Rounds exact intersections to floats: the device version of the method `rounded` of the crate `exact`.

import package::intersect::line::{NOT_MET, Crossing, cross_exactly, is_within, put_corners, put_side};
import package::lib::ieee::round_quotient;
import package::lib::integers::{
    INTERSECTIONS_OFFSET, ONE_OFFSET, PRODUCTS_OFFSET, PRODUCT_STRIDE, accumulate_product, bit_length, bits_from, clear,
    compare_magnitudes, to_sign_magnitude, words,
};

// Computes the crossing of the line with a closed triangle in one of two slots. Its rounded t must be within the ray's limits.
fn meet_exactly(corners: array<vec3<u32>, 3>, slot: u32) -> Crossing {
    let made = cross_exactly(corners, slot, false);
    if !made.met || !is_within(rounded(made)) { return NOT_MET; }
    return made;
}

// Returns a crossing's t, rounded once to a float, as bits. A zero is positive.
fn rounded(c: Crossing) -> u32 {
    let bits_n = bit_length(c.numerator, c.len);
    if bits_n == 0 { return 0u; }
    let up = bits_n - bit_length(c.denominator, c.len);
    // Aligns both to the same length. Long division yields 26 bits of the quotient.
    let len = c.len + 1u;
    let a = PRODUCTS_OFFSET;
    let b = PRODUCTS_OFFSET + PRODUCT_STRIDE;
    for (var i = 0u; i < 2u; i += 1u) {
        let side = select(c.numerator, c.denominator, i == 1u);
        let by = max(select(-up, up, i == 1u), 0);
        let to = select(a, b, i == 1u);
        words[to] = 0u;
        for (var k = 0u; k < len; k += 1u) { words[to + 1u + k] = bits_from(side, c.len, 32 * i32(k) - by); }
    }
    var quotient = 0u;
    for (var i = 0u; i < 26u; i += 1u) {
        let fits = compare_magnitudes(a, len, 0, b, len, 0) >= 0;
        quotient = 2u * quotient + select(0u, 1u, fits);
        if fits { accumulate_product(a, len, b, len, ONE_OFFSET, 1u, 1u); }
        double_up(a, len);
    }
    let sticky = bit_length(a, len) != 0;
    var size = 0u;
    if quotient < 0x2000000u {
        size = round_quotient(quotient, sticky, up + c.exponent + 126);
    } else {
        size = round_quotient(quotient >> 1u, sticky || (quotient & 1u) == 1u, up + c.exponent + 127);
    }
    return select(size | (words[c.numerator] << 31u), 0u, size == 0u);
}

// Doubles a magnitude.
fn double_up(at: u32, len: u32) {
    var carry = 0u;
    for (var i = at + 1u; i <= at + len; i += 1u) {
        let x = words[i];
        words[i] = (x << 1u) | carry;
        carry = x >> 31u;
    }
}

// Returns the weights of the second and third corner, each rounded once. The line must pass through the triangle.
fn weights_of(points: array<vec3<u32>, 3>) -> vec2<u32> {
    let placed = put_corners(points);
    let len = placed.len;
    let sum = INTERSECTIONS_OFFSET;
    let sides = vec2<u32>(INTERSECTIONS_OFFSET + 28u, INTERSECTIONS_OFFSET + 56u);
    clear(sum, len.triple);
    for (var side = 0u; side < 3u; side += 1u) {
        let to = select(PRODUCTS_OFFSET, select(sides.x, sides.y, side == 2u), side > 0u);
        put_side(to, side, len);
        accumulate_product(sum, len.triple, to, len.triple, ONE_OFFSET, 1u, 0u);
    }
    to_sign_magnitude(sum, len.triple);
    var weights: vec2<u32>;
    for (var i = 0u; i < 2u; i += 1u) {
        words[sides[i]] = 0u;
        weights[i] = rounded(Crossing(true, sides[i], sum, len.triple, 0));
    }
    return weights;
}
