// Resolves rays that candidate notes do not decide: each traverses the tree again.

import package::geometry::node::{LEAF, NO_LEAF, NO_NODE, child_row, first_triangle_of, second_triangle_of};
import package::geometry::queries::{prepared_query_ray, query_ray, set_line_of_query};
import package::geometry::ray::{MISS, PreparedRay, intersects_box};
import package::geometry::record::corners_of;
import package::geometry::shadow_ray::{set_line_of_segment, shadow_ray, shadow_segment_of_hit};
import package::geometry::triangle::points_of;
import package::intersect::candidates::{FIRST_NOTE, OPEN, answer_any};
import package::intersect::determinants::decide_alone;
import package::intersect::filter::{judge, set_view};
import package::intersect::line::make_line;
import package::intersect::resolve_exact::{first, first_leaf, first_triangle, free_slot, offer, put_crossing};
import package::intersect::rounded::{meet_exactly, rounded, weights_of};
import package::lib::buffers::{counts, hits, nodes, occluded, records};
import package::lib::counters::{HARD, HIT_COUNT, OPEN_RAYS, OPEN_SHADOWS};
import package::lib::params::params;

// One invocation per ray traverses the tree and decides each candidate. The stacks are in `occluded`, after the notes.

const STACK: u32 = 64u;

fn stack_at(place: u32) -> u32 { return 2u * params.search.open_rays_at + 3u * params.search.notes + STACK * place; }

// Resolves the open rays assigned to this invocation's place. Each kernel has its own `fallback_ray`. One invocation in 16 has a
// place, so it is alone in its vector on software drivers.
fn fallback_open(local: u32, group: u32, word: u32) {
    let place = 4u * group + local / 16u;
    if local % 16u != 0u || place >= params.search.places || atomicLoad(&counts[word + HARD]) == 0u { return; }
    let open = atomicLoad(&counts[word]);
    for (var k = place; k < open; k += params.search.places) {
        let i = occluded[list_at() + k];
        if is_open(i) { fallback_ray(place, i); }
    }
}

fn may_meet(ray: PreparedRay, row: u32, bound: f32) -> bool {
    return intersects_box(ray, nodes[row], nodes[row + 1u], bound);
}

// Returns where the list of open rays begins.
@if(fallback_rays)
fn list_at() -> u32 { return params.search.open_rays_at; }
@else
fn list_at() -> u32 { return params.search.open_shadows_at; }

@if(fallback_rays)
fn is_open(i: u32) -> bool { return hits[i].z == OPEN; }
@else
fn is_open(i: u32) -> bool { return occluded[i] >= FIRST_NOTE; }

@if(fallback_rays)
fn is_candidate(ray: PreparedRay, leaf: u32, bound: f32) -> bool {
    let j = judge(ray, corners_of(leaf));
    return j.possible && j.low <= bound;
}
@else
fn is_candidate(ray: PreparedRay, leaf: u32, bound: f32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == left_out { return false; }
    return judge(ray, corners).possible;
}

// Decides a candidate. Returns whether the search can stop. A closest-hit search never can.
@if(fallback_rays)
fn see(leaf: u32) -> bool {
    consider(leaf);
    return false;
}
@else
fn see(leaf: u32) -> bool {
    let points = points_of(records[3u * leaf].w);
    let made = decide_alone(leaf, points).made;
    is_met = made.met == 1u;
    if made.hard == 1u { is_met = meet_exactly(points, 0u).met; }
    return is_met;
}

// Traverses the tree and calls `see` for every candidate until it returns true.
fn walk(place: u32, ray: PreparedRay, bound: f32) {
    let stack = stack_at(place);
    var at = nodes[0].w;
    var depth = 0u;
    loop {
        if at == NO_NODE {
            if depth == 0u { break; }
            depth -= 1u;
            at = occluded[stack + depth];
        }
        if (at & LEAF) != 0u {
            let leaf = first_triangle_of(at);
            if is_candidate(ray, leaf, bound) && see(leaf) { break; }
            at = second_triangle_of(at);
        } else {
            let row = child_row(at);
            let left = may_meet(ray, row, bound);
            let right = may_meet(ray, row + 2u, bound);
            if left && right {
                occluded[stack + depth] = nodes[row + 2u].w;
                depth += 1u;
            }
            at = select(select(NO_NODE, nodes[row + 2u].w, right), nodes[row].w, left);
        }
    }
}

// Closest-hit rays.

// Decides a leaf's triangle and offers it as the first hit.
fn consider(leaf: u32) {
    let triangle = records[3u * leaf].w;
    let points = points_of(triangle);
    let alone = decide_alone(leaf, points);
    let told = alone.made.hard == 0u;
    if told {
        if alone.made.met == 1u { _ = offer(alone.made, triangle, put_crossing(alone.made.exponent, alone.n, alone.d), true); }
        return;
    }
    let c = meet_exactly(points, free_slot());
    if c.met { _ = offer(alone.made, triangle, c, false); }
}

// Writes the hit of the ray at a place. The ray's line must be set.
fn fallback_closest(place: u32, i: u32, ray: PreparedRay) {
    make_line();
    set_view(ray);
    first_leaf = NO_LEAF;
    walk(place, ray, bitcast<f32>(hits[i].x));
    if first_leaf == NO_LEAF {
        hits[i] = MISS;
        return;
    }
    let t = rounded(first);
    hits[i] = vec4<u32>(t, weights_of(points_of(first_triangle)), first_triangle);
    atomicAdd(&counts[HIT_COUNT], 1u);
}

// Any-hit rays.

// The triangle where a shadow ray starts.
var<private> left_out: u32;
var<private> is_met: bool;

// Writes whether the ray at a place hits anything except triangle `ignore`. If it does, increments word `count` of `counts`. The
// ray's line must be set.
fn fallback_any(place: u32, i: u32, ray: PreparedRay, ignore: u32, count: u32) {
    left_out = ignore;
    make_line();
    set_view(ray);
    is_met = false;
    walk(place, ray, ray.t_max);
    answer_any(i, is_met, count);
}

// Resolves the ray at a place.
@if(fallback_rays)
fn fallback_ray(place: u32, i: u32) {
    set_line_of_query(i);
    fallback_closest(place, i, prepared_query_ray(i));
}
@elif(fallback_any_rays)
fn fallback_ray(place: u32, i: u32) {
    set_line_of_query(i);
    fallback_any(place, i, prepared_query_ray(i), NO_LEAF, 2u);
}
@else
fn fallback_ray(place: u32, i: u32) {
    let segment = shadow_segment_of_hit(hits[i], query_ray(i).origin);
    set_line_of_segment(segment);
    fallback_any(place, i, shadow_ray(segment), hits[i].w, 3u);
}

// Closest hits of rays that `resolve_exact_rays` or `resolve_exact_together` left open.
//
// Variants: intersector(exact), arithmetic.
// Parameters: search.
@compute @workgroup_size(64)
fn fallback_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    fallback_open(local, group.x + group.y * groups.x, OPEN_RAYS);
}

// Any-hit answers of explicit rays that `resolve_exact_any_rays` left open.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn fallback_any_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    fallback_open(local, group.x + group.y * groups.x, OPEN_RAYS);
}

// Shadow rays that `resolve_exact_shadow_rays` or `shadow_left` left open.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn fallback_shadow_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    fallback_open(local, group.x + group.y * groups.x, OPEN_SHADOWS);
}
