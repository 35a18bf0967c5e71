// Treelets of triangles: writes records, and the boxes of all their nodes.

import package::build::costs::sum_of_group;
import package::build::interpolate::{blend, blend_native, needs_exact_blend};
import package::build::treelet::{
    ENTRY_WORDS, LEAF_COUNT_IN_ENTRY, LEAVES_OFFSET, high_of, inner_word, load_treelet, low_of, merge_boxes, refit_treelet,
    store_box, store_leaf_reference, treelet_of_dispatch, write_treelet,
};
import package::build::treelet_refit::{finish_and_refit_parents, prefetch_parent};
import package::geometry::node::{LEAF, TWO_TRIANGLES};
import package::geometry::record::{record_of, store_triangle_index};
import package::geometry::triangle::{is_degenerate, point_of, surely_has_area};
import package::geometry::units::{is_finite, scaled_point};
import package::lib::buffers::{costs, counts, records, topology, triangles};
import package::lib::counters::{DEGENERATE_COUNT, INACTIVE_COUNT};
import package::lib::params::{element_index, params};

@group(0) @binding(next) var<storage, read> earlier: array<u32>;
@group(0) @binding(next) var<storage, read> later: array<u32>;

// Three vertex indices per triangle, in leaf order.
@if(gather_corners)
@group(0) @binding(next) var<storage, read_write> leaf_corners: array<u32>;
@else
@group(0) @binding(next) var<storage, read> leaf_corners: array<u32>;

// Flag of a triangle that shares a leaf with the next one.
const SHARED: u32 = 0x80000000u;

// Writes the vertex indices of a newly adopted tree's triangles in leaf order, so that later stages read them directly by leaf.
// Also resets the number of arrived children of each treelet.
// Parameters: treelets.
// Loaded with every scene.
@compute @workgroup_size(256)
fn gather_corners(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element_index(id, groups, 256u);
    if i >= params.count { return; }
    if i < params.treelets.treelet_count { costs[params.treelets.treelet_count + i] = 0u; }
    let triangle = topology[params.leaf_triangles_at + i / 3u] & ~SHARED;
    leaf_corners[i] = triangles[3u * triangle + i % 3u];
}

// A triangle's corners in scene units, as bits.
struct SceneCorners { a: vec3<u32>, b: vec3<u32>, c: vec3<u32> }

// Corners from positions.

@if(!preprocess_treelets_from_key_frames)
fn load_corners(vertices: vec3<u32>) -> SceneCorners {
    return SceneCorners(point_of(vertices.x), point_of(vertices.y), point_of(vertices.z));
}

// Loads the corners again, where keeping them would cost registers.
@if(!preprocess_treelets_from_key_frames)
fn reload_corners(vertices: vec3<u32>) -> SceneCorners { return load_corners(vertices); }

// Corners blended from two key frames, to the same bits that `interpolate` writes.

@if(preprocess_treelets_from_key_frames)
fn earlier_point(vertex: u32) -> vec3<u32> {
    let at = 3u * vertex;
    return vec3<u32>(earlier[at], earlier[at + 1u], earlier[at + 2u]);
}

@if(preprocess_treelets_from_key_frames)
fn later_point(vertex: u32) -> vec3<u32> {
    let at = 3u * vertex;
    return vec3<u32>(later[at], later[at + 1u], later[at + 2u]);
}

@if(preprocess_treelets_from_key_frames)
fn load_corners(vertices: vec3<u32>) -> SceneCorners {
    let from_a = earlier_point(vertices.x);
    let from_b = earlier_point(vertices.y);
    let from_c = earlier_point(vertices.z);
    // At a key frame the bits are copied and the later frame is not read.
    if bitcast<u32>(params.alpha) == 0u { return SceneCorners(from_a, from_b, from_c); }
    let to_a = later_point(vertices.x);
    let to_b = later_point(vertices.y);
    let to_c = later_point(vertices.z);
    let native = SceneCorners(
        blend_point_native(from_a, to_a), blend_point_native(from_b, to_b), blend_point_native(from_c, to_c),
    );
    let rare = any_needs_exact_blend(from_a, to_a, native.a)
        || any_needs_exact_blend(from_b, to_b, native.b)
        || any_needs_exact_blend(from_c, to_c, native.c);
    if rare { return reload_corners(vertices); }
    return native;
}

@if(preprocess_treelets_from_key_frames)
fn blend_point_native(a: vec3<u32>, b: vec3<u32>) -> vec3<u32> {
    return vec3<u32>(blend_native(a.x, b.x), blend_native(a.y, b.y), blend_native(a.z, b.z));
}

@if(preprocess_treelets_from_key_frames)
fn any_needs_exact_blend(a: vec3<u32>, b: vec3<u32>, native: vec3<u32>) -> bool {
    return needs_exact_blend(a.x, b.x, native.x) || needs_exact_blend(a.y, b.y, native.y) || needs_exact_blend(a.z, b.z, native.z);
}

// Loads the same corners again, for code that rarely runs. A loop blends one corner at a time, which saves registers.
@if(preprocess_treelets_from_key_frames)
fn reload_corners(vertices: vec3<u32>) -> SceneCorners {
    var result = SceneCorners();
    var remaining = vertices;
    for (var i = 0u; i < 3u; i += 1u) {
        var point = earlier_point(remaining.x);
        if bitcast<u32>(params.alpha) != 0u {
            let to = later_point(remaining.x);
            point = vec3<u32>(blend(point.x, to.x), blend(point.y, to.y), blend(point.z, to.z));
        }
        result = SceneCorners(result.b, result.c, point);
        remaining = remaining.yzx;
    }
    return result;
}

// Finishing a treelet whose parent another dispatch refits.

// Writes a treelet whose boxes are complete, and its sum of areas. All invocations of the workgroup must call it.
fn finish_treelet(treelet_index: u32, local: u32, area: f32) {
    write_treelet(load_treelet(treelet_index), local);
    let sum = sum_of_group(local, area);
    if local == 0u { costs[treelet_index] = sum; }
}

// A workgroup of 256 makes a whole treelet of triangles, one triangle per invocation. It sums areas to one partial sum
// per treelet. Registers limit how many workgroups a device runs at once. So values that are not needed together with the
// corners are read later, and values that are rarely needed are read again.

const EMPTY_LOW: u32 = 0x7f800000u;
const EMPTY_HIGH: u32 = 0xff800000u;

fn vertices_of(leaf: u32) -> vec3<u32> {
    return vec3<u32>(leaf_corners[3u * leaf], leaf_corners[3u * leaf + 1u], leaf_corners[3u * leaf + 2u]);
}

// Returns whether a triangle has exactly zero area. Needed only if rounded arithmetic does not prove that it has an
// area. `params.zero` prevents the compiler from reusing the corners, which would take registers.
fn has_zero_area(leaf: u32) -> bool {
    let corners = reload_corners(vertices_of(leaf + params.zero));
    return is_degenerate(corners.a, corners.b, corners.c);
}

// Stores an empty box for a triangle that no ray can hit, and counts it. Replaces the triangle index in its record by
// NO_TRIANGLE, because some kernels read records without testing boxes.
fn store_empty(local: u32, leaf: u32, counter: u32) {
    atomicAdd(&counts[counter], 1u);
    records[3u * leaf].w = 0xffffffffu;
    store_box(LEAVES_OFFSET + local, vec3<u32>(EMPTY_LOW), vec3<u32>(EMPTY_HIGH));
}

// Writes a triangle's record and stores its box. Returns whether it may still have zero area.
fn write_leaf(local: u32, leaf: u32, triangle: u32) -> bool {
    let corners = load_corners(vertices_of(leaf));
    let a = scaled_point(corners.a);
    let b = scaled_point(corners.b);
    let c = scaled_point(corners.c);
    let record = record_of(triangle, a, b, c);
    records[3u * leaf] = record.first;
    records[3u * leaf + 1u] = record.second;
    records[3u * leaf + 2u] = record.third;
    store_leaf_reference(local, LEAF | leaf);
    if !(is_finite(corners.a) && is_finite(corners.b) && is_finite(corners.c)) {
        store_empty(local, leaf, INACTIVE_COUNT);
        return false;
    }
    store_box(LEAVES_OFFSET + local, bitcast<vec3<u32>>(min(min(a, b), c)), bitcast<vec3<u32>>(max(max(a, b), c)));
    return !surely_has_area(corners.a, corners.b, corners.c, a, b, c);
}

// Returns whether a box is empty. Scaling may turn a coordinate into infinity, so one of the two values does not suffice.
fn is_empty_box(index: u32) -> bool { return low_of(index).x == EMPTY_LOW && high_of(index).x == EMPTY_HIGH; }

// Merges a triangle's leaf with the next one's. If a ray can hit one of the two triangles, the traversal reference
// includes only those that it can hit.
fn merge_leaf_pair(local: u32, leaf: u32) -> f32 {
    let first = LEAVES_OFFSET + local;
    if is_empty_box(first) {
        store_leaf_reference(local, select(LEAF | (leaf + 1u), LEAF | leaf, is_empty_box(first + 1u)));
    } else if !is_empty_box(first + 1u) {
        store_leaf_reference(local, LEAF | TWO_TRIANGLES | leaf);
    }
    return merge_boxes(first, first, first + 1u);
}

// Must be called by all invocations, in uniform control flow.
fn preprocess_treelet(local: u32, index: u32) {
    let treelet_index = treelet_of_dispatch(index);
    let leaf = topology[ENTRY_WORDS * treelet_index] + local;
    let is_leaf = local < topology[ENTRY_WORDS * treelet_index + LEAF_COUNT_IN_ENTRY];
    let packed_inner = inner_word(treelet_index, local);
    @if(preprocess_treelets_from_key_frames)
    prefetch_parent(treelet_index);
    var word = 0u;
    if is_leaf {
        word = topology[params.leaf_triangles_at + leaf];
        store_triangle_index(leaf, word & ~SHARED);
        if write_leaf(local, leaf, word & ~SHARED) && has_zero_area(leaf) { store_empty(local, leaf, DEGENERATE_COUNT); }
    }
    let t = load_treelet(treelet_index);
    workgroupBarrier();
    var area = 0.0;
    if (word & SHARED) != 0u { area = merge_leaf_pair(local, leaf); }
    workgroupBarrier();
    area += refit_treelet(t, packed_inner);
    @if(preprocess_treelets_from_key_frames)
    finish_and_refit_parents(treelet_index, local, area);
    @else
    finish_treelet(treelet_index, local, area);
}

// Writes triangle records and the boxes of all nodes within treelets of triangles. Processes all these treelets, or
// only those that move.
//
// Variants: intersector.
// Parameters: treelets.
// Loaded with every scene.
@compute @workgroup_size(256)
fn preprocess_treelets(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = group.x + group.y * groups.x;
    if index >= params.count { return; }
    preprocess_treelet(local, index);
}

// Does the same as `preprocess_treelets`, but blends two key frames itself, so it need not wait for `interpolate`. Also
// refits the treelets above: see `finish_and_refit_parents`.
//
// Variants: intersector.
// Parameters: treelets.
// Loaded with every scene.
@compute @workgroup_size(256)
fn preprocess_treelets_from_key_frames(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = group.x + group.y * groups.x;
    if index >= params.count { return; }
    preprocess_treelet(local, index);
}
