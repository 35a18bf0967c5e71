// The intersector `exact`, first pass: rounded arithmetic with error bounds decides most rays.

import package::geometry::node::NO_LEAF;
import package::geometry::queries::direction_of_ray;
import package::geometry::ray::{MISS, PreparedRay};
import package::geometry::record::corners_of;
import package::geometry::units::scale_point;
import package::intersect::candidates::{NO_CANDIDATE, UNDECIDED_HIT, prepend_candidate};
import package::intersect::filter::{classify, set_shear_view};
import package::intersect::round_hit::{permuted_line, round_hit};
import package::lib::buffers::{counts, occluded, rays};
import package::lib::counters::{HIT_COUNT, UNDECIDED_OFFSET, UNDECIDED_RAYS};
import package::lib::params::params;
import package::traversal::traverse::find_any;

// Closest-hit search. The kernels `resolve_exact_*` resolve undecided rays from their candidates.

// Lower end of an interval that does not exist.
const NO_INTERVAL: f32 = 3.4028234663852886e38;

// The best hit so far. The t of each hit is known up to an interval. `bound` is the least upper end among certain hits, and `low`
// the lower end of that interval. `leaf` is the triangle. `other_low` is the least lower end of all other candidates.
struct ExactBest { bound: f32, low: f32, other_low: f32, leaf: u32, candidates: u32 }

fn exact_initial_best(ray: PreparedRay) -> ExactBest {
    set_shear_view(ray);
    return ExactBest(ray.t_max, NO_INTERVAL, NO_INTERVAL, NO_LEAF, NO_CANDIDATE);
}

// Returns the direction of an explicit ray or of a pixel's ray. It is scaled as in `PreparedRay`, but keeps its small
// components.
@if(trace_rays)
fn exact_direction_of(i: u32, ray: PreparedRay) -> vec3<f32> { return scale_direction(rays[2u * i + 1u].xyz, ray); }
@else
fn exact_direction_of(i: u32, ray: PreparedRay) -> vec3<f32> {
    return scale_direction(bitcast<vec3<u32>>(direction_of_ray(i)), ray);
}

fn scale_direction(direction: vec3<u32>, ray: PreparedRay) -> vec3<f32> {
    return scale_point(direction, -ray.exponent - params.scale_exponent);
}

// Returns the distance beyond which nodes are skipped.
fn exact_search_limit(best: ExactBest) -> f32 { return best.bound; }

fn exact_intersect_leaf_closest(ray: PreparedRay, leaf: u32, best: ExactBest) -> ExactBest {
    let classified = classify(ray, corners_of(leaf));
    if !classified.possible || !(classified.low <= best.bound) { return best; }
    if !(classified.certain && classified.high < best.bound) {
        return ExactBest(
            best.bound, best.low, min(best.other_low, classified.low), best.leaf, prepend_candidate(best.candidates, leaf),
        );
    }
    // If the intervals overlap, the previous best hit stays a candidate.
    if best.leaf == NO_LEAF || best.low > classified.high {
        return ExactBest(classified.high, classified.low, best.other_low, leaf, best.candidates);
    }
    return ExactBest(
        classified.high, classified.low, min(best.other_low, best.low), leaf, prepend_candidate(best.candidates, best.leaf),
    );
}

// Rasterization: the hit of one triangle.

// Returns the least distance at which ray `i` may hit a leaf's triangle, or infinity. Tests an uncertain triangle again with
// about 48 bits. Without this test, both triangles at an edge near the ray would write a key for the pixel.
fn exact_nearest_t(i: u32, ray: PreparedRay, leaf: u32) -> f32 {
    set_shear_view(ray);
    let classified = classify(ray, corners_of(leaf));
    if !classified.possible || (!classified.certain && round_hit(permuted_line(ray, exact_direction_of(i, ray)), leaf).is_missed) {
        return bitcast<f32>(0x7f800000u | params.zero);
    }
    // Rounding may make the lower end negative.
    return select(0.0, classified.low, classified.low > 0.0);
}

// Returns the hit to write for a ray, or the data for the kernel that resolves it.
fn exact_hit_of(i: u32, ray: PreparedRay, best: ExactBest) -> vec4<u32> {
    if best.other_low < NO_INTERVAL && best.other_low <= best.bound {
        var first_candidate = best.candidates;
        if best.leaf != NO_LEAF { first_candidate = prepend_candidate(first_candidate, best.leaf); }
        return append_undecided(i, best.bound, first_candidate);
    }
    if best.leaf == NO_LEAF { return MISS; }
    let rounded = round_hit(permuted_line(ray, exact_direction_of(i, ray)), best.leaf);
    if !rounded.is_rounded { return append_undecided(i, best.bound, prepend_candidate(NO_CANDIDATE, best.leaf)); }
    atomicAdd(&counts[HIT_COUNT], 1u);
    return rounded.hit;
}

// Appends a ray to the list of undecided rays. Its hit is not beyond `bound`.
fn append_undecided(i: u32, bound: f32, first_candidate: u32) -> vec4<u32> {
    occluded[params.search.undecided_rays_at + atomicAdd(&counts[UNDECIDED_RAYS], 1u)] = i;
    return vec4<u32>(bitcast<u32>(bound), first_candidate, UNDECIDED_HIT, 0u);
}

fn exact_is_undecided(hit: vec4<u32>) -> bool { return hit.z == UNDECIDED_HIT; }

// Any-hit search. If no triangle is certainly hit but some may be, the kernels `resolve_exact_*` resolve the ray from these
// candidates.

var<private> candidates: u32 = NO_CANDIDATE;

fn exact_intersect_leaf_any(ray: PreparedRay, leaf: u32, ignore: u32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == ignore { return false; }
    let classified = classify(ray, corners);
    if classified.possible && !classified.certain { candidates = prepend_candidate(candidates, leaf); }
    return classified.certain;
}

fn exact_trace_any(ray: PreparedRay, ignore: u32) -> bool {
    candidates = NO_CANDIDATE;
    set_shear_view(ray);
    return find_any(ray, ignore);
}

// Writes whether a ray hit anything. A hit increments word `counter` of `counts`. An undecided ray is appended to the
// list at `undecided_shadows_at`, whose length is word `counter + UNDECIDED_OFFSET`.
fn exact_store_occluded(i: u32, is_hit: bool, counter: u32) {
    if is_hit {
        occluded[i] = 1u;
        atomicAdd(&counts[counter], 1u);
    } else if candidates != NO_CANDIDATE {
        occluded[i] = candidates;
        occluded[params.search.undecided_shadows_at + atomicAdd(&counts[counter + UNDECIDED_OFFSET], 1u)] = i;
    } else {
        occluded[i] = 0u;
    }
}
