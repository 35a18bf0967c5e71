// Resolves the rays that intersector `exact` left open, by their candidate notes. All workgroups share the list of rays.

import package::geometry::node::NO_LEAF;
import package::geometry::queries::{query_ray, set_line_of_query};
import package::geometry::ray::MISS;
import package::geometry::shadow_ray::{set_line_of_segment, shadow_segment_of_hit};
import package::intersect::candidates::{NO_NOTE, TOO_MANY, answer_any, listed};
import package::intersect::determinants::{
    RAYS, Decided, Rest, begin_rounds, crossing_in, decide_notes, decided, determinants, put_192, rest_of,
};
import package::intersect::line::{Crossing, order_crossings};
import package::lib::buffers::{counts, hits, occluded, records};
import package::lib::counters::{BLOCKED_COUNT, HARD, HIT_COUNT, OPEN_OF, OPEN_RAYS};
import package::lib::fixed::{Approximation, Int192, abs_192, compare_approximations, round_quotient_192};
import package::lib::integers::INTERSECTIONS_OFFSET;
import package::lib::params::params;

// The first hit among a ray's candidates so far.

// Where the ray hits it, and an approximate distance if known.
var<private> first: Crossing;
var<private> first_about: Approximation;
var<private> first_told: bool;
var<private> first_leaf: u32;
var<private> first_triangle: u32;

// Returns the slot that the first hit so far does not use.
fn free_slot() -> u32 { return select(0u, 1u, first_leaf != NO_LEAF && first.numerator == INTERSECTIONS_OFFSET); }

fn put_crossing(exponent: i32, n: Int192, d: Int192) -> Crossing {
    let c = crossing_in(free_slot(), exponent);
    put_192(c.numerator, n);
    put_192(c.denominator, d);
    return c;
}

// Keeps a triangle that is hit at `c` if it precedes all others: least t, then least index. `told` is set if an approximate
// distance is known. Returns whether it was kept.
fn offer(made: Decided, triangle: u32, c: Crossing, told: bool) -> bool {
    if first_leaf != NO_LEAF {
        var order = 0;
        if told && first_told { order = compare_approximations(made.about, first_about); }
        if order == 0 { order = order_crossings(c, first); }
        if order > 0 || (order == 0 && triangle > first_triangle) { return false; }
    }
    first = c;
    first_about = made.about;
    first_told = told;
    first_leaf = made.leaf;
    first_triangle = triangle;
    return true;
}

// Closest hits by notes.

// In place of a leaf: the notes do not decide.
const UNTOLD: u32 = 0xfffffffeu;

// The first hit so far, as it is written: t and both weights are rounded once.
var<private> first_hit: vec4<u32>;

// Offers the hits of four notes, from place `at` on. Returns false if a note needs longer integers.
fn offer_decided(at: u32) -> bool {
    for (var k = at; k < at + 4u; k += 1u) {
        let made = decided[k];
        if made.hard == 1u { return false; }
        if made.met == 1u {
            let d = determinants[4u * k];
            let triangle = records[3u * made.leaf].w;
            if offer(made, triangle, put_crossing(made.exponent, determinants[4u * k + 3u], d), true) {
                let u = round_quotient_192(abs_192(determinants[4u * k + 1u]), d, 0);
                let v = round_quotient_192(abs_192(determinants[4u * k + 2u]), d, 0);
                first_hit = vec4<u32>(made.t, u, v, triangle);
            }
        }
    }
    return true;
}

// Returns the leaf of a ray's first hit, or UNTOLD. Only the ray's first invocation receives it. All invocations of the workgroup
// must call it.
fn first_of_notes(list: u32, local: u32) -> u32 {
    first_leaf = NO_LEAF;
    var tells = true;
    var rest = Rest(list, false);
    while !rest.all_done {
        decide_notes(rest.list, local);
        if local % 16u == 0u { tells = offer_decided(local / 4u) && tells; }
        rest = rest_of(rest.list, local);
    }
    return select(UNTOLD, first_leaf, tells);
}

// Writes the hit of one ray if its notes decide it.
fn resolve_exact_closest(i: u32, told: u32) {
    if told == UNTOLD || hits[i].y == TOO_MANY {
        atomicAdd(&counts[OPEN_RAYS + HARD], 1u);
        return;
    }
    if told == NO_LEAF {
        hits[i] = MISS;
        return;
    }
    hits[i] = first_hit;
    atomicAdd(&counts[HIT_COUNT], 1u);
}

// The list of rays with open closest hits, shared by workgroups.

fn resolve_exact_hits(local: u32, number: u32, sharers: u32) {
    let open = begin_rounds(local, OPEN_RAYS);
    for (var first = RAYS * number; first < open; first += RAYS * sharers) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        if k < open {
            i = occluded[params.search.open_rays_at + k];
            list = listed(hits[i].y);
            set_line_of_query(i);
        }
        let leaf = first_of_notes(list, local);
        if k < open && local % 16u == 0u { resolve_exact_closest(i, leaf); }
    }
}

// Any-hit queries by notes.

// The result of a ray's notes, for the ray's first invocation. All invocations of the workgroup must call `said_by_notes`.
struct Said { met: bool, hard: bool }

fn said_by_notes(list: u32, local: u32) -> Said {
    var said = Said();
    var rest = Rest(list, false);
    while !rest.all_done {
        decide_notes(rest.list, local);
        if local % 16u == 0u {
            for (var k = local / 4u; k < local / 4u + 4u; k += 1u) {
                said.met = said.met || decided[k].met == 1u;
                said.hard = said.hard || decided[k].hard == 1u;
            }
        }
        rest = rest_of(rest.list, local);
    }
    return said;
}

// Writes whether one ray, whose line is set, hits anything, if its notes decide it. A hit increments word `count` of `counts`.
fn resolve_exact_any(i: u32, count: u32, said: Said) {
    if !said.met && (said.hard || occluded[i] == TOO_MANY) {
        atomicAdd(&counts[count + OPEN_OF + HARD], 1u);
        return;
    }
    answer_any(i, said.met, count);
}

// Sets a query's line.
@if(resolve_exact_any_rays)
fn set_line_asked(i: u32) { set_line_of_query(i); }
@else
fn set_line_asked(i: u32) { set_line_of_segment(shadow_segment_of_hit(hits[i], query_ray(i).origin)); }

// The list of open any-hit queries, shared by workgroups.
//
// Word `count` of `counts` counts hits. Word `count + OPEN_OF` is the number of open queries.
fn resolve_exact_queries(local: u32, number: u32, sharers: u32, count: u32) {
    let open = begin_rounds(local, count + OPEN_OF);
    for (var first = RAYS * number; first < open; first += RAYS * sharers) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        if k < open {
            i = occluded[params.search.open_shadows_at + k];
            list = listed(occluded[i]);
            set_line_asked(i);
        }
        let said = said_by_notes(list, local);
        if k < open && local % 16u == 0u { resolve_exact_any(i, count, said); }
    }
}

// Any-hit answers of explicit rays that `any_rays` left open.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn resolve_exact_any_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    resolve_exact_queries(local, number, groups.x * groups.y, HIT_COUNT);
}

// Shadow rays that `shadow_rays` left open.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn resolve_exact_shadow_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    resolve_exact_queries(local, number, groups.x * groups.y, BLOCKED_COUNT);
}

// Closest hits that `trace_camera` or `trace_rays` left open. A fixed number of workgroups shares the list.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn resolve_exact_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    resolve_exact_hits(local, number, groups.x * groups.y);
}
