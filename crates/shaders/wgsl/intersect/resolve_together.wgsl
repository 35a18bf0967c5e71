// Resolves the rays that `trace_and_shadow_camera` left open: hits and shadow rays at once, then the remaining shadow rays.

import package::geometry::node::{LEAF, NO_NODE, child_row, first_triangle_of, second_triangle_of};
import package::geometry::queries::{direction_of_ray, eye, prepared_query_ray};
import package::geometry::ray::{PreparedRay, intersects_box};
import package::geometry::record::corners_of;
import package::geometry::shadow_ray::{ShadowSegment, set_line_of_segment, shadow_ray, shadow_segment_of_hit};
import package::intersect::candidates::{NO_NOTE, TOO_MANY, answer_any, listed, new_note, note_at, shadow_of};
import package::intersect::determinants::{begin_rounds, note_after};
import package::intersect::filter::{judge, set_view};
import package::intersect::reported::surely_reported;
import package::intersect::resolve_exact::{Said, resolve_exact_any, resolve_exact_hits, resolve_exact_queries, said_by_notes};
import package::lib::buffers::{counts, hits, nodes, occluded, records};
import package::lib::counters::{BLOCKED_COUNT, NOTES, OPEN_RAYS, OPEN_SHADOWS};
import package::lib::params::params;

// Any-hit search for one ray by a workgroup of 64, in which each invocation takes one node at a time. With few rays, an
// invocation waits for memory at every node. On an H200 with some hundred rays this takes less than half the time of one
// invocation per ray.

// In place of the first note: a triangle is surely hit.
const MET: u32 = 0xfffffffdu;
// Capacity for waiting nodes.
const ROOM: u32 = 1024u;

var<workgroup> waiting: array<u32, ROOM>;
var<workgroup> waiting_count: atomic<u32>;
var<workgroup> first_note: atomic<u32>;
var<workgroup> note_count: atomic<u32>;
var<workgroup> surely_met: atomic<u32>;
// Of this round: number of waiting nodes, and whether the search has ended.
var<workgroup> standing_of_round: vec2<u32>;
// Result of the search.
var<workgroup> outcome: u32;

fn wait(node: u32) { waiting[atomicAdd(&waiting_count, 1u)] = node; }

fn record_candidate_together(leaf: u32) {
    atomicAdd(&note_count, 1u);
    let note = new_note(leaf);
    if note != TOO_MANY { occluded[note_at(note) + 1u] = atomicExchange(&first_note, note); }
}

fn see_together(ray: PreparedRay, leaf: u32, ignore: u32) {
    let corners = corners_of(leaf);
    if corners.triangle == ignore { return; }
    let j = judge(ray, corners);
    if j.sure { atomicStore(&surely_met, 1u); } else if j.possible { record_candidate_together(leaf); }
}

// Tests a leaf's triangles, or queues a node's children.
fn visit(ray: PreparedRay, node: u32, ignore: u32) {
    if (node & LEAF) == 0u {
        let row = child_row(node);
        if intersects_box(ray, nodes[row], nodes[row + 1u], ray.t_max) { wait(nodes[row].w); }
        if intersects_box(ray, nodes[row + 2u], nodes[row + 3u], ray.t_max) { wait(nodes[row + 2u].w); }
        return;
    }
    see_together(ray, first_triangle_of(node), ignore);
    let others = second_triangle_of(node);
    if others != NO_NODE { see_together(ray, first_triangle_of(others), ignore); }
}

// Tests all boxes of one level at once, which saves the rounds for the levels above.
fn begin_search(is_traced: bool, ray: PreparedRay, local: u32) {
    if local == 0u {
        atomicStore(&waiting_count, 0u);
        atomicStore(&first_note, NO_NOTE);
        atomicStore(&note_count, 0u);
        atomicStore(&surely_met, 0u);
    }
    workgroupBarrier();
    if !is_traced { return; }
    for (var k = local; k < params.start_count; k += 64u) {
        let row = params.start_row + 2u * k;
        if intersects_box(ray, nodes[row], nodes[row + 1u], ray.t_max) { wait(nodes[row].w); }
    }
}

// Returns the number of waiting nodes and the state of the search: 1 if it has ended, 2 if it gave up for lack of space.
fn stand_of_round(local: u32) -> vec2<u32> {
    if local == 0u {
        let waits = atomicLoad(&waiting_count);
        let over = waits == 0u || atomicLoad(&surely_met) == 1u;
        standing_of_round = vec2<u32>(waits, select(select(0u, 2u, waits + 64u > ROOM), 1u, over));
    }
    return workgroupUniformLoad(&standing_of_round);
}

// Returns NO_NOTE if nothing is hit, MET, TOO_MANY, or the first note of the triangles that may be hit. All invocations of the
// workgroup must call it.
fn search_together(is_traced: bool, ray: PreparedRay, ignore: u32, local: u32) -> u32 {
    set_view(ray);
    begin_search(is_traced, ray, local);
    var stand = vec2<u32>(0u);
    loop {
        workgroupBarrier();
        stand = stand_of_round(local);
        if stand.y != 0u { break; }
        let taken = min(stand.x, 64u);
        var node = NO_NODE;
        if local < taken { node = waiting[stand.x - 1u - local]; }
        if local == 0u { atomicSub(&waiting_count, taken); }
        workgroupBarrier();
        if local < taken { visit(ray, node, ignore); }
    }
    storageBarrier();
    if local == 0u { outcome = select(NO_NOTE, outcome_of(ray, stand.y == 2u), is_traced); }
    return workgroupUniformLoad(&outcome);
}

fn outcome_of(ray: PreparedRay, gave_up: bool) -> u32 {
    let notes = atomicLoad(&note_count);
    if atomicLoad(&surely_met) == 1u { return MET; }
    let lost = atomicLoad(&counts[NOTES]) > params.search.notes && notes > 0u;
    return select(atomicLoad(&first_note), TOO_MANY, gave_up || lost);
}

// Shadows of an open hit's candidates, computed before the hit is resolved.

// Number of candidates per ray that are considered, and of workgroups that share a ray's candidates.
const CANDIDATES: u32 = 8u;
const ABREAST: u32 = 4u;
// With more open rays, tracing shadow rays for all candidates takes longer than waiting for the hits (an H200).
const MOST_RAYS: u32 = 512u;

// Result of a search along a segment to the light, and of its notes.
struct Sought { found: u32, said: Said }

// All invocations of the workgroup must call it.
fn seek_along(segment: ShadowSegment, ignore: u32, local: u32) -> Sought {
    var sought = Sought(search_together(segment.is_traced, shadow_ray(segment), ignore, local), Said());
    if sought.found != MET && sought.found != NO_NOTE {
        set_line_of_segment(segment);
        sought.said = said_by_notes(select(NO_NOTE, listed(sought.found), local < 16u), local);
    }
    return sought;
}

// Returns the result of a search and its notes: 0, 1 or TOO_MANY.
fn known(sought: Sought) -> u32 {
    if sought.found == MET || sought.said.met { return 1u; }
    return select(0u, TOO_MANY, sought.found == TOO_MANY || sought.said.hard);
}

// Returns the shadow of an open ray's hit, after the hit was resolved: 0, 1, or TOO_MANY if it is not known yet.
fn known_shadow(i: u32, hit: vec4<u32>) -> u32 {
    if hit.w == 0xffffffffu { return 0u; }
    var note = listed(occluded[i]);
    for (var c = 0u; c < CANDIDATES && note != NO_NOTE; c += 1u) {
        if records[3u * occluded[note_at(note)]].w == hit.w { return occluded[shadow_of(note)]; }
        note = occluded[note_at(note) + 1u];
    }
    return TOO_MANY;
}

// Resolves all rays that `trace_and_shadow_camera` left open. One group of workgroups shares the hits, a second one the shadow
// rays. If open hits are few, the other workgroups trace the shadow rays of their candidates, so that these need not wait for the
// hits.

// Stores in a candidate's note whether its segment to the light is occluded. This stays unknown if about 48 bits do not decide
// how the hit is rounded. The result is only valid if the candidate turns out to be the hit.
fn seek_shadow(i: u32, note: u32, local: u32) {
    let reported = surely_reported(prepared_query_ray(i), occluded[note_at(note)], bitcast<vec3<u32>>(direction_of_ray(i)));
    if !reported.sure { return; }
    let hit = reported.hit;
    let sought = seek_along(shadow_segment_of_hit(hit, eye()), hit.w, local);
    if local == 0u { occluded[shadow_of(note)] = known(sought); }
}

fn seek_shadows(local: u32, number: u32, sharers: u32) {
    let open = begin_rounds(local, OPEN_RAYS);
    if open > MOST_RAYS { return; }
    for (var k = number / ABREAST; k < open; k += sharers / ABREAST) {
        let i = occluded[params.search.open_rays_at + k];
        var note = note_after(listed(occluded[i]), number % ABREAST);
        for (var c = number % ABREAST; c < CANDIDATES && note != NO_NOTE; c += ABREAST) {
            seek_shadow(i, note, local);
            note = note_after(note, ABREAST);
        }
    }
}

// Variants: intersector(exact), arithmetic.
// Parameters: search.
@compute @workgroup_size(64)
fn resolve_exact_together(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    let sharers = params.search.sharers;
    if number < sharers {
        resolve_exact_hits(local, number, sharers);
    } else if number < 2u * sharers {
        resolve_exact_queries(local, number - sharers, sharers, BLOCKED_COUNT);
    } else {
        seek_shadows(local, number - 2u * sharers, groups.x * groups.y - 2u * sharers);
    }
}

// Shadow rays of hits that `trace_and_shadow_camera` left open, after the hits were resolved. Takes the results that
// `resolve_exact_together` stored with candidates. The other shadow rays are traced by one workgroup each.

// Writes the result of a search, or appends the ray to the list of open shadow rays.
fn keep(i: u32, sought: Sought) {
    let found = sought.found;
    if found == MET || found == NO_NOTE {
        answer_any(i, found == MET, BLOCKED_COUNT);
        return;
    }
    occluded[i] = found;
    occluded[params.search.open_shadows_at + atomicAdd(&counts[OPEN_SHADOWS], 1u)] = i;
    resolve_exact_any(i, BLOCKED_COUNT, sought.said);
}

// Variants: intersector(exact).
// Parameters: search.
@compute @workgroup_size(64)
fn shadow_left(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    let open = begin_rounds(local, OPEN_RAYS);
    for (var k = number; k < open; k += groups.x * groups.y) {
        let i = occluded[params.search.open_rays_at + k];
        let hit = hits[i];
        if local == 0u { outcome = known_shadow(i, hit); }
        let told = workgroupUniformLoad(&outcome);
        if told != TOO_MANY {
            if local == 0u { answer_any(i, told == 1u, BLOCKED_COUNT); }
            continue;
        }
        let sought = seek_along(shadow_segment_of_hit(hit, eye()), hit.w, local);
        if local == 0u { keep(i, sought); }
    }
}
