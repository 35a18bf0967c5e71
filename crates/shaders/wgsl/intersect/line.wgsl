// Exact ray-triangle intersection in multi-word integers: the device version of `geom::exact`.

import package::geometry::units::ordered;
import package::lib::integers::{
    COORDINATE_STRIDE, CORNERS_OFFSET, CROSS_OFFSET, DIRECTION_OFFSET, INTERSECTIONS_OFFSET, ONE_OFFSET, PRODUCTS_OFFSET,
    PRODUCT_STRIDE, accumulate_product, add_shifted, clear, compare_magnitudes, mantissa_of, sign_of_number,
    to_sign_magnitude, unit_of, words,
};

// A ray as an exact line. Origin and direction, times 2^scale_exponent, are in the units of the corners. The functions
// below multiply only the origin, so they multiply the resulting t by 2^-scale_exponent. The direction's components are
// integers of `bits` bits, or `len` limbs, times 2^unit.
struct Line {
    origin: vec3<u32>,
    direction: vec3<u32>,
    t_min: u32,
    t_max: u32,
    scale_exponent: i32,
    unit: i32,
    bits: i32,
    len: u32,
}

// t = numerator / denominator * 2^exponent. The denominator is positive. `numerator_at` and `denominator_at` are
// offsets of these numbers in `words`.
struct ExactIntersection { is_hit: bool, numerator_at: u32, denominator_at: u32, len: u32, exponent: i32 }

const NO_INTERSECTION: ExactIntersection = ExactIntersection(false, 0u, 0u, 0u, 0);
// An empty range of units: above and below every exponent.
const EMPTY_RANGE: vec2<i32> = vec2<i32>(10000, -10000);

var<private> line: Line;

// Extends a range of units by those of a point times 2^exponent.
fn extend_range(range: vec2<i32>, point: vec3<u32>, exponent: i32) -> vec2<i32> {
    var wider = range;
    for (var i = 0u; i < 3u; i += 1u) {
        if (point[i] & 0x7fffffffu) != 0u {
            let unit = unit_of(point[i]) + exponent;
            wider = vec2<i32>(min(wider.x, unit), max(wider.y, unit));
        }
    }
    return wider;
}

// Returns the number of limbs for `bits` bits.
fn limbs(bits: i32) -> u32 { return u32(bits + 31) >> 5u; }

// Sets the current line. The direction must not be zero.
fn set_line(origin: vec3<u32>, direction: vec3<u32>, t_min: u32, t_max: u32, scale_exponent: i32) {
    let units = extend_range(EMPTY_RANGE, direction, 0);
    let bits = units.y - units.x + 24;
    line = Line(origin, direction, t_min, t_max, scale_exponent, units.x, bits, limbs(bits));
}

// Converts the direction to integers of any length, and stores the number 1. Must be called before
// determinants are stored.
fn prepare_line() {
    words[ONE_OFFSET] = 0u;
    words[ONE_OFFSET + 1u] = 1u;
    for (var i = 0u; i < 3u; i += 1u) {
        let at = DIRECTION_OFFSET + COORDINATE_STRIDE * i;
        clear(at, line.len);
        let x = line.direction[i];
        if (x & 0x7fffffffu) != 0u { add_shifted(at, line.len, mantissa_of(x), u32(unit_of(x) - line.unit), false); }
        words[at] = x >> 31u;
    }
}

// Returns the least and the greatest unit of a triangle's coordinates and the ray's start.
fn unit_range(points: array<vec3<u32>, 3>) -> vec2<i32> {
    var units = extend_range(EMPTY_RANGE, line.origin, line.scale_exponent);
    units = extend_range(extend_range(extend_range(units, points[0], 0), points[1], 0), points[2], 0);
    return select(units, vec2<i32>(0), units.x > units.y);
}

// Stores a coordinate relative to the ray's start, in units of 2^unit.
fn store_difference(at: u32, len: u32, x: u32, origin: u32, unit: i32) {
    clear(at, len);
    if (x & 0x7fffffffu) != 0u { add_shifted(at, len, mantissa_of(x), u32(unit_of(x) - unit), (x >> 31u) == 1u); }
    if (origin & 0x7fffffffu) != 0u {
        let shift = u32(unit_of(origin) + line.scale_exponent - unit);
        add_shifted(at, len, mantissa_of(origin), shift, (origin >> 31u) == 0u);
    }
    to_sign_magnitude(at, len);
}

struct Lengths { coordinate: u32, cross: u32, triple: u32 }

// Stores x . (p x q) of three vectors. Each axis takes three steps.
fn triple(at: u32, x: u32, x_len: u32, p: u32, q: u32, len: Lengths) {
    clear(at, len.triple);
    for (var index = 0u; index < 9u; index += 1u) {
        let i = index / 3u;
        let step = index % 3u;
        let j = COORDINATE_STRIDE * ((i + 1u) % 3u);
        let k = COORDINATE_STRIDE * ((i + 2u) % 3u);
        if step == 0u { clear(CROSS_OFFSET, len.cross); }
        let is_cross_product = step < 2u;
        let a = select(x + COORDINATE_STRIDE * i, p + select(j, k, step == 1u), is_cross_product);
        let b = select(CROSS_OFFSET, q + select(k, j, step == 1u), is_cross_product);
        accumulate_product(
            select(at, CROSS_OFFSET, is_cross_product), select(len.triple, len.cross, is_cross_product),
            a, select(x_len, len.coordinate, is_cross_product), b, select(len.cross, len.coordinate, is_cross_product), select(0u, 1u, step == 1u),
        );
        if step == 1u { to_sign_magnitude(CROSS_OFFSET, len.cross); }
    }
    to_sign_magnitude(at, len.triple);
}

// The lengths of numbers computed from a triangle's corners, and their unit.
struct StoredCorners { len: Lengths, unit: i32 }

fn store_corners(corners: array<vec3<u32>, 3>) -> StoredCorners {
    var points = corners;
    let units = unit_range(points);
    let bits = units.y - units.x + 25;
    let len = Lengths(limbs(bits + 1), limbs(2 * bits + 2), limbs(2 * bits + max(bits, line.bits) + 6));
    for (var v = 0u; v < 9u; v += 1u) {
        store_difference(
            CORNERS_OFFSET + COORDINATE_STRIDE * v, len.coordinate, points[v / 3u][v % 3u], line.origin[v % 3u], units.x,
        );
    }
    return StoredCorners(len, units.x);
}

// The two corners that U, V or W is computed from. N is a . (c x b).
struct EdgeEnds { first: u32, second: u32 }

fn edge_ends(side: u32) -> EdgeEnds {
    let a = CORNERS_OFFSET;
    let b = CORNERS_OFFSET + 3u * COORDINATE_STRIDE;
    let c = CORNERS_OFFSET + 6u * COORDINATE_STRIDE;
    return EdgeEnds(select(select(c, a, side == 1u), b, side == 2u), select(select(b, c, side == 1u), a, side == 2u));
}

// Stores U, V or W of the stored corners, or N if `side` is 3.
fn store_determinant(to: u32, side: u32, len: Lengths) {
    let ends = edge_ends(side);
    let last = side == 3u;
    triple(
        to, select(DIRECTION_OFFSET, CORNERS_OFFSET, last), select(line.len, len.coordinate, last), ends.first, ends.second, len,
    );
}

// Intersects the line with a closed triangle, at any t, and stores the result in slot 0 or 1. If `perturbs` is set, the line's
// start is first moved by an infinitely small amount.
fn intersect_exactly(corners: array<vec3<u32>, 3>, slot: u32, perturbs: bool) -> ExactIntersection {
    let stored = store_corners(corners);
    let numbers = INTERSECTIONS_OFFSET + 56u * slot;
    let exponent = stored.unit - line.scale_exponent - line.unit;
    let result = ExactIntersection(true, numbers, numbers + 28u, stored.len.triple, exponent);
    if !compute_determinants(result, stored.len, perturbs) { return NO_INTERSECTION; }
    return result;
}

// Computes U, V and W, whose signs decide the hit and whose sum is the denominator. Then computes N, the numerator.
// Returns whether the line hits the triangle.
fn compute_determinants(result: ExactIntersection, len: Lengths, perturbs: bool) -> bool {
    var positive = false;
    var negative = false;
    clear(result.denominator_at, len.triple);
    for (var side = 0u; side < 4u; side += 1u) {
        let last = side == 3u;
        store_determinant(select(PRODUCTS_OFFSET, result.numerator_at, last), side, len);
        if last { break; }
        var s = sign_of_number(PRODUCTS_OFFSET, len.triple);
        accumulate_product(result.denominator_at, len.triple, PRODUCTS_OFFSET, len.triple, ONE_OFFSET, 1u, 0u);
        if s == 0 && perturbs {
            s = perturbed_edge_sign(side, len);
            if s == 0 { return false; }
        }
        positive = positive || s > 0;
        negative = negative || s < 0;
        if positive && negative { return false; }
    }
    to_sign_magnitude(result.denominator_at, len.triple);
    words[result.numerator_at] ^= words[result.denominator_at];
    words[result.denominator_at] = 0u;
    return sign_of_number(result.denominator_at, len.triple) != 0;
}

// Returns on which side of an edge a line through the edge passes if the line's start is moved by (e, e^2, e^3) for an
// infinitesimal e. This is the first non-zero sign among the components of the cross product of direction and edge.
// Returns 0 if the edge is parallel to the line.
fn perturbed_edge_sign(side: u32, len: Lengths) -> i32 {
    let ends = edge_ends(side);
    for (var i = 0u; i < 3u; i += 1u) {
        let j = COORDINATE_STRIDE * ((i + 1u) % 3u);
        let k = COORDINATE_STRIDE * ((i + 2u) % 3u);
        clear(PRODUCTS_OFFSET, len.triple);
        for (var term = 0u; term < 4u; term += 1u) {
            let turned = (term & 1u) == 1u;
            let corner = select(ends.second, ends.first, term >= 2u) + select(k, j, turned);
            let flip = select(0u, 1u, turned != (term >= 2u));
            accumulate_product(
                PRODUCTS_OFFSET, len.triple, DIRECTION_OFFSET + select(j, k, turned), line.len, corner, len.coordinate, flip,
            );
        }
        to_sign_magnitude(PRODUCTS_OFFSET, len.triple);
        let s = sign_of_number(PRODUCTS_OFFSET, len.triple);
        if s != 0 { return s; }
    }
    return 0;
}

// Returns whether a rounded t, as bits, is within the ray's limits.
fn is_within_limits(t: u32) -> bool { return ordered(t) > ordered(line.t_min) && ordered(t) < ordered(line.t_max); }

// Returns the order of two intersections along the line: -1, 0 or 1.
fn compare_intersections(a: ExactIntersection, b: ExactIntersection) -> i32 {
    let sign_a = sign_of_number(a.numerator_at, a.len);
    let sign_b = sign_of_number(b.numerator_at, b.len);
    if sign_a != sign_b || sign_a == 0 { return sign(sign_a - sign_b); }
    let len = a.len + b.len;
    for (var i = 0u; i < 2u; i += 1u) {
        let at = PRODUCTS_OFFSET + PRODUCT_STRIDE * i;
        clear(at, len);
        let first = i == 0u;
        let n = select(b.numerator_at, a.numerator_at, first);
        // Uses the magnitude. The denominator is positive.
        let flip = words[n];
        accumulate_product(
            at,
            len,
            n,
            select(b.len, a.len, first),
            select(a.denominator_at, b.denominator_at, first),
            select(a.len, b.len, first),
            flip,
        );
    }
    return sign_a * compare_magnitudes(PRODUCTS_OFFSET, len, a.exponent, PRODUCTS_OFFSET + PRODUCT_STRIDE, len, b.exponent);
}
