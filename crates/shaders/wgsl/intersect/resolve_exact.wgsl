// Settles the rays that intersector `exact` left open, by their notes: many workgroups share the list of rays.

import package::geometry::layout::NO_LEAF;
import package::geometry::light::{set_line_along, to_light};
import package::geometry::queries::{asked, set_line_of};
import package::geometry::ray::MISS;
import package::intersect::determinants::{
    Decided, RAYS, Rest, begin_rounds, crossing_in, decide_notes, decided, determinants, put_192, rest_of,
};
import package::intersect::line::{Crossing, order_crossings};
import package::intersect::candidates::{HARD, NO_NOTE, OPEN_RAYS, TOO_MANY, answer_any, listed};
import package::lib::buffers::{counts, hits, occluded, records};
import package::lib::fixed::{About, Whole192, compare_about, rounded_192, size_192};
import package::lib::params::params;
import package::lib::integers::CROSSINGS;

// The first of a ray's candidates so far, as they come one by one.

// Of the candidates so far: where it is met, and about how far away, if that is known.
var<private> first: Crossing;
var<private> first_about: About;
var<private> first_told: bool;
var<private> first_leaf: u32;
var<private> first_triangle: u32;

// The slot that the first so far does not take.
fn free_slot() -> u32 { return select(0u, 1u, first_leaf != NO_LEAF && first.numerator == CROSSINGS); }

fn put_crossing(exponent: i32, n: Whole192, d: Whole192) -> Crossing {
    let c = crossing_in(free_slot(), exponent);
    put_192(c.numerator, n);
    put_192(c.denominator, d);
    return c;
}

// Keeps a triangle that is met at `c` if that is before all others: least t, then least index. `told` is whether
// it is known about where. Returns whether it was kept.
fn offer(made: Decided, triangle: u32, c: Crossing, told: bool) -> bool {
    if first_leaf != NO_LEAF {
        var order = 0;
        if told && first_told { order = compare_about(made.about, first_about); }
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

// Settles which of a ray's candidates is first, by its notes.

// In place of a leaf: notes do not tell.
const UNTOLD: u32 = 0xfffffffeu;

// The first so far as it is written, with t and both weights rounded once.
var<private> first_hit: vec4<u32>;

// Looks over four notes that are decided, the first of which stands in place `at`; whether they all tell.
fn offer_decided(at: u32) -> bool {
    for (var k = at; k < at + 4u; k += 1u) {
        let made = decided[k];
        if made.hard == 1u { return false; }
        if made.met == 1u {
            let d = determinants[4u * k];
            let triangle = records[3u * made.leaf].w;
            if offer(made, triangle, put_crossing(made.exponent, determinants[4u * k + 3u], d), true) {
                let u = rounded_192(size_192(determinants[4u * k + 1u]), d, 0);
                let v = rounded_192(size_192(determinants[4u * k + 2u]), d, 0);
                first_hit = vec4<u32>(made.t, u, v, triangle);
            }
        }
    }
    return true;
}

// The leaf of the first of a ray's notes, for the ray's first invocation, or UNTOLD. All of a workgroup call it.
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

// Writes the hit of one ray if its notes tell it.
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
    atomicAdd(&counts[2], 1u);
}

// A list of open hits, shared by workgroups.

fn resolve_exact_hits(local: u32, number: u32, sharers: u32) {
    let open = begin_rounds(local, OPEN_RAYS);
    for (var first = RAYS * number; first < open; first += RAYS * sharers) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        if k < open {
            i = occluded[params.first + k];
            list = listed(hits[i].y);
            set_line_of(i);
        }
        let leaf = first_of_notes(list, local);
        if k < open && local % 16u == 0u { resolve_exact_closest(i, leaf); }
    }
}

// Settles whether a ray meets anything, by its notes.

// What the notes of a ray say, for the ray's first invocation. All of a workgroup call it.
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

// Writes whether one ray, whose line is set, meets anything, and counts it as word `count` of `counts` if it does; if its notes tell it.
fn resolve_exact_any(i: u32, count: u32, said: Said) {
    if !said.met && (said.hard || occluded[i] == TOO_MANY) {
        atomicAdd(&counts[count + 5u + HARD], 1u);
        return;
    }
    answer_any(i, said.met, count);
}

// Sets a query's line.
@if(resolve_exact_any_rays)
fn set_line_asked(i: u32) { set_line_of(i); }
@else
fn set_line_asked(i: u32) { set_line_along(to_light(hits[i], asked(i).origin)); }

// A list of open any-hit queries, shared by workgroups.
//
// What is met is counted as word `count` of `counts`, what was left open as word `count + 5`.
fn resolve_exact_queries(local: u32, number: u32, sharers: u32, count: u32) {
    let open = begin_rounds(local, count + 5u);
    for (var first = RAYS * number; first < open; first += RAYS * sharers) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        if k < open {
            i = occluded[params.destination + k];
            list = listed(occluded[i]);
            set_line_asked(i);
        }
        let said = said_by_notes(list, local);
        if k < open && local % 16u == 0u { resolve_exact_any(i, count, said); }
    }
}

// Whether given rays that `any_rays` left open meet anything.
//
// Variants: intersector(exact).
@compute @workgroup_size(64)
fn resolve_exact_any_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    resolve_exact_queries(local, number, groups.x * groups.y, 2u);
}

// The shadows that `shadow_rays` left open.
//
// Variants: intersector(exact).
@compute @workgroup_size(64)
fn resolve_exact_shadow_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    resolve_exact_queries(local, number, groups.x * groups.y, 3u);
}

// The closest hits that `trace_camera` or `trace_rays` left open: as many invocations as there may be share the list.
//
// Variants: intersector(exact).
@compute @workgroup_size(64)
fn resolve_exact_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    resolve_exact_hits(local, number, groups.x * groups.y);
}
