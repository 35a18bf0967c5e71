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
