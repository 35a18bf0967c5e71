// Traversal for extreme rays, with a coarse filter and multi-word integers: see "Extreme rays" in docs/design/hits.md.

import package::geometry::node::{LEAF, NO_NODE, child_row, first_triangle_of, second_triangle_of};
import package::geometry::ray::{MISS, are_negative, each_away_from_zero};
import package::geometry::record::NO_TRIANGLE;
import package::geometry::triangle::points_of;
import package::geometry::units::{bits_from_ordered, exponent_of, is_finite, ordered, power_of_two, scale_bits, scale_point};
import package::intersect::line::{
    ExactIntersection, compare_intersections, intersect_exactly, is_within_limits, line, prepare_line,
};
import package::intersect::round_intersection::{rounded_ratio, rounded_weights};
import package::lib::buffers::{counts, nodes, records};
import package::lib::counters::{HIT_COUNT, UNDECIDED_RAYS};
import package::lib::integers::INTERSECTIONS_OFFSET;
import package::lib::params::params;

// A conservative filter for boxes and triangles of any size, in floats scaled so that the largest is close to 1.

// Returns the largest of `given` and the exponent fields of a point's coordinates, each field plus `shift`. Zeros are ignored.
// Subnormal numbers have field 1.
fn max_exponent_field(given: i32, point: vec3<u32>, shift: i32) -> i32 {
    var most = given;
    for (var i = 0u; i < 3u; i += 1u) {
        let magnitude = point[i] & 0x7fffffffu;
        if magnitude != 0u { most = max(most, max(i32(magnitude >> 23u), 1) + shift); }
    }
    return most;
}

// Less than every exponent field.
const NO_FIELD: i32 = -1000;

// The direction scaled so that its largest component is in [1, 2), and the exponent of the scale.
var<private> coarse_direction: vec3<f32>;
var<private> coarse_exponent: i32;
// 1 / d per axis, with d pushed away from zero.
var<private> coarse_inverse: vec3<f32>;

// Prepares the filter for the current line.
fn prepare_coarse_filter() {
    coarse_exponent = max_exponent_field(NO_FIELD, line.direction, 0) - 127;
    if coarse_exponent == 1 - 127 { coarse_exponent = exponent_of(line.direction); }
    coarse_direction = scale_point(line.direction, -coarse_exponent);
    coarse_inverse = 1.0 / each_away_from_zero(coarse_direction);
}

// Returns whether the line may hit a box, in scaled units, before `bound` (as bits) and not entirely before t_min. A plane at
// zero may represent a coordinate below 2^-64, which is replaced by zero.
fn may_hit_box(low: vec3<u32>, high: vec3<u32>, bound: u32) -> bool {
    // An empty box.
    if low.x == 0x7f800000u && high.x == 0xff800000u { return false; }
    // Scaling turned a coordinate into infinity.
    if !(is_finite(low) && is_finite(high)) { return true; }
    let k = params.scale_exponent;
    var field = max_exponent_field(NO_FIELD, line.origin, 0);
    field = max_exponent_field(max_exponent_field(field, low, k), high, k);
    let exponent = 127 - field;
    // At least 2^-100, below which differences lose digits.
    let snap_margin = power_of_two(max(exponent + k - 64, -100));
    let small_low = (low & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u);
    let small_high = (high & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u);
    let origin = scale_point(line.origin, exponent);
    let to_low = select(scale_point(low, exponent + k), vec3<f32>(-snap_margin), small_low) - origin;
    let to_high = select(scale_point(high, exponent + k), vec3<f32>(snap_margin), small_high) - origin;
    let distances = max(abs(to_low), abs(to_high));
    // 17 * 2^-24 and 2^-90.
    let pad = (1.01327896118164062e-6 * max(distances.x, max(distances.y, distances.z)) + 8.077935669463161e-28) * abs(coarse_inverse);
    let negative = are_negative(coarse_inverse);
    let n = select(to_low, to_high, negative) * coarse_inverse - pad;
    let f = select(to_high, to_low, negative) * coarse_inverse + pad;
    let enters = max(n.x, max(n.y, n.z));
    let leaves = min(f.x, min(f.y, f.z));
    if !(enters <= leaves) { return false; }
    // The limits in the same units, with a margin.
    let begin = scale_bits(line.t_min, coarse_exponent + exponent);
    let end = scale_bits(bound, coarse_exponent + exponent);
    return leaves >= begin - 1.0e-5 * abs(begin) - 1.0e-30 && enters <= end + 1.0e-5 * abs(end) + 1.0e-30;
}

// Returns the side of an edge on which the line certainly passes, or 0 if that is undecided. Each product carries at most seven
// roundings, and values that a device flushes lose less than 2^-110.
fn coarse_side(p: vec3<f32>, q: vec3<f32>) -> i32 {
    let d = coarse_direction;
    let plus = p.yzx * q.zxy;
    let minus = p.zxy * q.yzx;
    let sum = dot(d, plus - minus);
    let magnitude = dot(abs(d), abs(plus) + abs(minus));
    // 24 * 2^-24 and 2^-100.
    let error_bound = 1.430511474609375e-6 * magnitude + 7.888609052210118e-31;
    return select(0, 1, sum > error_bound) - select(0, 1, sum < -error_bound);
}

fn certainly_misses(points: array<vec3<u32>, 3>) -> bool {
    var field = max_exponent_field(NO_FIELD, line.origin, 0);
    field = max_exponent_field(max_exponent_field(max_exponent_field(field, points[0], 0), points[1], 0), points[2], 0);
    let exponent = 127 - field;
    let origin = scale_point(line.origin, exponent);
    let a = scale_point(points[0], exponent) - origin;
    let b = scale_point(points[1], exponent) - origin;
    let c = scale_point(points[2], exponent) - origin;
    let u = coarse_side(c, b);
    let v = coarse_side(a, c);
    let w = coarse_side(b, a);
    return min(u, min(v, w)) < 0 && max(u, max(v, w)) > 0;
}

// Hits of extreme rays in integers of any length.

// The first hit so far, exact and with its t rounded once.
var<private> best: ExactIntersection;
var<private> best_t: u32;
var<private> best_triangle: u32;

// Returns the slot that `best` does not use.
fn unused_slot() -> u32 { return select(0u, 1u, best_triangle != NO_TRIANGLE && best.numerator_at == INTERSECTIONS_OFFSET); }

// Returns whether hits are those of `watertight`: the ray's origin is moved by an infinitely small amount, and rounded t orders
// hits.
fn perturbs_origin() -> bool { return params.extremes.rule == 1u; }

// Tests a triangle, and updates the best hit. Returns whether it is hit within the limits.
fn test_extreme_triangle(triangle: u32) -> bool {
    let points = points_of(triangle);
    if certainly_misses(points) { return false; }
    let intersection = intersect_exactly(points, unused_slot(), perturbs_origin());
    if !intersection.is_hit { return false; }
    let t = rounded_ratio(intersection);
    if !is_within_limits(t) { return false; }
    if best_triangle != NO_TRIANGLE {
        var order = select(0, 1, ordered(t) > ordered(best_t)) - select(0, 1, ordered(t) < ordered(best_t));
        if !perturbs_origin() { order = compare_intersections(intersection, best); }
        if order > 0 || (order == 0 && triangle > best_triangle) { return true; }
    }
    best = intersection;
    best_t = t;
    best_triangle = triangle;
    return true;
}

// Traverses the tree along the current line, without triangle `ignore`. Stops at the first hit if `any` is set.
fn traverse_extreme(ignore: u32, any: bool) {
    best_triangle = NO_TRIANGLE;
    atomicAdd(&counts[UNDECIDED_RAYS], 1u);
    prepare_line();
    prepare_coarse_filter();
    if !may_hit_box(nodes[0].xyz, nodes[1].xyz, line.t_max) { return; }
    var stack: array<u32, 64>;
    var depth = 0u;
    var node = nodes[0].w;
    loop {
        if node == NO_NODE {
            if depth == 0u { break; }
            depth -= 1u;
            node = stack[depth];
        }
        if (node & LEAF) != 0u {
            let triangle = records[3u * first_triangle_of(node)].w;
            node = second_triangle_of(node);
            if triangle == ignore || triangle == NO_TRIANGLE { continue; }
            if test_extreme_triangle(triangle) && any { break; }
        } else {
            let row = child_row(node);
            var bound = line.t_max;
            if best_triangle != NO_TRIANGLE { bound = bits_from_ordered(min(ordered(bound), ordered(best_t) + 1)); }
            let left = may_hit_box(nodes[row].xyz, nodes[row + 1u].xyz, bound);
            let right = may_hit_box(nodes[row + 2u].xyz, nodes[row + 3u].xyz, bound);
            if left && right {
                stack[depth] = nodes[row + 2u].w;
                depth += 1u;
            }
            node = select(select(NO_NODE, nodes[row + 2u].w, right), nodes[row].w, left);
        }
    }
}

// Returns the closest hit along the current line. If `any` is set, returns any hit, with only its triangle.
fn closest_extreme_hit(any: bool) -> vec4<u32> {
    traverse_extreme(NO_TRIANGLE, any);
    if best_triangle == NO_TRIANGLE { return MISS; }
    atomicAdd(&counts[HIT_COUNT], 1u);
    if any { return vec4<u32>(0u, 0u, 0u, best_triangle); }
    let weights = rounded_weights(points_of(best_triangle));
    return vec4<u32>(best_t, weights, best_triangle);
}

// Returns whether the current line hits any triangle except `ignore`.
fn any_extreme_hit(ignore: u32) -> bool {
    traverse_extreme(ignore, true);
    return best_triangle != NO_TRIANGLE;
}
