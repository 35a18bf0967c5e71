// Whether and where rays meet the triangles of their notes. A workgroup of 64 takes four
// rays at a time and four notes of each; four invocations share a note, one for each of the determinants U, V, W and N.

const RAYS: u32 = 4u;

// By invocation: a determinant. Then by note: D, and in the third place after it N, where the ray meets the triangle
// at t = N / D * 2^exponent.
var<workgroup> determinants: array<Whole192, 64>;
var<workgroup> decided: array<Decided, 16>;
// Open rays of this submission, and whether a ray of this round has more notes.
var<workgroup> open_rays: u32;
var<workgroup> has_more: u32;
// Invocations whose loops were whole, added up over all rounds, and turns of each as `turns.wgsl` counts them.
var<workgroup> whole_so_far: atomic<u32>;
var<workgroup> turns: array<u32, 64>;

// Rays left open, the same for all of a workgroup, whose rounds begin.
fn begin_rounds(local: u32, word: u32) -> u32 {
    if local == 0u {
        open_rays = atomicLoad(&counts[word]);
        atomicStore(&whole_so_far, 0u);
    }
    return workgroupUniformLoad(&open_rays);
}

// The same. Makes ready for those that notes do not settle.
fn begin_settling(local: u32, group: u32, word: u32) -> u32 {
    let id = 64u * group + local;
    if id < params.places { empty_place(id); }
    let open = begin_rounds(local, word);
    if id == 0u { expect_hard_rays(word, open); }
    return open;
}

// Where loops may end early, those that it happens to say nothing.
fn expect_hard_rays(word: u32, open: u32) {
    atomicStore(&counts[word + LEFT], params.places);
    if loops_may_end() && open > 0u { atomicAdd(&counts[word + HARD], 1u); }
}

// Whether the loops of all of a workgroup were whole, in this round and those before, counted from 1. All of it call it.
fn all_loops_turn(local: u32, round: u32) -> bool {
    if !loops_may_end() { return true; }
    // One that fell out of step is missed here, and ever after.
    turns[local] = 0u;
    for (var i = unforeseen(local); i < 2u; i += 1u) { turns[local] += 1u; }
    if turns[local] == 2u { atomicAdd(&whole_so_far, 1u); }
    workgroupBarrier();
    return atomicLoad(&whole_so_far) == 64u * round;
}

// The note so many places on.
fn note_after(list: u32, places: u32) -> u32 {
    var note = list;
    for (var i = 0u; i < places && note != NO_NOTE; i += 1u) { note = blocked[note_at(note) + 1u]; }
    return note;
}

// Decides up to four notes of a ray whose line is set, from `list` on; what comes of them stands in `decided`. All of a workgroup call it.
fn decide_notes(list: u32, local: u32) {
    let note = note_after(list, (local / 4u) % 4u);
    var made = Decided();
    var f = Fixed();
    if note != NO_NOTE {
        made.leaf = blocked[note_at(note)];
        let triangle = records[3u * made.leaf].w;
        f = fixed(points_of(triangle));
        if f.fits { determinants[local] = determinant(f, local & 3u); }
        made.hard = select(1u, 0u, f.fits);
        made.exponent = f.unit - line.shift - line.unit;
    }
    workgroupBarrier();
    if (local & 3u) == 0u {
        if f.fits {
            let all = Four(determinants[local], determinants[local + 1u], determinants[local + 2u], determinants[local + 3u]);
            let c = conclude(made, all);
            made = c.made;
            determinants[local] = c.d;
            determinants[local + 3u] = c.n;
        }
        decided[local / 4u] = made;
    }
    workgroupBarrier();
}

// How often a workgroup goes on to the next notes of its rays. Where loops may end early, no vector may be ended alone: it
// would be missed at barriers. A turn here is at most 1100 of all loops: two notes are compared by numbers of 12 limbs.
fn most_turns() -> u32 { return select(0xffffffffu, 48u, loops_may_end()); }

// What is left of a list, and whether nothing is left to any ray of the workgroup.
struct Rest { list: u32, all_done: bool }

// The notes after the next four. All of a workgroup call it.
fn rest_of(list: u32, local: u32) -> Rest {
    if local == 0u { has_more = 0u; }
    workgroupBarrier();
    let next = note_after(list, 4u);
    if next != NO_NOTE { has_more = 1u; }
    workgroupBarrier();
    return Rest(next, workgroupUniformLoad(&has_more) == 0u);
}
