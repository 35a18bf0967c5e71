// The cost of a tree (surface area heuristic): the sum of all nodes' half areas over the root's.
//
// Each workgroup that computes boxes sums the half areas of the nodes that it read, and writes partial sums to `costs`:
// one per treelet, or per tile of `cluster`. Unlike atomic additions, this gives the same bits each time.

import package::lib::buffers::{costs, counts, nodes};
import package::lib::counters::ROOT_AREA;
import package::lib::params::params;

// Number of invocations of a workgroup.
@if(sum_costs)
const GROUP: u32 = 128u;
@else
const GROUP: u32 = 256u;

var<workgroup> partial_sums: array<f32, GROUP>;

// Returns half the surface area of a box; 0 if it is empty.
fn half_area(low: vec3<f32>, high: vec3<f32>) -> f32 {
    let d = max(high - low, vec3<f32>(0.0));
    return d.x * d.y + d.y * d.z + d.z * d.x;
}

// Returns one of sixteen partial sums of all values in `partial_sums` to each of the first sixteen invocations.
fn sixteenth_sum(local: u32) -> f32 {
    var sum = 0.0;
    if local < 16u {
        for (var k = 0u; k < GROUP / 16u; k += 1u) { sum += partial_sums[local + 16u * k]; }
    }
    return sum;
}

// Sums `x` over the workgroup in a fixed order. Only invocation 0 receives the result. Must be called by all invocations, in
// uniform control flow. Takes two barriers: all values are reduced to 16, then to 1.
fn sum_of_group(local: u32, x: f32) -> f32 {
    partial_sums[local] = x;
    workgroupBarrier();
    var sum = sixteenth_sum(local);
    if local < 16u { partial_sums[local] = sum; }
    workgroupBarrier();
    if local == 0u {
        for (var k = 1u; k < 16u; k += 1u) { sum += partial_sums[k]; }
    }
    return sum;
}

// Adds up `params.count` partial sums, in one workgroup.
// Parameters: sum.
// Loaded with every scene.
@compute @workgroup_size(128)
fn sum_costs(@builtin(local_invocation_index) local: u32) {
    var sums = vec4<f32>(0.0);
    for (var i = 4u * local; i < params.count; i += 512u) {
        let valid = vec4<u32>(i, i + 1u, i + 2u, i + 3u) < vec4<u32>(params.count);
        sums += select(vec4<f32>(0.0), costs[i / 4u], valid);
    }
    let sum = sum_of_group(local, (sums.x + sums.y) + (sums.z + sums.w));
    if local == 0u {
        counts[params.sum.counter] = bitcast<u32>(sum);
        let root_area = half_area(bitcast<vec3<f32>>(nodes[0].xyz), bitcast<vec3<f32>>(nodes[1].xyz));
        counts[ROOT_AREA] = bitcast<u32>(root_area);
    }
}
