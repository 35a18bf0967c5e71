// Resolves the camera rays whose hit or shadow a search left undecided, from their candidates. A workgroup resolves one ray at a
// time: first its hit, then its shadow.

import package::geometry::node::{LEAF, NO_NODE, child_row, first_triangle_of, second_triangle_of};
import package::geometry::queries::{eye, set_line_of_query};
import package::geometry::ray::{PreparedRay, intersects_box};
import package::geometry::record::{NO_TRIANGLE, corners_of};
import package::geometry::shadow_ray::{set_line_of_segment, shadow_ray, shadow_segment_of_hit};
import package::intersect::candidates::{
    NO_CANDIDATE, UNDECIDED, allocate_candidate, candidate_at, list_or_empty, listed_at, write_any_hit,
};
import package::intersect::determinants::load_undecided_count;
import package::intersect::exact::exact_is_undecided;
import package::intersect::filter::{classify, set_shear_view};
import package::intersect::resolve_exact::{find_first_hit, resolve_exact_any, resolve_exact_closest};
import package::lib::buffers::{counts, hits, nodes, occluded};
import package::lib::counters::{CANDIDATE_COUNT, OCCLUDED_COUNT, UNDECIDED_RAYS, UNDECIDED_SHADOWS};
import package::lib::params::params;

// Any-hit search for one ray by a workgroup of 64. Each invocation processes one node at a time. A single invocation
// per ray would wait for memory at every node. On an H200 with a few hundred rays, a workgroup per ray takes less than
// half as long as a single invocation per ray.

// In place of a candidate's index: a triangle is certainly hit.
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
    // Once the buffer is full, CANDIDATE_COUNT must not increase: it could wrap around.
    if atomicLoad(&counts[CANDIDATE_COUNT]) > params.search.candidate_capacity { return; }
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

// The hit and the shadow of one ray. All invocations of the workgroup must call these functions.

// The ray of this round, and its hit once it is resolved.
var<workgroup> current_ray: u32;
var<workgroup> current_hit: vec4<u32>;

fn load_ray(at: u32, local: u32) -> u32 {
    if local == 0u { current_ray = occluded[at]; }
    return workgroupUniformLoad(&current_ray);
}

fn load_hit(i: u32, local: u32) -> vec4<u32> {
    if local == 0u { current_hit = hits[i]; }
    return workgroupUniformLoad(&current_hit);
}

// Returns the candidates of the shadow ray of ray `i`, and sets its line. `needs_search` is set if the shadow ray was not traced
// yet. Returns NO_CANDIDATE if no candidate needs to be decided: the hit is still undecided, or the shadow is written.
fn candidates_of_shadow(i: u32, needs_search: bool, local: u32) -> u32 {
    let hit = load_hit(i, local);
    if exact_is_undecided(hit) { return NO_CANDIDATE; }
    var list = NO_CANDIDATE;
    if hit.w != NO_TRIANGLE {
        let segment = shadow_segment_of_hit(hit, eye());
        list = occluded[i];
        if needs_search { list = search_any_together(segment.is_traced, shadow_ray(segment), hit.w, local); }
        if list != CERTAIN_HIT && list != NO_CANDIDATE {
            set_line_of_segment(segment);
            return list;
        }
    }
    if local == 0u { write_any_hit(i, list == CERTAIN_HIT, OCCLUDED_COUNT); }
    return NO_CANDIDATE;
}

// Resolves the rays with undecided hits, then the undecided shadows of the other rays. The workgroups share both lists.
//
// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn resolve_exact_camera(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let hit_count = load_undecided_count(local, UNDECIDED_RAYS);
    let count = hit_count + load_undecided_count(local, UNDECIDED_SHADOWS);
    for (var k = group.x + group.y * groups.x; k < count; k += groups.x * groups.y) {
        let needs_hit = k < hit_count;
        let i = load_ray(listed_at(k, hit_count), local);
        // Resolves the hit if it is undecided, and then the shadow. In one loop, the code that decides candidates is
        // compiled once.
        for (var is_shadow = !needs_hit; ; is_shadow = true) {
            var list = NO_CANDIDATE;
            if is_shadow {
                list = candidates_of_shadow(i, needs_hit, local);
                if list == NO_CANDIDATE { break; }
            } else {
                set_line_of_query(i);
                list = hits[i].y;
            }
            // Each of the first 16 invocations computes a determinant.
            let is_decided = find_first_hit(select(NO_CANDIDATE, list_or_empty(list), local < 16u), local);
            if local == 0u && is_shadow {
                occluded[i] = list;
                resolve_exact_any(i, OCCLUDED_COUNT, is_decided);
            }
            if local == 0u && !is_shadow { resolve_exact_closest(i, is_decided); }
            if is_shadow { break; }
        }
    }
}
