// The intersector `exact`: the part that rounded arithmetic decides.

import package::geometry::node::NO_LEAF;
import package::geometry::queries::direction_of_ray;
import package::geometry::ray::{MISS, PreparedRay};
import package::geometry::record::corners_of;
import package::intersect::candidates::{NO_NOTE, OPEN, with_note};
import package::intersect::filter::{judge, set_view};
import package::intersect::reported::surely_reported;
import package::lib::buffers::{counts, occluded, rays};
import package::lib::counters::{HIT_COUNT, OPEN_OF, OPEN_RAYS};
import package::lib::params::params;
import package::traversal::traverse::find_any;

// Closest-hit search. It decides most rays. The others are left to the kernels `resolve_exact_*`, with notes of their candidates.

// Start of an interval that does not exist.
const NEVER: f32 = 3.4028234663852886e38;

// `bound` is the least upper end of all sure hits' intervals. `leaf` is the hit with that interval, which begins at `low`.
// `other` is where the first interval of all other candidates begins.
struct ExactFound { bound: f32, low: f32, other: f32, leaf: u32, notes: u32 }

fn exact_nothing_found(ray: PreparedRay) -> ExactFound {
    set_view(ray);
    return ExactFound(ray.t_max, NEVER, NEVER, NO_LEAF, NO_NOTE);
}

// Returns the direction of an explicit ray or of a pixel's ray, as bits.
@if(trace_rays)
fn exact_direction_of(i: u32) -> vec3<u32> { return rays[2u * i + 1u].xyz; }
@else
fn exact_direction_of(i: u32) -> vec3<u32> { return bitcast<vec3<u32>>(direction_of_ray(i)); }

// Nodes with an entry beyond this are skipped.
fn exact_limit(found: ExactFound) -> f32 { return found.bound; }

fn exact_intersect_leaf_closest(ray: PreparedRay, leaf: u32, found: ExactFound) -> ExactFound {
    let j = judge(ray, corners_of(leaf));
    if !j.possible || !(j.low <= found.bound) { return found; }
    if !(j.sure && j.high < found.bound) {
        return ExactFound(found.bound, found.low, min(found.other, j.low), found.leaf, with_note(found.notes, leaf));
    }
    // If the intervals overlap, the previous best hit stays a candidate.
    if found.leaf == NO_LEAF || found.low > j.high { return ExactFound(j.high, j.low, found.other, leaf, found.notes); }
    return ExactFound(j.high, j.low, min(found.other, found.low), leaf, with_note(found.notes, found.leaf));
}

// Rasterization: the hit of one triangle.

// Returns the least distance at which a ray may hit a leaf's triangle, or infinity.
fn exact_begin_of(ray: PreparedRay, leaf: u32) -> f32 {
    set_view(ray);
    let j = judge(ray, corners_of(leaf));
    if !j.possible { return bitcast<f32>(0x7f800000u | params.zero); }
    // Negative where the interval's beginning is rounded below 0.
    return select(0.0, j.low, j.low > 0.0);
}

// Returns the hit of a leaf's triangle if it is sure.
fn exact_hit_on(ray: PreparedRay, leaf: u32) -> ExactFound {
    let nothing = exact_nothing_found(ray);
    let j = judge(ray, corners_of(leaf));
    if j.sure && j.high < nothing.bound { return ExactFound(j.high, j.low, NEVER, leaf, NO_NOTE); }
    return nothing;
}

fn exact_is_found(found: ExactFound) -> bool { return found.leaf != NO_LEAF; }

// Returns the hit to write for a ray, or the data for the kernel that resolves it.
fn exact_hit_of(i: u32, ray: PreparedRay, found: ExactFound) -> vec4<u32> {
    if found.other < NEVER && found.other <= found.bound {
        var notes = found.notes;
        if found.leaf != NO_LEAF { notes = with_note(notes, found.leaf); }
        return left_open(i, found.bound, notes);
    }
    if found.leaf == NO_LEAF { return MISS; }
    let reported = surely_reported(ray, found.leaf, exact_direction_of(i));
    if !reported.sure { return left_open(i, found.bound, with_note(NO_NOTE, found.leaf)); }
    atomicAdd(&counts[HIT_COUNT], 1u);
    return reported.hit;
}

// Appends a ray to the list of open rays. Hits beyond `bound` are not searched for.
fn left_open(i: u32, bound: f32, list: u32) -> vec4<u32> {
    occluded[params.search.open_rays_at + atomicAdd(&counts[OPEN_RAYS], 1u)] = i;
    return vec4<u32>(bitcast<u32>(bound), list, OPEN, 0u);
}

// Returns whether the ray was left open.
fn exact_is_unresolved(hit: vec4<u32>) -> bool { return hit.z == OPEN; }

// Any-hit search. If no triangle is surely hit but some may be, the ray is left to the kernels `resolve_exact_*`, with notes of
// those triangles.

var<private> notes: u32 = NO_NOTE;

fn exact_intersect_leaf_any(ray: PreparedRay, leaf: u32, ignore: u32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == ignore { return false; }
    let j = judge(ray, corners);
    if j.possible && !j.sure { notes = with_note(notes, leaf); }
    return j.sure;
}

fn exact_ask_any(ray: PreparedRay, ignore: u32) -> bool {
    notes = NO_NOTE;
    set_view(ray);
    return find_any(ray, ignore);
}

// Writes whether a ray hit anything. A hit increments word `count` of `counts`. An open ray is appended with its notes to the
// list at `open_shadows_at`, whose length is word `count + OPEN_OF`.
fn exact_store_occluded(i: u32, met: bool, count: u32) {
    if met {
        occluded[i] = 1u;
        atomicAdd(&counts[count], 1u);
    } else if notes != NO_NOTE {
        occluded[i] = notes;
        occluded[params.search.open_shadows_at + atomicAdd(&counts[count + OPEN_OF], 1u)] = i;
    } else {
        occluded[i] = 0u;
    }
}
