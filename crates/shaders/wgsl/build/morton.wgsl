// Computes sort keys of triangles: their positions on a space-filling curve.

import package::geometry::triangle::{point_of, points_of};
import package::geometry::units::{is_finite, is_finite_point, scaled_point};
import package::lib::params::{element_index, params};

// Bounding boxes of parts of the scene, two rows each.
@if(bounds)
@group(0) @binding(next) var<storage, read_write> boxes: array<vec4<f32>>;
@else
@group(0) @binding(next) var<storage, read> boxes: array<vec4<f32>>;

// The triangles that the tree holds.
@group(0) @binding(next) var<storage, read> live: array<u32>;
@group(0) @binding(next) var<storage, read_write> keys: array<u32>;
@group(0) @binding(next) var<storage, read_write> sorted: array<u32>;

// Bounding box of the values of a workgroup of 256.

var<workgroup> lows: array<vec3<f32>, 256>;
var<workgroup> highs: array<vec3<f32>, 256>;

// Computes the box in lows[0] and highs[0], readable by every invocation. Must be called by all invocations, in uniform control
// flow.
fn reduce_box(local: u32, low: vec3<f32>, high: vec3<f32>) {
    lows[local] = low;
    highs[local] = high;
    workgroupBarrier();
    for (var stride = 128u; stride > 0u; stride >>= 1u) {
        if local < stride {
            lows[local] = min(lows[local], lows[local + stride]);
            highs[local] = max(highs[local], highs[local + stride]);
        }
        workgroupBarrier();
    }
}

// Computes the box of all finite positions, in scaled units: one part for each of 128 workgroups.
@compute @workgroup_size(256)
fn bounds(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    var low = vec3<f32>(bitcast<f32>(0x7f7fffffu));
    var high = -low;
    for (var i = id.x; i < params.count; i += groups.x * 256u) {
        let bits = point_of(i);
        if is_finite(bits) {
            let point = scaled_point(bits);
            low = min(low, point);
            high = max(high, point);
        }
    }
    reduce_box(local, low, high);
    if local == 0u {
        boxes[2u * group.x] = vec4<f32>(lows[0], 0.0);
        boxes[2u * group.x + 1u] = vec4<f32>(highs[0], 0.0);
    }
}

// Computes the sort key of each live triangle: its place on a space-filling curve.
//
// The curve always halves the longest side of the cell, so that flat scenes waste no bits (Vinkler, Bittner, Havran: Extended
// Morton Codes for High Performance Bounding Volume Hierarchy Construction, 2017). Each bit is one halving.

// `point` is within the cell from 0 to `cell`.
fn key_of(point: vec3<f32>, cell: vec3<f32>) -> u32 {
    var remaining = point;
    var size = cell;
    var key = 0u;
    for (var i = 0u; i < 32u; i += 1u) {
        let x = size.x >= size.y && size.x >= size.z;
        let y = !x && size.y >= size.z;
        let axis = vec3<bool>(x, y, !x && !y);
        size = select(size, 0.5 * size, axis);
        let upper = axis & (remaining >= size);
        remaining = select(remaining, remaining - size, upper);
        key = (key << 1u) | select(0u, 1u, any(upper));
    }
    return key;
}

// Triangles with a vertex that is not finite come last.
fn key_of_triangle(triangle: u32) -> u32 {
    let corners = points_of(triangle);
    let a = scaled_point(corners[0]);
    let b = scaled_point(corners[1]);
    let c = scaled_point(corners[2]);
    if !(is_finite_point(a) && is_finite_point(b) && is_finite_point(c)) { return 0xffffffffu; }
    let center = 0.5 * min(min(a, b), c) + 0.5 * max(max(a, b), c);
    return key_of(center - lows[0], highs[0] - lows[0]);
}

@compute @workgroup_size(256)
fn morton(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // Reads each part twice: there are 128 parts and 256 invocations.
    let part = local & 127u;
    reduce_box(local, boxes[2u * part].xyz, boxes[2u * part + 1u].xyz);
    let i = element_index(id, groups, 256u);
    if i >= params.count { return; }
    let triangle = live[i];
    keys[i] = key_of_triangle(triangle);
    sorted[i] = triangle;
}
