// Rays that a search leaves open, each with a list of candidates: the triangles that it may hit. A candidate is stored as a note
// of three words: a leaf, the next note, and whether the hit is in shadow if that leaf is hit (resolve_together.wgsl).
//
// `occluded` holds one word per ray, the list of open rays, and the notes. Then follow the stacks of fallback.wgsl and, for
// kernels that need both, a list of open shadow rays. The list that any-hit searches fill begins at `open_shadows_at`.

import package::lib::buffers::{counts, occluded};
import package::lib::counters::NOTES;
import package::lib::params::params;

// Index of the first note. In `occluded`, an open any-hit query has such an index in place of the answer 0 or 1.
const FIRST_NOTE: u32 = 2u;
const NO_NOTE: u32 = 0xffffffffu;
// In place of the first note: the notes did not fit or do not decide the ray.
const TOO_MANY: u32 = 0xfffffffeu;
// In place of the first weight of an open ray's hit. No weight has these bits.
const OPEN: u32 = 0xffffffffu;

fn note_at(note: u32) -> u32 { return 2u * params.search.open_rays_at + 3u * (note - FIRST_NOTE); }

// Returns the word that holds the shadow of a note's leaf: 0, 1, or TOO_MANY if it is unknown.
fn shadow_of(note: u32) -> u32 { return note_at(note) + 2u; }

// Allocates a note of a leaf, in no list yet. Returns TOO_MANY if there is no space.
fn new_note(leaf: u32) -> u32 {
    let place = atomicAdd(&counts[NOTES], 1u);
    if place >= params.search.notes { return TOO_MANY; }
    occluded[note_at(place + FIRST_NOTE)] = leaf;
    occluded[shadow_of(place + FIRST_NOTE)] = TOO_MANY;
    return place + FIRST_NOTE;
}

// Writes whether a ray hits anything. If it does, increments word `count` of `counts`.
fn answer_any(i: u32, met: bool, count: u32) {
    occluded[i] = select(0u, 1u, met);
    if met { atomicAdd(&counts[count], 1u); }
}

// Returns a list to iterate over: empty if its notes did not fit.
fn listed(list: u32) -> u32 { return select(list, NO_NOTE, list == TOO_MANY); }

// Prepends a note to a ray's list.
fn with_note(list: u32, leaf: u32) -> u32 {
    if list == TOO_MANY { return TOO_MANY; }
    let note = new_note(leaf);
    if note != TOO_MANY { occluded[note_at(note) + 1u] = list; }
    return note;
}
