// Rays that a search leaves open, each with a list of candidates: the triangles that it may hit. A candidate is stored as a note
// of three words: a leaf, the next note, and whether the hit is in shadow if that leaf is hit (resolve_together.wgsl).
//
// `occluded` holds one word per ray, the list of open rays, and the notes. Then follow the stacks of fallback.wgsl and, for
// kernels that need both, a list of open shadow rays. The list that any-hit searches fill begins at `undecided_shadows_at`.

import package::lib::buffers::{counts, occluded};
import package::lib::counters::CANDIDATE_COUNT;
import package::lib::params::params;

// Index of the first note. In `occluded`, an open any-hit query has such an index in place of the answer 0 or 1.
const FIRST_CANDIDATE: u32 = 2u;
const NO_CANDIDATE: u32 = 0xffffffffu;
// In place of the first note: the notes did not fit or do not decide the ray.
const UNDECIDED: u32 = 0xfffffffeu;
// In place of the first weight of an open ray's hit. No weight has these bits.
const UNDECIDED_HIT: u32 = 0xffffffffu;

fn candidate_at(candidate: u32) -> u32 { return 2u * params.search.undecided_rays_at + 3u * (candidate - FIRST_CANDIDATE); }

// Returns the word that holds the shadow of a note's leaf: 0, 1, or TOO_MANY if it is unknown.
fn candidate_shadow_at(candidate: u32) -> u32 { return candidate_at(candidate) + 2u; }

// Allocates a note of a leaf, in no list yet. Returns TOO_MANY if there is no space.
fn allocate_candidate(leaf: u32) -> u32 {
    let place = atomicAdd(&counts[CANDIDATE_COUNT], 1u);
    if place >= params.search.candidate_capacity { return UNDECIDED; }
    occluded[candidate_at(place + FIRST_CANDIDATE)] = leaf;
    occluded[candidate_shadow_at(place + FIRST_CANDIDATE)] = UNDECIDED;
    return place + FIRST_CANDIDATE;
}

// Writes whether a ray hits anything. If it does, increments word `count` of `counts`.
fn write_any_hit(i: u32, is_hit: bool, count: u32) {
    occluded[i] = select(0u, 1u, is_hit);
    if is_hit { atomicAdd(&counts[count], 1u); }
}

// Returns a list to iterate over: empty if its notes did not fit.
fn list_or_empty(list: u32) -> u32 { return select(list, NO_CANDIDATE, list == UNDECIDED); }

// Prepends a note to a ray's list.
fn prepend_candidate(list: u32, leaf: u32) -> u32 {
    if list == UNDECIDED { return UNDECIDED; }
    let candidate = allocate_candidate(leaf);
    if candidate != UNDECIDED { occluded[candidate_at(candidate) + 1u] = list; }
    return candidate;
}
