// Rays that a search leaves open, each with a list of candidates: notes of the triangles that it may hit. A note takes three
// words: a leaf, the next note, and what is known of the shadow if that leaf is hit (resolve_together.wgsl).
//
// `occluded` holds a word a ray, the list of open rays, and the notes; then the stacks of fallback.wgsl, and a list of open
// shadows, for kernels that need both. `destination` says where the list begins that a search for any hit fills.

import package::lib::buffers::{counts, occluded};
import package::lib::params::params;

// An open ray has the number of its first note in place of an answer to any-hit queries, which is 0 or 1.
const FIRST_NOTE: u32 = 2u;
const NO_NOTE: u32 = 0xffffffffu;
// In place of the first note: there was no room for them all, or they say nothing.
const TOO_MANY: u32 = 0xfffffffeu;
// In place of the first weight in the hit of an open ray: no weight has such bits.
const OPEN: u32 = 0xffffffffu;

// Words of `counts`: rays that are open, and notes; from the former on, rays that notes do not settle.
const OPEN_RAYS: u32 = 7u;
const OPEN_SHADOWS: u32 = 8u;
const NOTES: u32 = 9u;
const HARD: u32 = 3u;

fn note_at(note: u32) -> u32 { return 2u * params.first + 3u * (note - FIRST_NOTE); }

// Where it is noted whether the way from a note's leaf to the light is occluded: 0, 1, or TOO_MANY if nobody knows.
fn shadow_of(note: u32) -> u32 { return note_at(note) + 2u; }

// A note of a leaf, in no list yet, or TOO_MANY if there is no room.
fn new_note(leaf: u32) -> u32 {
    let place = atomicAdd(&counts[NOTES], 1u);
    if place >= params.notes { return TOO_MANY; }
    occluded[note_at(place + FIRST_NOTE)] = leaf;
    occluded[shadow_of(place + FIRST_NOTE)] = TOO_MANY;
    return place + FIRST_NOTE;
}

// Writes whether a ray meets anything, and counts it as word `count` of `counts` if it does.
fn answer_any(i: u32, met: bool, count: u32) {
    occluded[i] = select(0u, 1u, met);
    if met { atomicAdd(&counts[count], 1u); }
}

// A list to go through: empty where there was no room.
fn listed(list: u32) -> u32 { return select(list, NO_NOTE, list == TOO_MANY); }

// Adds a note to a ray's list.
fn with_note(list: u32, leaf: u32) -> u32 {
    if list == TOO_MANY { return TOO_MANY; }
    let note = new_note(leaf);
    if note != TOO_MANY { occluded[note_at(note) + 1u] = list; }
    return note;
}
