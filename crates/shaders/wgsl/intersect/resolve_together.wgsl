// Settles what `trace_and_shadow_camera` left open: hits and shadows at once, then the shadows that are left.

import package::geometry::layout::{LEAF, NONE, children_of, first_of, others_of};
import package::geometry::light::{ToLight, ray_to_light, set_line_along, to_light};
import package::geometry::queries::{eye, ray_of, way_through};
import package::geometry::ray::{Prepared, meets_box};
import package::geometry::record::corners_of;
import package::intersect::determinants::{begin_rounds, note_after};
import package::intersect::filter::{judge, set_view};
import package::intersect::reported::surely_reported;
import package::intersect::candidates::{
    NOTES, NO_NOTE, OPEN_RAYS, OPEN_SHADOWS, TOO_MANY, answer_any, listed, new_note, note_at, shadow_of,
};
import package::intersect::resolve_exact::{
    Said, resolve_exact_any, resolve_exact_hits, resolve_exact_queries, said_by_notes,
};
import package::lib::buffers::{counts, hits, nodes, occluded, records};
import package::lib::params::params;

// Whether one ray meets anything, sought by all of a workgroup of 64: each takes a node in turn. Where rays are few, each waits
// for memory at every node: so they took less than half the time that an invocation alone takes (an H200, some hundred rays).

// In place of the first note: a triangle is surely met.
const MET: u32 = 0xfffffffdu;
// Nodes that wait, and how many there is room for.
const ROOM: u32 = 1024u;

var<workgroup> waiting: array<u32, ROOM>;
var<workgroup> waiting_count: atomic<u32>;
var<workgroup> first_note: atomic<u32>;
var<workgroup> note_count: atomic<u32>;
var<workgroup> surely_met: atomic<u32>;
// Of this round: how many nodes wait, and whether the search is over.
var<workgroup> standing_of_round: vec2<u32>;
// What came of the search.
var<workgroup> outcome: u32;

fn wait(node: u32) { waiting[atomicAdd(&waiting_count, 1u)] = node; }

fn record_candidate_together(leaf: u32) {
    atomicAdd(&note_count, 1u);
    let note = new_note(leaf);
    if note != TOO_MANY { occluded[note_at(note) + 1u] = atomicExchange(&first_note, note); }
}

fn see_together(ray: Prepared, leaf: u32, ignore: u32) {
    let corners = corners_of(leaf);
    if corners.triangle == ignore { return; }
    let j = judge(ray, corners);
    if j.sure { atomicStore(&surely_met, 1u); } else if j.possible { record_candidate_together(leaf); }
}

// A leaf's triangles, or children to wait.
fn visit(ray: Prepared, node: u32, ignore: u32) {
    if (node & LEAF) == 0u {
        let row = children_of(node);
        if meets_box(ray, nodes[row], nodes[row + 1u], ray.t_max) { wait(nodes[row].w); }
        if meets_box(ray, nodes[row + 2u], nodes[row + 3u], ray.t_max) { wait(nodes[row + 2u].w); }
        return;
    }
    see_together(ray, first_of(node), ignore);
    let others = others_of(node);
    if others != NONE { see_together(ray, first_of(others), ignore); }
}

// Goes to all boxes of a level at once, which saves the rounds down to it.
fn begin_search(traced: bool, ray: Prepared, local: u32) {
    if local == 0u {
        atomicStore(&waiting_count, 0u);
        atomicStore(&first_note, NO_NOTE);
        atomicStore(&note_count, 0u);
        atomicStore(&surely_met, 0u);
    }
    workgroupBarrier();
    if !traced { return; }
    for (var k = local; k < params.count; k += 64u) {
        let row = params.goal + 2u * k;
        if meets_box(ray, nodes[row], nodes[row + 1u], ray.t_max) { wait(nodes[row].w); }
    }
}

// How many nodes wait, and whether to end: 1 if there is an answer, 2 if there will be none.
fn stand_of_round(local: u32) -> vec2<u32> {
    if local == 0u {
        let waits = atomicLoad(&waiting_count);
        let over = waits == 0u || atomicLoad(&surely_met) == 1u;
        standing_of_round = vec2<u32>(waits, select(select(0u, 2u, waits + 64u > ROOM), 1u, over));
    }
    return workgroupUniformLoad(&standing_of_round);
}

// NO_NOTE if nothing is met, MET, TOO_MANY, or the first of the notes of those that may be. All of a workgroup call it.
fn search_together(traced: bool, ray: Prepared, ignore: u32, local: u32) -> u32 {
    set_view(ray);
    begin_search(traced, ray, local);
    var stand = vec2<u32>(0u);
    loop {
        workgroupBarrier();
        stand = stand_of_round(local);
        if stand.y != 0u { break; }
        let taken = min(stand.x, 64u);
        var node = NONE;
        if local < taken { node = waiting[stand.x - 1u - local]; }
        if local == 0u { atomicSub(&waiting_count, taken); }
        workgroupBarrier();
        if local < taken { visit(ray, node, ignore); }
    }
    storageBarrier();
    if local == 0u { outcome = select(NO_NOTE, outcome_of(ray, stand.y == 2u), traced); }
    return workgroupUniformLoad(&outcome);
}

fn outcome_of(ray: Prepared, gave_up: bool) -> u32 {
    let notes = atomicLoad(&note_count);
    if atomicLoad(&surely_met) == 1u { return MET; }
    let lost = atomicLoad(&counts[NOTES]) > params.notes && notes > 0u;
    return select(atomicLoad(&first_note), TOO_MANY, gave_up || lost);
}

// What is known of the shadows of an open hit's candidates, before it is known which of them is the hit.

// Candidates of a ray that are looked at, the first of its notes, and workgroups that take one each at a time.
const CANDIDATES: u32 = 8u;
const ABREAST: u32 = 4u;
// Of more rays than these, to seek the shadows of all candidates takes longer than to wait for the hits (an H200).
const MOST_RAYS: u32 = 512u;

// What a search and its notes say of a way to the light.
struct Sought { found: u32, said: Said }

// All of a workgroup call it.
fn seek_along(way: ToLight, ignore: u32, local: u32) -> Sought {
    var sought = Sought(search_together(way.traced, ray_to_light(way), ignore, local), Said());
    if sought.found != MET && sought.found != NO_NOTE {
        set_line_along(way);
        sought.said = said_by_notes(select(NO_NOTE, listed(sought.found), local < 16u), local);
    }
    return sought;
}

// What a search and its notes say of whether anything is met: 0, 1 or TOO_MANY.
fn known(sought: Sought) -> u32 {
    if sought.found == MET || sought.said.met { return 1u; }
    return select(0u, TOO_MANY, sought.found == TOO_MANY || sought.said.hard);
}

// The shadow of an open ray's hit, now that it is settled: 0, 1, or TOO_MANY if it is yet to be sought.
fn known_shadow(i: u32, hit: vec4<u32>) -> u32 {
    if hit.w == 0xffffffffu { return 0u; }
    var note = listed(occluded[i]);
    for (var c = 0u; c < CANDIDATES && note != NO_NOTE; c += 1u) {
        if records[3u * occluded[note_at(note)]].w == hit.w { return occluded[shadow_of(note)]; }
        note = occluded[note_at(note) + 1u];
    }
    return TOO_MANY;
}

// All that `trace_and_shadow_camera` left open, at once: workgroups share the hits, as many share the shadows, and where open
// hits are few all others seek the shadows that they will have, a workgroup a candidate, so as not to wait for the hits.

// Whether the way from a candidate to the light is occluded, as its note will say. It stays unknown where about 48 bits
// do not decide how the hit is rounded. Those bits are meaningful for any candidate that turns out to be the hit.
fn seek_shadow(i: u32, note: u32, local: u32) {
    let reported = surely_reported(ray_of(i), occluded[note_at(note)], bitcast<vec3<u32>>(way_through(i)));
    if !reported.sure { return; }
    let hit = reported.hit;
    let sought = seek_along(to_light(hit, eye()), hit.w, local);
    if local == 0u { occluded[shadow_of(note)] = known(sought); }
}

fn seek_shadows(local: u32, number: u32, sharers: u32) {
    let open = begin_rounds(local, OPEN_RAYS);
    if open > MOST_RAYS { return; }
    for (var k = number / ABREAST; k < open; k += sharers / ABREAST) {
        let i = occluded[params.first + k];
        var note = note_after(listed(occluded[i]), number % ABREAST);
        for (var c = number % ABREAST; c < CANDIDATES && note != NO_NOTE; c += ABREAST) {
            seek_shadow(i, note, local);
            note = note_after(note, ABREAST);
        }
    }
}

// Variants: intersector(exact), arithmetic.
@compute @workgroup_size(64)
fn resolve_exact_together(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    let sharers = params.first_group;
    if number < sharers {
        resolve_exact_hits(local, number, sharers);
    } else if number < 2u * sharers {
        resolve_exact_queries(local, number - sharers, sharers, 3u);
    } else {
        seek_shadows(local, number - 2u * sharers, groups.x * groups.y - 2u * sharers);
    }
}

// The shadows of the hits that `trace_and_shadow_camera` left open, now that they are settled: what `resolve_exact_together`
// found of those that were candidates; of others, sought by a workgroup a ray.

// Writes what a search found, or lists the ray as open.
fn keep(i: u32, sought: Sought) {
    let found = sought.found;
    if found == MET || found == NO_NOTE {
        answer_any(i, found == MET, 3u);
        return;
    }
    occluded[i] = found;
    occluded[params.destination + atomicAdd(&counts[OPEN_SHADOWS], 1u)] = i;
    resolve_exact_any(i, 3u, sought.said);
}

// Variants: intersector(exact).
@compute @workgroup_size(64)
fn shadow_left(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    let open = begin_rounds(local, OPEN_RAYS);
    for (var k = number; k < open; k += groups.x * groups.y) {
        let i = occluded[params.first + k];
        let hit = hits[i];
        if local == 0u { outcome = known_shadow(i, hit); }
        let told = workgroupUniformLoad(&outcome);
        if told != TOO_MANY {
            if local == 0u { answer_any(i, told == 1u, 3u); }
            continue;
        }
        let sought = seek_along(to_light(hit, eye()), hit.w, local);
        if local == 0u { keep(i, sought); }
    }
}
