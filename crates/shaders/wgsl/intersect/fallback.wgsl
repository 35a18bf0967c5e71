// Resolves rays that their candidates do not decide. Each ray traverses the tree again.

import package::geometry::node::{LEAF, NO_NODE, child_row, first_triangle_of, second_triangle_of};
import package::geometry::queries::{prepared_query_ray, query_ray, set_line_of_query};
import package::geometry::ray::{MISS, PreparedRay, intersects_box};
import package::geometry::record::{NO_TRIANGLE, corners_of};
import package::geometry::shadow_ray::{set_line_of_segment, shadow_ray, shadow_segment_of_hit};
import package::geometry::triangle::points_of;
import package::intersect::candidates::{FIRST_CANDIDATE, UNDECIDED_HIT, listed_at, write_any_hit};
import package::intersect::determinants::decide_in_one_invocation;
import package::intersect::filter::{classify, set_shear_view};
import package::intersect::line::prepare_line;
import package::intersect::resolve_exact::{
    accept_if_first, first_t, first_triangle, free_slot, has_first, store_intersection,
};
import package::intersect::round_intersection::{intersect_within_limits, rounded_ratio, rounded_weights};
import package::lib::buffers::{counts, hits, nodes, occluded, records};
import package::lib::counters::{FALLBACK_OFFSET, HIT_COUNT, OCCLUDED_COUNT, UNDECIDED_RAYS, UNDECIDED_SHADOWS};
import package::lib::params::params;

// One invocation per ray traverses the tree and decides each triangle that may be hit. The stacks are in `occluded`,
// after the candidates.

const STACK_SIZE: u32 = 64u;
const NO_WORKER: u32 = 0xffffffffu;

fn stack_offset(worker: u32) -> u32 {
    return 2u * params.search.undecided_rays_at + 2u * params.search.candidate_capacity + STACK_SIZE * worker;
}

// Returns the index of this invocation among the workers, or NO_WORKER. One invocation in 16 is a worker, so that each has its own
// vector on software drivers.
fn worker_index(local: u32, group: u32) -> u32 {
    let worker = 4u * group + local / 16u;
    return select(NO_WORKER, worker, local % 16u == 0u && worker < params.search.fallback_workers);
}

// Returns the number of rays in a list that their candidates did not decide.
fn fallback_count(word: u32) -> u32 { return atomicLoad(&counts[word + FALLBACK_OFFSET]); }

// Resolves the undecided rays of a worker. The kernel determines `fallback_ray`.
fn resolve_assigned_rays(worker: u32, word: u32) {
    if worker == NO_WORKER || fallback_count(word) == 0u { return; }
    let undecided_count = atomicLoad(&counts[word]);
    for (var k = worker; k < undecided_count; k += params.search.fallback_workers) {
        let i = occluded[undecided_list_at() + k];
        if is_undecided_ray(i) { fallback_ray(worker, i); }
    }
}

fn intersects_child(ray: PreparedRay, row: u32, bound: f32) -> bool {
    return intersects_box(ray, nodes[row], nodes[row + 1u], bound);
}

// Returns where the list of undecided rays begins.
@if(fallback_rays)
fn undecided_list_at() -> u32 { return params.search.undecided_rays_at; }
@else
fn undecided_list_at() -> u32 { return params.search.undecided_shadows_at; }

@if(fallback_rays)
fn is_undecided_ray(i: u32) -> bool { return is_undecided_hit(i); }
@else
fn is_undecided_ray(i: u32) -> bool { return is_undecided_any_hit(i); }

fn is_undecided_hit(i: u32) -> bool { return hits[i].z == UNDECIDED_HIT; }
fn is_undecided_any_hit(i: u32) -> bool { return occluded[i] >= FIRST_CANDIDATE; }

// Whether the search is for the closest hit, the triangle where a shadow ray starts, and whether an any-hit search found a hit.
var<private> seeks_closest: bool;
var<private> ignored_triangle: u32;
var<private> found_any: bool;

// Returns whether a leaf's triangle may be the hit.
fn is_candidate(ray: PreparedRay, leaf: u32, bound: f32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == ignored_triangle { return false; }
    let classified = classify(ray, corners);
    return classified.possible && classified.low <= bound;
}

// Decides a candidate. Returns whether the search can stop. A closest-hit search never can.
fn decide_candidate(leaf: u32) -> bool {
    if seeks_closest {
        decide_closest(leaf);
        return false;
    }
    let triangle = records[3u * leaf].w;
    let points = points_of(triangle);
    let result = decide_in_one_invocation(triangle, points).result;
    found_any = result.is_hit == 1u;
    if result.is_long == 1u { found_any = intersect_within_limits(points, 0u).is_hit; }
    return found_any;
}

// Traverses the tree and calls `decide_candidate` for every candidate until it returns true.
fn traverse_candidates(worker: u32, ray: PreparedRay, bound: f32) {
    let stack = stack_offset(worker);
    var node = nodes[0].w;
    var depth = 0u;
    loop {
        if node == NO_NODE {
            if depth == 0u { break; }
            depth -= 1u;
            node = occluded[stack + depth];
        }
        if (node & LEAF) != 0u {
            let leaf = first_triangle_of(node);
            if is_candidate(ray, leaf, bound) && decide_candidate(leaf) { break; }
            node = second_triangle_of(node);
        } else {
            let row = child_row(node);
            let left = intersects_child(ray, row, bound);
            let right = intersects_child(ray, row + 2u, bound);
            if left && right {
                occluded[stack + depth] = nodes[row + 2u].w;
                depth += 1u;
            }
            node = select(select(NO_NODE, nodes[row + 2u].w, right), nodes[row].w, left);
        }
    }
}

// Closest-hit rays.

// Decides a leaf's triangle, and updates the first hit.
fn decide_closest(leaf: u32) {
    let triangle = records[3u * leaf].w;
    let points = points_of(triangle);
    let decided = decide_in_one_invocation(triangle, points);
    let result = decided.result;
    if result.is_long == 1u {
        let intersection = intersect_within_limits(points, free_slot());
        if intersection.is_hit { _ = accept_if_first(triangle, intersection, rounded_ratio(intersection)); }
    } else if result.is_hit == 1u {
        _ = accept_if_first(triangle, store_intersection(result.exponent, decided.n, decided.d), result.t);
    }
}

// Writes the hit of a worker's ray. The ray's line must be set.
fn fallback_closest(worker: u32, i: u32, ray: PreparedRay) {
    prepare_line();
    set_shear_view(ray);
    seeks_closest = true;
    ignored_triangle = NO_TRIANGLE;
    has_first = false;
    traverse_candidates(worker, ray, bitcast<f32>(hits[i].x));
    if !has_first {
        hits[i] = MISS;
        return;
    }
    hits[i] = vec4<u32>(first_t, rounded_weights(points_of(first_triangle)), first_triangle);
    atomicAdd(&counts[HIT_COUNT], 1u);
}

// Any-hit rays.

// Writes whether a worker's ray hits anything except triangle `ignore`. A hit increments word `counter` of `counts`.
// The ray's line must be set.
fn fallback_any(worker: u32, i: u32, ray: PreparedRay, ignore: u32, counter: u32) {
    prepare_line();
    set_shear_view(ray);
    seeks_closest = false;
    ignored_triangle = ignore;
    found_any = false;
    traverse_candidates(worker, ray, ray.t_max);
    write_any_hit(i, found_any, counter);
}

@if(fallback_rays)
fn fallback_ray(worker: u32, i: u32) {
    set_line_of_query(i);
    fallback_closest(worker, i, prepared_query_ray(i));
}
@elif(fallback_any_rays)
fn fallback_ray(worker: u32, i: u32) {
    set_line_of_query(i);
    fallback_any(worker, i, prepared_query_ray(i), NO_TRIANGLE, HIT_COUNT);
}
@else
fn fallback_ray(worker: u32, i: u32) {
    let segment = shadow_segment_of_hit(hits[i], query_ray(i).origin);
    if !segment.is_traced {
        write_any_hit(i, false, OCCLUDED_COUNT);
        return;
    }
    set_line_of_segment(segment);
    fallback_any(worker, i, shadow_ray(segment), hits[i].w, OCCLUDED_COUNT);
}

// Resolves the hit of a camera ray if it is undecided. Returns whether its shadow ray must be traced then.
@if(fallback_camera)
fn fallback_hit(worker: u32, i: u32) -> bool {
    if !is_undecided_hit(i) { return false; }
    set_line_of_query(i);
    fallback_closest(worker, i, prepared_query_ray(i));
    let is_miss = all(hits[i] == MISS);
    if is_miss { write_any_hit(i, false, OCCLUDED_COUNT); }
    return !is_miss;
}

// Closest hits of rays that `resolve_exact_rays` left undecided.
//
// Variants: intersector(exact), arithmetic.
// Parameters: search.
@compute @workgroup_size(64)
fn fallback_rays(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    resolve_assigned_rays(worker_index(local, group.x + group.y * groups.x), UNDECIDED_RAYS);
}

// Any-hit queries of explicit rays that `resolve_exact_any_rays` left undecided.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn fallback_any_rays(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    resolve_assigned_rays(worker_index(local, group.x + group.y * groups.x), UNDECIDED_RAYS);
}

// Shadow rays that `resolve_exact_shadow_rays` left undecided.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn fallback_shadow_rays(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    resolve_assigned_rays(worker_index(local, group.x + group.y * groups.x), UNDECIDED_SHADOWS);
}

// Hits and shadow rays of a camera that `resolve_exact_camera` left undecided.
//
// Variants: intersector(exact), arithmetic.
// Parameters: search.
@compute @workgroup_size(64)
fn fallback_camera(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let worker = worker_index(local, group.x + group.y * groups.x);
    let needs_fallback = fallback_count(UNDECIDED_RAYS) != 0u || fallback_count(UNDECIDED_SHADOWS) != 0u;
    if worker == NO_WORKER || !needs_fallback { return; }
    let hit_count = atomicLoad(&counts[UNDECIDED_RAYS]);
    let count = hit_count + atomicLoad(&counts[UNDECIDED_SHADOWS]);
    for (var k = worker; k < count; k += params.search.fallback_workers) {
        let i = occluded[listed_at(k, hit_count)];
        if fallback_hit(worker, i) || is_undecided_any_hit(i) { fallback_ray(worker, i); }
    }
}
