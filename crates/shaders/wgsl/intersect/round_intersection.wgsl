// Rounds exact intersections to floats: the device version of `geom::exact`.

import package::intersect::line::{
    NO_INTERSECTION, ExactIntersection, intersect_exactly, is_within_limits, prepare_line, store_corners,
    store_determinant,
};
import package::lib::ieee::round_quotient;
import package::lib::integers::{
    INTERSECTIONS_OFFSET, ONE_OFFSET, PRODUCTS_OFFSET, PRODUCT_STRIDE, accumulate_product, bit_length, bits_from, clear,
    compare_magnitudes, to_sign_magnitude, words,
};

// Intersects the line with a closed triangle, and stores the result in slot 0 or 1. There is no hit unless the rounded
// t is within the ray's limits.
fn intersect_within_limits(corners: array<vec3<u32>, 3>, slot: u32) -> ExactIntersection {
    let result = intersect_exactly(corners, slot, false);
    if !result.is_hit || !is_within_limits(rounded_ratio(result)) { return NO_INTERSECTION; }
    return result;
}

// One number of an intersection, rounded once to a float, as bits. If `is_hit` is false, the line misses the triangle.
struct RoundedLongQuotient { is_hit: bool, bits: u32 }

// Intersects the line with a closed triangle, at any t. Rounds t, or the weight of the second or third corner if `side` is 1
// or 2. Overwrites the intersection in slot 0 or 1.
fn round_long_quotient(corners: array<vec3<u32>, 3>, side: u32, slot: u32) -> RoundedLongQuotient {
    prepare_line();
    var quotient = intersect_exactly(corners, slot, false);
    if !quotient.is_hit { return RoundedLongQuotient(false, 0u); }
    if side != 0u {
        store_determinant(quotient.numerator_at, side, store_corners(corners).len);
        words[quotient.numerator_at] = 0u;
        quotient.exponent = 0;
    }
    return RoundedLongQuotient(true, rounded_ratio(quotient));
}

// Returns numerator / denominator * 2^exponent, rounded once to a float, as bits: the t of an intersection, or a
// weight. A zero is positive.
fn rounded_ratio(intersection: ExactIntersection) -> u32 {
    let bits_n = bit_length(intersection.numerator_at, intersection.len);
    if bits_n == 0 { return 0u; }
    let length_difference = bits_n - bit_length(intersection.denominator_at, intersection.len);
    // Aligns both to the same length. Long division yields 26 bits of the quotient.
    let len = intersection.len + 1u;
    let dividend = PRODUCTS_OFFSET;
    let divisor = PRODUCTS_OFFSET + PRODUCT_STRIDE;
    for (var i = 0u; i < 2u; i += 1u) {
        let source = select(intersection.numerator_at, intersection.denominator_at, i == 1u);
        let shift = max(select(-length_difference, length_difference, i == 1u), 0);
        let destination = select(dividend, divisor, i == 1u);
        words[destination] = 0u;
        for (var k = 0u; k < len; k += 1u) {
            words[destination + 1u + k] = bits_from(source, intersection.len, 32 * i32(k) - shift);
        }
    }
    var quotient = 0u;
    for (var i = 0u; i < 26u; i += 1u) {
        let fits = compare_magnitudes(dividend, len, 0, divisor, len, 0) >= 0;
        quotient = 2u * quotient + select(0u, 1u, fits);
        if fits { accumulate_product(dividend, len, divisor, len, ONE_OFFSET, 1u, 1u); }
        double_magnitude(dividend, len);
    }
    let sticky = bit_length(dividend, len) != 0;
    var magnitude = 0u;
    if quotient < 0x2000000u {
        magnitude = round_quotient(quotient, sticky, length_difference + intersection.exponent + 126);
    } else {
        magnitude = round_quotient(
            quotient >> 1u, sticky || (quotient & 1u) == 1u, length_difference + intersection.exponent + 127,
        );
    }
    return select(magnitude | (words[intersection.numerator_at] << 31u), 0u, magnitude == 0u);
}

fn double_magnitude(at: u32, len: u32) {
    var carry = 0u;
    for (var i = at + 1u; i <= at + len; i += 1u) {
        let x = words[i];
        words[i] = (x << 1u) | carry;
        carry = x >> 31u;
    }
}

// Returns the weights of the second and third corner, each rounded once. The line must pass through the triangle.
fn rounded_weights(points: array<vec3<u32>, 3>) -> vec2<u32> {
    let stored = store_corners(points);
    let len = stored.len;
    let sum = INTERSECTIONS_OFFSET;
    let weights_at = vec2<u32>(INTERSECTIONS_OFFSET + 28u, INTERSECTIONS_OFFSET + 56u);
    clear(sum, len.triple);
    for (var side = 0u; side < 3u; side += 1u) {
        let destination = select(PRODUCTS_OFFSET, select(weights_at.x, weights_at.y, side == 2u), side > 0u);
        store_determinant(destination, side, len);
        accumulate_product(sum, len.triple, destination, len.triple, ONE_OFFSET, 1u, 0u);
    }
    to_sign_magnitude(sum, len.triple);
    var weights: vec2<u32>;
    for (var i = 0u; i < 2u; i += 1u) {
        words[weights_at[i]] = 0u;
        weights[i] = rounded_ratio(ExactIntersection(true, weights_at[i], sum, len.triple, 0));
    }
    return weights;
}
