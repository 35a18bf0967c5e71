// Rays that a search leaves undecided. Each has a linked list of candidates: the triangles that it may hit. A candidate takes
// two words: its leaf, and the next candidate.
//
// `occluded` holds one word per ray, the list of undecided rays, the candidates, and the stacks of fallback.wgsl.
// Any-hit searches list their undecided rays at `undecided_shadows_at`. In kernels that need both lists, this second
// list follows the stacks. In other kernels, it replaces the first list.

import package::lib::buffers::{counts, occluded};
import package::lib::counters::CANDIDATE_COUNT;
import package::lib::params::params;

// Index of the first candidate. In `occluded`, an undecided any-hit query holds such an index instead of the result 0 or 1.
const FIRST_CANDIDATE: u32 = 2u;
const NO_CANDIDATE: u32 = 0xffffffffu;
// In place of a candidate's index: the list did not fit, or does not decide the ray.
const UNDECIDED: u32 = 0xfffffffeu;
// In place of the second weight of a hit: the ray is undecided. No weight has these bits.
const UNDECIDED_HIT: u32 = 0xffffffffu;

// Candidates follow the results and the list of undecided rays, which have one word per ray each.
fn candidate_at(candidate: u32) -> u32 { return 2u * params.search.undecided_rays_at + 2u * (candidate - FIRST_CANDIDATE); }

// Returns where ray `k` of both lists is stored in `occluded`: the undecided hits come before the undecided shadows.
fn listed_at(k: u32, undecided_hits: u32) -> u32 {
    if k < undecided_hits { return params.search.undecided_rays_at + k; }
    return params.search.undecided_shadows_at + k - undecided_hits;
}

// Allocates a candidate that is in no list yet. Returns UNDECIDED if the buffer is full.
fn allocate_candidate(leaf: u32) -> u32 {
    let index = atomicAdd(&counts[CANDIDATE_COUNT], 1u);
    if index >= params.search.candidate_capacity { return UNDECIDED; }
    occluded[candidate_at(index + FIRST_CANDIDATE)] = leaf;
    return index + FIRST_CANDIDATE;
}

// Writes whether a ray hits anything. If it does, increments word `counter` of `counts`.
fn write_any_hit(i: u32, is_hit: bool, counter: u32) {
    occluded[i] = select(0u, 1u, is_hit);
    if is_hit { atomicAdd(&counts[counter], 1u); }
}

// Returns a list to iterate over: empty if its candidates did not fit.
fn list_or_empty(list: u32) -> u32 { return select(list, NO_CANDIDATE, list == UNDECIDED); }

// Prepends a candidate to a ray's list. Returns the new list.
fn prepend_candidate(list: u32, leaf: u32) -> u32 {
    if list == UNDECIDED { return UNDECIDED; }
    let candidate = allocate_candidate(leaf);
    if candidate != UNDECIDED { occluded[candidate_at(candidate) + 1u] = list; }
    return candidate;
}
