// Writes the hit of a camera ray and its shadow.

import package::geometry::ray::MISS;
import package::geometry::shadow_ray::{is_occluded, shadow_segment_of_best};
import package::intersect::intersector::{BestHit, is_undecided, store_occluded};
import package::lib::buffers::hits;
import package::lib::counters::OCCLUDED_COUNT;

// Writes the hit of ray `i` from `eye`, and whether the hit point is in shadow. With `watertight` and `exact`, `best`
// must contain the leaf of `hit`.
fn write_hit_and_shadow(i: u32, hit: vec4<u32>, best: BestHit, eye: vec3<f32>) {
    hits[i] = hit;
    if is_undecided(hit) { return; }
    var is_shadowed = false;
    if hit.w != 0xffffffffu { is_shadowed = is_occluded(shadow_segment_of_best(best, hit, eye), hit.w); }
    store_occluded(i, is_shadowed, OCCLUDED_COUNT);
}

// Writes that ray `i` hits nothing.
fn write_miss(i: u32) {
    hits[i] = MISS;
    store_occluded(i, false, OCCLUDED_COUNT);
}
