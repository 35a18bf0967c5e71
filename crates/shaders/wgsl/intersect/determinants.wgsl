// Ray-triangle intersection by four determinants of 192 bits in registers. Candidates that need longer numbers are rounded in
// double-float arithmetic, or else in multi-word integers.

import package::geometry::ray::{main_axis, permute, permuted_axes};
import package::geometry::triangle::points_of;
import package::geometry::units::{exponent_of, scale_point, snapped3};
import package::intersect::candidates::{NO_CANDIDATE, candidate_at};
import package::intersect::line::{ExactIntersection, is_within_limits, line, unit_range};
import package::intersect::round_hit::{PermutedLine, RoundedHit, round_hit};
import package::intersect::round_intersection::round_long_quotient;
import package::lib::buffers::{counts, occluded, records};
import package::lib::fixed::{
    Int192, Int64x3, abs_192, add_192, negate_192, round_quotient_192, select_192, sign_192, sub_64, to_fixed_point,
    triple_product_192,
};
import package::lib::integers::{INTERSECTIONS_OFFSET, words};
import package::lib::params::params;

// A decision on a triangle. `t` is rounded once, as bits. The exact t is N / D * 2^exponent. If `is_long` is 1, the numbers may
// exceed 192 bits, and N and D are not stored.
struct CandidateResult { is_hit: u32, is_long: u32, triangle: u32, exponent: i32, t: u32 }

struct FixedTriangle { fits: bool, unit: i32, a: Int64x3, b: Int64x3, c: Int64x3 }

// Returns a coordinate relative to the ray's start.
fn fixed_difference(x: u32, origin: u32, unit: i32) -> vec2<u32> {
    return sub_64(to_fixed_point(x, unit), to_fixed_point(origin, unit - line.scale_exponent));
}

fn fixed_vertex(p: vec3<u32>, unit: i32) -> Int64x3 {
    let o = line.origin;
    return Int64x3(fixed_difference(p.x, o.x, unit), fixed_difference(p.y, o.y, unit), fixed_difference(p.z, o.z, unit));
}

// Returns the corners relative to the ray's start. Requires that they and the direction have at most 60 bits and that t_min is
// not negative; else `fits` is false.
fn fixed_triangle(points: array<vec3<u32>, 3>) -> FixedTriangle {
    let units = unit_range(points);
    if units.y - units.x + 25 > 60 || line.bits > 60 || line.t_min > 0x80000000u { return FixedTriangle(); }
    return FixedTriangle(
        true, units.x, fixed_vertex(points[0], units.x), fixed_vertex(points[1], units.x), fixed_vertex(points[2], units.x),
    );
}

fn fixed_direction() -> Int64x3 {
    let d = line.direction;
    return Int64x3(to_fixed_point(d.x, line.unit), to_fixed_point(d.y, line.unit), to_fixed_point(d.z, line.unit));
}

// Returns d . (c x b), d . (a x c), d . (b x a) or a . (c x b).
fn determinant(fixed_corners: FixedTriangle, side: u32) -> Int192 {
    var x = fixed_direction();
    var p = fixed_corners.c;
    var q = fixed_corners.b;
    if side == 1u { p = fixed_corners.a; q = fixed_corners.c; }
    if side == 2u { p = fixed_corners.b; q = fixed_corners.a; }
    if side == 3u { x = fixed_corners.a; }
    return triple_product_192(x, p, q);
}

struct Determinants { u: Int192, v: Int192, w: Int192, n: Int192 }

// `is_hit` is set if the ray's line hits the triangle in front of the ray's start. D and N are denominator and numerator of t.
struct SolvedTriangle { is_hit: bool, d: Int192, n: Int192 }

fn solve_determinants(values: Determinants) -> SolvedTriangle {
    let signs = vec3<i32>(sign_192(values.u), sign_192(values.v), sign_192(values.w));
    let negative = any(signs < vec3<i32>(0));
    let d = add_192(add_192(values.u, values.v), values.w);
    let n = select_192(values.n, negate_192(values.n), negative);
    // All signs are zero if the ray is in the triangle's plane.
    let is_hit = !(negative && any(signs > vec3<i32>(0))) && any(signs != vec3<i32>(0)) && sign_192(n) > 0;
    return SolvedTriangle(is_hit, abs_192(d), n);
}

// Number of limbs of 192 bits.
const LIMBS: u32 = 6u;

// Returns an intersection whose numbers are stored in slot 0 or 1.
fn intersection_in_slot(slot: u32, exponent: i32) -> ExactIntersection {
    return ExactIntersection(true, INTERSECTIONS_OFFSET + 56u * slot, INTERSECTIONS_OFFSET + 56u * slot + 28u, LIMBS, exponent);
}

// Stores a non-negative number in the format of lib/integers.wgsl.
fn store_192(at: u32, n: Int192) {
    words[at] = 0u;
    words[at + 1u] = n.low.x;
    words[at + 2u] = n.low.y;
    words[at + 3u] = n.low.z;
    words[at + 4u] = n.high.x;
    words[at + 5u] = n.high.y;
    words[at + 6u] = n.high.z;
}

// Deciding candidates. A workgroup of 64 processes up to four rays at a time, and four candidates of each ray.
// Four invocations share a candidate: one for each of the determinants U, V, W and N.

const RAYS_PER_WORKGROUP: u32 = 4u;

// One determinant per invocation. After a candidate is decided, the first of its four holds D, and the last one N.
var<workgroup> determinants: array<Int192, 64>;
// The results of a candidate's first three invocations: t and the weights of the second and third corner, each rounded once.
var<workgroup> rounded_quotients: array<u32, 64>;
var<workgroup> candidate_results: array<CandidateResult, 16>;
// Number of undecided rays of this submission, and whether a ray of this round has more candidates.
var<workgroup> undecided_count: u32;
var<workgroup> has_more: u32;

// Returns word `word` of `counts`, a number of undecided rays, to all invocations of the workgroup.
fn load_undecided_count(local: u32, word: u32) -> u32 {
    if local == 0u { undecided_count = atomicLoad(&counts[word]); }
    return workgroupUniformLoad(&undecided_count);
}

// Returns the candidate `count` places after the first of a list.
fn candidate_after(list: u32, count: u32) -> u32 {
    var candidate = list;
    for (var i = 0u; i < count && candidate != NO_CANDIDATE; i += 1u) { candidate = occluded[candidate_at(candidate) + 1u]; }
    return candidate;
}

// Returns the hit of the current line with a leaf's triangle, if about 48 bits suffice. The line's limits are not tested.
fn round_hit_of_line(leaf: u32) -> RoundedHit {
    let exponent = exponent_of(line.direction);
    let direction = scale_point(line.direction, -exponent);
    let axis = main_axis(direction);
    let to_scaled = line.scale_exponent - params.scale_exponent;
    let origin = permute(snapped3(scale_point(line.origin, to_scaled)), axis);
    let permuted = PermutedLine(permuted_axes(axis), origin, permute(direction, axis), exponent + to_scaled);
    return round_hit(permuted, leaf);
}

// Decides the first four candidates of `list`, and stores the results in `candidate_results`. The ray's line must be set. May
// overwrite the intersection in slot `slot`. All invocations of the workgroup must call it.
fn decide_candidates(list: u32, slot: u32, local: u32) {
    let side = local & 3u;
    let candidate = candidate_after(list, (local / 4u) % 4u);
    var result = CandidateResult();
    var fits = false;
    if candidate != NO_CANDIDATE {
        result.triangle = records[3u * occluded[candidate_at(candidate)]].w;
        let fixed_corners = fixed_triangle(points_of(result.triangle));
        fits = fixed_corners.fits;
        if fits { determinants[local] = determinant(fixed_corners, side); }
        result.is_long = select(1u, 0u, fits);
        result.exponent = fixed_corners.unit - line.scale_exponent - line.unit;
    }
    workgroupBarrier();
    let first = local - side;
    var solved = SolvedTriangle();
    if fits {
        let u = determinants[first];
        let v = determinants[first + 1u];
        let w = determinants[first + 2u];
        solved = solve_determinants(Determinants(u, v, w, determinants[first + 3u]));
        if solved.is_hit && side < 3u {
            var dividend = solved.n;
            if side != 0u { dividend = abs_192(select_192(v, w, side == 2u)); }
            result.t = round_quotient_192(dividend, solved.d, select(0, result.exponent, side == 0u));
        }
    } else if candidate != NO_CANDIDATE && side < 3u {
        let rounded = round_hit_of_line(occluded[candidate_at(candidate)]);
        if rounded.is_rounded {
            solved.is_hit = true;
            result.t = rounded.hit[side];
        } else if !rounded.is_missed {
            let quotient = round_long_quotient(points_of(result.triangle), side, slot);
            solved.is_hit = quotient.is_hit;
            result.t = quotient.bits;
        }
    }
    workgroupBarrier();
    rounded_quotients[local] = result.t;
    if side == 3u { determinants[local] = solved.n; }
    if side == 0u {
        determinants[local] = solved.d;
        result.is_hit = select(0u, 1u, solved.is_hit && is_within_limits(result.t));
        candidate_results[local / 4u] = result;
    }
    workgroupBarrier();
}

// The candidates that remain, and whether all lists of the workgroup are finished.
struct RemainingList { list: u32, all_done: bool }

// Returns the list after its first four candidates. All invocations of the workgroup must call it.
fn remaining_candidates(list: u32, local: u32) -> RemainingList {
    if local == 0u { has_more = 0u; }
    workgroupBarrier();
    let next = candidate_after(list, 4u);
    if next != NO_CANDIDATE { has_more = 1u; }
    workgroupBarrier();
    return RemainingList(next, workgroupUniformLoad(&has_more) == 0u);
}

// The decision on one triangle, and the numbers D and N.
struct DecidedTriangle { result: CandidateResult, d: Int192, n: Int192 }

// Decides one triangle in a single invocation.
fn decide_in_one_invocation(triangle: u32, points: array<vec3<u32>, 3>) -> DecidedTriangle {
    let fixed_corners = fixed_triangle(points);
    let exponent = fixed_corners.unit - line.scale_exponent - line.unit;
    if !fixed_corners.fits { return DecidedTriangle(CandidateResult(0u, 1u, triangle, exponent, 0u), Int192(), Int192()); }
    var all = Determinants();
    for (var side = 0u; side < 4u; side += 1u) {
        let n = determinant(fixed_corners, side);
        if side == 0u { all.u = n; }
        if side == 1u { all.v = n; }
        if side == 2u { all.w = n; }
        if side == 3u { all.n = n; }
    }
    let solved = solve_determinants(all);
    var result = CandidateResult(0u, 0u, triangle, exponent, 0u);
    if solved.is_hit {
        result.t = round_quotient_192(solved.n, solved.d, exponent);
        result.is_hit = select(0u, 1u, is_within_limits(result.t));
    }
    return DecidedTriangle(result, solved.d, solved.n);
}
