// Computes triangle records, and one cluster per leaf, from positions.

import package::geometry::node::LEAF;
import package::geometry::record::{NO_TRIANGLE, record_of, store_triangle_index};
import package::geometry::triangle::{corner, is_degenerate, surely_has_area};
import package::geometry::units::{is_finite, scaled_point};
import package::lib::buffers::{counts, records};
import package::lib::counters::{DEGENERATE_COUNT, INACTIVE_COUNT};
import package::lib::params::{element_index, params};

// The triangles of the leaves, in the order of the curve.
@group(0) @binding(next) var<storage, read> sorted: array<u32>;
@group(0) @binding(next) var<storage, read_write> clusters: array<vec4<u32>>;

// Writes triangle records and the clusters that `cluster` merges, in leaf order.
//
// Variants: intersector.
@compute @workgroup_size(128)
fn cluster_leaves(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let leaf = element_index(id, groups, 128u);
    if leaf >= params.count { return; }
    let triangle = sorted[leaf];
    let scene_a = corner(triangle, 0u);
    let scene_b = corner(triangle, 1u);
    let scene_c = corner(triangle, 2u);
    let a = scaled_point(scene_a);
    let b = scaled_point(scene_b);
    let c = scaled_point(scene_c);
    let record = record_of(triangle, a, b, c);
    store_triangle_index(leaf, triangle);
    records[3u * leaf] = record.first;
    records[3u * leaf + 1u] = record.second;
    records[3u * leaf + 2u] = record.third;

    let is_active = is_finite(scene_a) && is_finite(scene_b) && is_finite(scene_c);
    let is_hittable = is_active
        && (surely_has_area(scene_a, scene_b, scene_c, a, b, c) || !is_degenerate(scene_a, scene_b, scene_c));
    var low = vec3<u32>(0x7f800000u);
    var high = vec3<u32>(0xff800000u);
    if is_hittable {
        low = bitcast<vec3<u32>>(min(min(a, b), c));
        high = bitcast<vec3<u32>>(max(max(a, b), c));
    } else {
        // The empty box does not suffice: rasterization reads records without testing boxes.
        records[3u * leaf].w = NO_TRIANGLE;
        atomicAdd(&counts[select(INACTIVE_COUNT, DEGENERATE_COUNT, is_active)], 1u);
    }
    clusters[2u * leaf] = vec4<u32>(low, LEAF | leaf);
    clusters[2u * leaf + 1u] = vec4<u32>(high, 0u);
}
