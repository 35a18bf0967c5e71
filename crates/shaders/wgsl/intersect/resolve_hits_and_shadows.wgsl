// Resolves the rays that `trace_and_shadow_camera` left undecided: hits and shadow rays at once, then the remaining shadow rays.

import package::geometry::node::{LEAF, NO_NODE, child_row, first_triangle_of, second_triangle_of};
import package::geometry::queries::{direction_of_ray, eye, prepared_query_ray};
import package::geometry::ray::{PreparedRay, intersects_box};
import package::geometry::record::corners_of;
import package::geometry::shadow_ray::{ShadowSegment, set_line_of_segment, shadow_ray, shadow_segment_of_hit};
import package::intersect::candidates::{
    NO_CANDIDATE, UNDECIDED, allocate_candidate, candidate_at, candidate_shadow_at, list_or_empty, write_any_hit,
};
import package::intersect::determinants::{candidate_after, load_undecided_count};
import package::intersect::filter::{classify, set_shear_view};
import package::intersect::resolve_exact::{
    AnyHitResult, any_hit_of_candidates, resolve_exact_any, resolve_exact_any_hits, resolve_exact_hits,
};
import package::intersect::round_hit::round_hit;
import package::lib::buffers::{counts, hits, nodes, occluded, records};
import package::lib::counters::{CANDIDATE_COUNT, OCCLUDED_COUNT, UNDECIDED_RAYS, UNDECIDED_SHADOWS};
import package::lib::params::params;

// Any-hit search for one ray by a workgroup of 64. Each invocation processes one node at a time. A single invocation per ray would
// wait for memory at every node. On an H200 with a few hundred rays, the workgroup takes less than half of that time.

// Replaces the first candidate: a triangle is certainly hit.
const CERTAIN_HIT: u32 = 0xfffffffdu;
// Capacity of the queue of nodes to visit.
const QUEUE_CAPACITY: u32 = 1024u;

var<workgroup> queue: array<u32, QUEUE_CAPACITY>;
var<workgroup> queue_length: atomic<u32>;
var<workgroup> first_candidate: atomic<u32>;
var<workgroup> candidate_count: atomic<u32>;
var<workgroup> found_certain_hit: atomic<u32>;
// Length of the queue at the start of this round, and the state of the search: see `load_round_state`.
var<workgroup> round_state: vec2<u32>;
// Result of the search.
var<workgroup> search_result: u32;

fn enqueue(node: u32) { queue[atomicAdd(&queue_length, 1u)] = node; }

fn add_candidate(leaf: u32) {
    atomicAdd(&candidate_count, 1u);
    let candidate = allocate_candidate(leaf);
    if candidate != UNDECIDED { occluded[candidate_at(candidate) + 1u] = atomicExchange(&first_candidate, candidate); }
}

fn test_triangle(ray: PreparedRay, leaf: u32, ignore: u32) {
    let corners = corners_of(leaf);
    if corners.triangle == ignore { return; }
    let classified = classify(ray, corners);
    if classified.certain { atomicStore(&found_certain_hit, 1u); } else if classified.possible { add_candidate(leaf); }
}

// Tests a leaf's triangles, or enqueues a node's children.
fn visit_node(ray: PreparedRay, node: u32, ignore: u32) {
    if (node & LEAF) == 0u {
        let row = child_row(node);
        if intersects_box(ray, nodes[row], nodes[row + 1u], ray.t_max) { enqueue(nodes[row].w); }
        if intersects_box(ray, nodes[row + 2u], nodes[row + 3u], ray.t_max) { enqueue(nodes[row + 2u].w); }
        return;
    }
    test_triangle(ray, first_triangle_of(node), ignore);
    let second = second_triangle_of(node);
    if second != NO_NODE { test_triangle(ray, first_triangle_of(second), ignore); }
}

// Starts with all boxes of one level, which saves the rounds for the levels above.
fn begin_search(is_traced: bool, ray: PreparedRay, local: u32) {
    if local == 0u {
        atomicStore(&queue_length, 0u);
        atomicStore(&first_candidate, NO_CANDIDATE);
        atomicStore(&candidate_count, 0u);
        atomicStore(&found_certain_hit, 0u);
    }
    workgroupBarrier();
    if !is_traced { return; }
    for (var k = local; k < params.start_count; k += 64u) {
        let row = params.start_row + 2u * k;
        if intersects_box(ray, nodes[row], nodes[row + 1u], ray.t_max) { enqueue(nodes[row].w); }
    }
}

// Returns the length of the queue and the state of the search: 1 if it has ended, 2 if the queue may overflow, else 0.
fn load_round_state(local: u32) -> vec2<u32> {
    if local == 0u {
        let queued = atomicLoad(&queue_length);
        let has_ended = queued == 0u || atomicLoad(&found_certain_hit) == 1u;
        round_state = vec2<u32>(queued, select(select(0u, 2u, queued + 64u > QUEUE_CAPACITY), 1u, has_ended));
    }
    return workgroupUniformLoad(&round_state);
}

// Returns NO_CANDIDATE if nothing is hit, CERTAIN_HIT, UNDECIDED, or a list of the triangles that may be hit. All invocations of
// the workgroup must call it.
fn search_any_together(is_traced: bool, ray: PreparedRay, ignore: u32, local: u32) -> u32 {
    set_shear_view(ray);
    begin_search(is_traced, ray, local);
    var state = vec2<u32>(0u);
    loop {
        workgroupBarrier();
        state = load_round_state(local);
        if state.y != 0u { break; }
        let count = min(state.x, 64u);
        var node = NO_NODE;
        if local < count { node = queue[state.x - 1u - local]; }
        if local == 0u { atomicSub(&queue_length, count); }
        workgroupBarrier();
        if local < count { visit_node(ray, node, ignore); }
    }
    storageBarrier();
    if local == 0u { search_result = select(NO_CANDIDATE, result_of_search(ray, state.y == 2u), is_traced); }
    return workgroupUniformLoad(&search_result);
}

fn result_of_search(ray: PreparedRay, gave_up: bool) -> u32 {
    let candidates = atomicLoad(&candidate_count);
    if atomicLoad(&found_certain_hit) == 1u { return CERTAIN_HIT; }
    let has_overflowed = atomicLoad(&counts[CANDIDATE_COUNT]) > params.search.candidate_capacity && candidates > 0u;
    return select(atomicLoad(&first_candidate), UNDECIDED, gave_up || has_overflowed);
}

// Shadows of an undecided hit's candidates, computed before the hit is resolved.

// Number of candidates per ray that are considered, and number of workgroups that share a ray's candidates.
const MAX_CANDIDATES: u32 = 8u;
const CANDIDATES_AT_ONCE: u32 = 4u;
// With more undecided rays, tracing shadow rays for all candidates takes longer than waiting for the hits (an H200).
const MAX_RAYS: u32 = 512u;

// Result of a search along a segment to the light, and the exact result of its candidates.
struct ShadowSearch { outcome: u32, of_candidates: AnyHitResult }

// All invocations of the workgroup must call it.
fn trace_segment(segment: ShadowSegment, ignore: u32, local: u32) -> ShadowSearch {
    var search = ShadowSearch(search_any_together(segment.is_traced, shadow_ray(segment), ignore, local), AnyHitResult());
    if search.outcome != CERTAIN_HIT && search.outcome != NO_CANDIDATE {
        set_line_of_segment(segment);
        search.of_candidates = any_hit_of_candidates(select(NO_CANDIDATE, list_or_empty(search.outcome), local < 16u), local);
    }
    return search;
}

// Returns 1 if the segment is occluded, 0 if not, or UNDECIDED.
fn shadow_of_search(search: ShadowSearch) -> u32 {
    if search.outcome == CERTAIN_HIT || search.of_candidates.is_hit { return 1u; }
    return select(0u, UNDECIDED, search.outcome == UNDECIDED || search.of_candidates.needs_fallback);
}

// Returns the precomputed shadow of a resolved hit: 0, 1 or UNDECIDED.
fn precomputed_shadow(i: u32, hit: vec4<u32>) -> u32 {
    if hit.w == 0xffffffffu { return 0u; }
    var candidate = list_or_empty(occluded[i]);
    for (var c = 0u; c < MAX_CANDIDATES && candidate != NO_CANDIDATE; c += 1u) {
        if records[3u * occluded[candidate_at(candidate)]].w == hit.w { return occluded[candidate_shadow_at(candidate)]; }
        candidate = occluded[candidate_at(candidate) + 1u];
    }
    return UNDECIDED;
}

// Resolves all rays that `trace_and_shadow_camera` left undecided. A first set of workgroups shares the hits, a second set the
// shadow rays. If few hits are undecided, the other workgroups trace the shadow rays of their candidates at the same time.

// Stores whether a candidate's segment to the light is occluded. It stays UNDECIDED if `round_hit` cannot round the hit. The
// result is only valid if the candidate proves to be the hit.
fn precompute_shadow(i: u32, candidate: u32, local: u32) {
    let rounded = round_hit(prepared_query_ray(i), occluded[candidate_at(candidate)], bitcast<vec3<u32>>(direction_of_ray(i)));
    if !rounded.certain { return; }
    let hit = rounded.hit;
    let search = trace_segment(shadow_segment_of_hit(hit, eye()), hit.w, local);
    if local == 0u { occluded[candidate_shadow_at(candidate)] = shadow_of_search(search); }
}

fn precompute_shadows(local: u32, group_index: u32, group_count: u32) {
    let undecided_count = load_undecided_count(local, UNDECIDED_RAYS);
    if undecided_count > MAX_RAYS { return; }
    for (var k = group_index / CANDIDATES_AT_ONCE; k < undecided_count; k += group_count / CANDIDATES_AT_ONCE) {
        let i = occluded[params.search.undecided_rays_at + k];
        var candidate = candidate_after(list_or_empty(occluded[i]), group_index % CANDIDATES_AT_ONCE);
        for (var c = group_index % CANDIDATES_AT_ONCE; c < MAX_CANDIDATES && candidate != NO_CANDIDATE; c += CANDIDATES_AT_ONCE) {
            precompute_shadow(i, candidate, local);
            candidate = candidate_after(candidate, CANDIDATES_AT_ONCE);
        }
    }
}

// Variants: intersector(exact), arithmetic.
// Parameters: search.
@compute @workgroup_size(64)
fn resolve_exact_hits_and_shadows(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let group_index = group.x + group.y * groups.x;
    let group_count = params.search.workgroups_per_list;
    if group_index < group_count {
        resolve_exact_hits(local, group_index, group_count);
    } else if group_index < 2u * group_count {
        resolve_exact_any_hits(local, group_index - group_count, group_count, OCCLUDED_COUNT);
    } else {
        precompute_shadows(local, group_index - 2u * group_count, groups.x * groups.y - 2u * group_count);
    }
}

// Shadow rays of hits that `trace_and_shadow_camera` left undecided, after the hits were resolved. Uses the results that
// `resolve_exact_hits_and_shadows` stored with candidates. The other shadow rays are traced by one workgroup each.

// Writes the result of a search, or appends the ray to the list of undecided shadow rays.
fn store_shadow(i: u32, search: ShadowSearch) {
    let outcome = search.outcome;
    if outcome == CERTAIN_HIT || outcome == NO_CANDIDATE {
        write_any_hit(i, outcome == CERTAIN_HIT, OCCLUDED_COUNT);
        return;
    }
    occluded[i] = outcome;
    occluded[params.search.undecided_shadows_at + atomicAdd(&counts[UNDECIDED_SHADOWS], 1u)] = i;
    resolve_exact_any(i, OCCLUDED_COUNT, search.of_candidates);
}

// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn shadow_remaining(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let group_index = group.x + group.y * groups.x;
    let undecided_count = load_undecided_count(local, UNDECIDED_RAYS);
    for (var k = group_index; k < undecided_count; k += groups.x * groups.y) {
        let i = occluded[params.search.undecided_rays_at + k];
        let hit = hits[i];
        if local == 0u { search_result = precomputed_shadow(i, hit); }
        let shadow = workgroupUniformLoad(&search_result);
        if shadow != UNDECIDED {
            if local == 0u { write_any_hit(i, shadow == 1u, OCCLUDED_COUNT); }
            continue;
        }
        let search = trace_segment(shadow_segment_of_hit(hit, eye()), hit.w, local);
        if local == 0u { store_shadow(i, search); }
    }
}
