// Kernels that trace rays one by one.

import package::geometry::queries::{camera_ray, explicit_ray, eye, is_skipped, misses_scene, pixel_direction, pixel_of};
import package::geometry::ray::{MISS, root_relative_to};
import package::geometry::shadow_ray::{is_occluded, shadow_segment_of_hit};
import package::geometry::units::scaled_point;
import package::intersect::intersector::{hit_of, store_occluded, trace_any};
import package::lib::buffers::{hits, rays};
import package::lib::counters::{HIT_COUNT, OCCLUDED_COUNT};
import package::lib::params::{element_index, params};
import package::traversal::finish::{write_hit_and_shadow, write_miss};
import package::traversal::traverse::find_closest;

// Closest hits of camera rays, which the kernel generates.
//
// Variants: intersector, arithmetic.
// Parameters: search.
@compute @workgroup_size(128)
fn trace_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>) {
    let pixel = pixel_of(local, group);
    if pixel.x >= params.width || pixel.y >= params.height { return; }
    let direction = pixel_direction(pixel);
    let i = pixel.y * params.width + pixel.x;
    let origin = eye();
    let root = root_relative_to(origin);
    if misses_scene(direction, origin, root) {
        hits[i] = MISS;
        return;
    }
    let ray = camera_ray(direction, origin, root);
    hits[i] = hit_of(i, ray, find_closest(ray));
}

// Closest hits of explicit rays.
//
// Variants: intersector, arithmetic.
// Parameters: search.
@compute @workgroup_size(128)
fn trace_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element_index(id, groups, 128u);
    if i >= params.count { return; }
    if is_skipped(i) {
        hits[i] = MISS;
        return;
    }
    let ray = explicit_ray(i);
    hits[i] = hit_of(i, ray, find_closest(ray));
}

// Any-hit queries of explicit rays.
//
// Variants: intersector, arithmetic.
// Parameters: search.
@compute @workgroup_size(128)
fn any_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element_index(id, groups, 128u);
    if i >= params.count { return; }
    var is_hit = false;
    if !is_skipped(i) { is_hit = trace_any(explicit_ray(i), 0xffffffffu); }
    store_occluded(i, is_hit, HIT_COUNT);
}

// Closest hits of camera rays, which the kernel generates, and their shadow rays. In some scenes this takes 0.75 of the
// time of two kernels: warps that have finished their closest hits continue with shadow rays.
//
// Variants: intersector, arithmetic.
// Parameters: search.
@compute @workgroup_size(128)
fn trace_and_shadow_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>) {
    let pixel = pixel_of(local, group);
    if pixel.x >= params.width || pixel.y >= params.height { return; }
    let i = pixel.y * params.width + pixel.x;
    let direction = pixel_direction(pixel);
    let origin = eye();
    let root = root_relative_to(origin);
    if misses_scene(direction, origin, root) {
        write_miss(i);
        return;
    }
    let ray = camera_ray(direction, origin, root);
    let best = find_closest(ray);
    write_hit_and_shadow(i, hit_of(i, ray, best), best, origin);
}

// Shadow rays of the hits of explicit rays.
//
// Variants: intersector, arithmetic.
// Parameters: search.
@compute @workgroup_size(128)
fn shadow_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element_index(id, groups, 128u);
    if i >= params.count { return; }
    let hit = hits[i];
    var is_shadowed = false;
    if hit.w != 0xffffffffu { is_shadowed = is_occluded(shadow_segment_of_hit(hit, scaled_point(rays[2u * i].xyz)), hit.w); }
    store_occluded(i, is_shadowed, OCCLUDED_COUNT);
}
