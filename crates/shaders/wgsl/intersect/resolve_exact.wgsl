// Resolves the rays that intersector `exact` left undecided, from their candidates. All workgroups share the list of rays.

import package::geometry::queries::{query_ray, set_line_of_query};
import package::geometry::ray::MISS;
import package::geometry::shadow_ray::{set_line_of_segment, shadow_segment_of_hit};
import package::geometry::units::ordered;
import package::intersect::candidates::{NO_CANDIDATE, UNDECIDED, list_or_empty, write_any_hit};
import package::intersect::determinants::{
    RAYS_PER_WORKGROUP, RemainingList, candidate_results, decide_candidates, determinants, intersection_in_slot,
    load_undecided_count, remaining_candidates, rounded_quotients, store_192,
};
import package::intersect::line::{ExactIntersection, compare_intersections};
import package::lib::buffers::{counts, hits, occluded};
import package::lib::counters::{FALLBACK_OFFSET, HIT_COUNT, OCCLUDED_COUNT, UNDECIDED_OFFSET, UNDECIDED_RAYS};
import package::lib::fixed::Int192;
import package::lib::integers::INTERSECTIONS_OFFSET;
import package::lib::params::params;

// The first hit among a ray's candidates so far: whether there is one, its exact intersection, its rounded t, and its triangle.
// If `first_is_long` is set, the intersection is not stored.
var<private> has_first: bool;
var<private> first_intersection: ExactIntersection;
var<private> first_is_long: bool;
var<private> first_t: u32;
var<private> first_triangle: u32;

// Returns the slot that `first_intersection` does not use.
fn free_slot() -> u32 { return select(0u, 1u, has_first && first_intersection.numerator_at == INTERSECTIONS_OFFSET); }

fn store_intersection(exponent: i32, n: Int192, d: Int192) -> ExactIntersection {
    let intersection = intersection_in_slot(free_slot(), exponent);
    store_192(intersection.numerator_at, n);
    store_192(intersection.denominator_at, d);
    return intersection;
}

// Makes a triangle the first hit if it precedes the current one: least t, then least index. `t` is the intersection's, rounded
// once. Returns whether it became the first hit.
fn accept_if_first(triangle: u32, intersection: ExactIntersection, t: u32) -> bool {
    if has_first {
        if ordered(t) > ordered(first_t) { return false; }
        if t == first_t {
            let order = compare_intersections(intersection, first_intersection);
            if order > 0 || (order == 0 && triangle > first_triangle) { return false; }
        }
    }
    has_first = true;
    first_intersection = intersection;
    first_t = t;
    first_triangle = triangle;
    return true;
}

// The first hit so far, as it is written: t and both weights are rounded once.
var<private> first_hit: vec4<u32>;

// Updates the first hit with four results, from index `at` on. Returns false if two hits have the same rounded t and one of their
// intersections is not stored.
fn accept_results(at: u32) -> bool {
    var is_decided = true;
    for (var k = at; k < at + 4u; k += 1u) {
        let result = candidate_results[k];
        if result.is_hit == 1u {
            let is_long = result.is_long == 1u;
            if has_first && result.t == first_t && (is_long || first_is_long) { is_decided = false; }
            let intersection = store_intersection(result.exponent, determinants[4u * k + 3u], determinants[4u * k]);
            if accept_if_first(result.triangle, intersection, result.t) {
                first_is_long = is_long;
                first_hit = vec4<u32>(result.t, rounded_quotients[4u * k + 1u], rounded_quotients[4u * k + 2u], result.triangle);
            }
        }
    }
    return is_decided;
}

// Finds the first hit among a ray's candidates. Returns, to the ray's first invocation only, whether all candidates are decided.
// All invocations of the workgroup must call it.
fn find_first_hit(list: u32, local: u32) -> bool {
    has_first = false;
    var is_decided = true;
    var remaining = RemainingList(list, false);
    while !remaining.all_done {
        decide_candidates(remaining.list, free_slot(), local);
        if local % 16u == 0u { is_decided = accept_results(local / 4u) && is_decided; }
        remaining = remaining_candidates(remaining.list, local);
    }
    return is_decided;
}

// Writes the hit of one ray after `find_first_hit`, if its candidates decide it.
fn resolve_exact_closest(i: u32, is_decided: bool) {
    if !is_decided || hits[i].y == UNDECIDED {
        atomicAdd(&counts[UNDECIDED_RAYS + FALLBACK_OFFSET], 1u);
        return;
    }
    if !has_first {
        hits[i] = MISS;
        return;
    }
    hits[i] = first_hit;
    atomicAdd(&counts[HIT_COUNT], 1u);
}

// Resolves the list of undecided closest hits, which `group_count` workgroups share.

fn resolve_exact_hits(local: u32, group_index: u32, group_count: u32) {
    let undecided_count = load_undecided_count(local, UNDECIDED_RAYS);
    for (var begin = RAYS_PER_WORKGROUP * group_index; begin < undecided_count; begin += RAYS_PER_WORKGROUP * group_count) {
        let k = begin + local / 16u;
        var i = 0u;
        var list = NO_CANDIDATE;
        if k < undecided_count {
            i = occluded[params.search.undecided_rays_at + k];
            list = list_or_empty(hits[i].y);
            set_line_of_query(i);
        }
        let is_decided = find_first_hit(list, local);
        if k < undecided_count && local % 16u == 0u { resolve_exact_closest(i, is_decided); }
    }
}

// Writes whether one ray hits anything after `find_first_hit`, if its candidates decide it. A hit increments word
// `counter` of `counts`.
fn resolve_exact_any(i: u32, counter: u32, is_decided: bool) {
    if !has_first && (!is_decided || occluded[i] == UNDECIDED) {
        atomicAdd(&counts[counter + UNDECIDED_OFFSET + FALLBACK_OFFSET], 1u);
        return;
    }
    write_any_hit(i, has_first, counter);
}

// Sets the line of the any-hit query `i`: an explicit ray or a shadow ray.
@if(resolve_exact_any_rays)
fn set_line_of_any_hit_query(i: u32) { set_line_of_query(i); }
@else
fn set_line_of_any_hit_query(i: u32) { set_line_of_segment(shadow_segment_of_hit(hits[i], query_ray(i).origin)); }

// Resolves the list of undecided any-hit queries, which `group_count` workgroups share.
//
// Word `counter` of `counts` counts hits. Word `counter + UNDECIDED_OFFSET` is the number of undecided queries.
fn resolve_exact_any_hits(local: u32, group_index: u32, group_count: u32, counter: u32) {
    let undecided_count = load_undecided_count(local, counter + UNDECIDED_OFFSET);
    for (var begin = RAYS_PER_WORKGROUP * group_index; begin < undecided_count; begin += RAYS_PER_WORKGROUP * group_count) {
        let k = begin + local / 16u;
        var i = 0u;
        var list = NO_CANDIDATE;
        if k < undecided_count {
            i = occluded[params.search.undecided_shadows_at + k];
            list = list_or_empty(occluded[i]);
            set_line_of_any_hit_query(i);
        }
        let is_decided = find_first_hit(list, local);
        if k < undecided_count && local % 16u == 0u { resolve_exact_any(i, counter, is_decided); }
    }
}

// Any-hit queries of explicit rays that `any_rays` left undecided.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn resolve_exact_any_rays(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let group_index = group.x + group.y * groups.x;
    resolve_exact_any_hits(local, group_index, groups.x * groups.y, HIT_COUNT);
}

// Shadow rays that `shadow_rays` left undecided.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn resolve_exact_shadow_rays(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let group_index = group.x + group.y * groups.x;
    resolve_exact_any_hits(local, group_index, groups.x * groups.y, OCCLUDED_COUNT);
}

// Closest hits that `trace_camera` or `trace_rays` left undecided.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn resolve_exact_rays(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let group_index = group.x + group.y * groups.x;
    resolve_exact_hits(local, group_index, groups.x * groups.y);
}
