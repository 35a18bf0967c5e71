// Ray-triangle intersection by four determinants of 192 bits in registers.

import package::geometry::triangle::points_of;
import package::intersect::candidates::{NO_CANDIDATE, candidate_at};
import package::intersect::line::{ExactIntersection, is_within_limits, line, unit_range};
import package::lib::buffers::{counts, occluded, records};
import package::lib::fixed::{
    Approximation, Int192, Int64x3, add_192, approximate_192, approximate_quotient, negate_192, round_quotient_192,
    sign_192, sub_64, to_fixed_point, triple_product_192,
};
import package::lib::integers::{INTERSECTIONS_OFFSET, words};

// Whether the triangle is hit, and whether it needs longer integers. `t` is rounded once, as bits.
struct CandidateResult { is_hit: u32, needs_fallback: u32, leaf: u32, exponent: i32, approximate_t: Approximation, t: u32 }

struct FixedTriangle { fits: bool, unit: i32, a: Int64x3, b: Int64x3, c: Int64x3 }

// Returns a coordinate relative to the ray's start.
fn fixed_difference(x: u32, origin: u32, unit: i32) -> vec2<u32> {
    return sub_64(to_fixed_point(x, unit), to_fixed_point(origin, unit - line.shift));
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
struct SolvedTriangle { result: CandidateResult, d: Int192, n: Int192 }

// Derives the denominator D, the numerator N and the decision from the four determinants.
fn solve_determinants(given: CandidateResult, values: Determinants) -> SolvedTriangle {
    // `d` is set below, unless the triangle is missed.
    var solved = SolvedTriangle(given, values.u, values.n);
    let signs = vec3<i32>(sign_192(values.u), sign_192(values.v), sign_192(values.w));
    let negative = any(signs < vec3<i32>(0));
    if negative && any(signs > vec3<i32>(0)) { return solved; }
    solved.d = add_192(add_192(values.u, values.v), values.w);
    if negative {
        solved.d = negate_192(solved.d);
        solved.n = negate_192(solved.n);
    }
    // The ray is in the triangle's plane, or the triangle is behind its start.
    if all(signs == vec3<i32>(0)) || sign_192(solved.n) <= 0 { return solved; }
    solved.result.approximate_t = approximate_quotient(
        approximate_192(solved.n), approximate_192(solved.d), solved.result.exponent,
    );
    solved.result.t = round_quotient_192(solved.n, solved.d, solved.result.exponent);
    solved.result.is_hit = select(0u, 1u, is_within_limits(solved.result.t));
    return solved;
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

// Deciding candidates. A workgroup of 64 processes four rays at a time, and four candidates of each ray. Four invocations share a
// candidate: one for each of the determinants U, V, W and N.

const RAYS_PER_WORKGROUP: u32 = 4u;

// Holds one determinant per invocation at first, then D, V, W and N of each candidate. The ray hits the triangle at
// t = N / D * 2^exponent. V and W may have either sign.
var<workgroup> determinants: array<Int192, 64>;
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

// Decides the first four candidates of `list`, and stores the results in `candidate_results`. The ray's line must be set. All
// invocations of the workgroup must call it.
fn decide_candidates(list: u32, local: u32) {
    let candidate = candidate_after(list, (local / 4u) % 4u);
    var result = CandidateResult();
    var fixed_corners = FixedTriangle();
    if candidate != NO_CANDIDATE {
        result.leaf = occluded[candidate_at(candidate)];
        let triangle = records[3u * result.leaf].w;
        fixed_corners = fixed_triangle(points_of(triangle));
        if fixed_corners.fits { determinants[local] = determinant(fixed_corners, local & 3u); }
        result.needs_fallback = select(1u, 0u, fixed_corners.fits);
        result.exponent = fixed_corners.unit - line.shift - line.unit;
    }
    workgroupBarrier();
    if (local & 3u) == 0u {
        if fixed_corners.fits {
            let all = Determinants(
                determinants[local], determinants[local + 1u], determinants[local + 2u], determinants[local + 3u],
            );
            let solved = solve_determinants(result, all);
            result = solved.result;
            determinants[local] = solved.d;
            determinants[local + 3u] = solved.n;
        }
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

// Computes the four determinants of one triangle in a single invocation.
fn decide_in_one_invocation(leaf: u32, points: array<vec3<u32>, 3>) -> SolvedTriangle {
    let fixed_corners = fixed_triangle(points);
    var result = CandidateResult();
    result.leaf = leaf;
    result.needs_fallback = select(1u, 0u, fixed_corners.fits);
    result.exponent = fixed_corners.unit - line.shift - line.unit;
    var all = Determinants();
    if !fixed_corners.fits { return SolvedTriangle(result, all.u, all.n); }
    for (var side = 0u; side < 4u; side += 1u) {
        let n = determinant(fixed_corners, side);
        if side == 0u { all.u = n; }
        if side == 1u { all.v = n; }
        if side == 2u { all.w = n; }
        if side == 3u { all.n = n; }
    }
    return solve_determinants(result, all);
}
