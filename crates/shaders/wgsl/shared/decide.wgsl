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

// Rays left open, the same for all of a workgroup, whose rounds begin.
fn begin_rounds(local: u32, word: u32) -> u32 {
    if local == 0u { open_rays = atomicLoad(&counts[word]); }
    return workgroupUniformLoad(&open_rays);
}

// The note so many places on.
fn note_after(list: u32, places: u32) -> u32 {
    var note = list;
    for (var i = 0u; i < places && note != NO_NOTE; i += 1u) { note = occluded[note_at(note) + 1u]; }
    return note;
}

// Decides up to four notes of a ray whose line is set, from `list` on; what comes of them stands in `decided`. All of a workgroup call it.
fn decide_notes(list: u32, local: u32) {
    let note = note_after(list, (local / 4u) % 4u);
    var made = Decided();
    var f = Fixed();
    if note != NO_NOTE {
        made.leaf = occluded[note_at(note)];
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
