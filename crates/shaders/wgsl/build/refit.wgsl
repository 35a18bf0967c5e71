// Computes the boxes of inner nodes level by level, and the tree's cost.

import package::lib::buffers::{costs, counts, nodes, topology};
import package::lib::params::{element, params};

// Areas of boxes, and their sums over a workgroup.

// Number of invocations of a workgroup.
@if(refit || sum_costs)
const GROUP: u32 = 128u;
@else
const GROUP: u32 = 256u;

var<workgroup> partial_sums: array<f32, GROUP>;

// Returns half the surface area of a box; 0 if it is empty.
fn half_area(low: vec4<u32>, high: vec4<u32>) -> f32 {
    let d = bitcast<vec3<f32>>(high.xyz) - bitcast<vec3<f32>>(low.xyz);
    return select(0.0, d.x * d.y + d.y * d.z + d.z * d.x, d.x >= 0.0);
}

// Sums `x` over the workgroup in a fixed order. Only invocation 0 receives the result. Must be called by all invocations, in
// uniform control flow. Takes two barriers: all values are reduced to 16, then to 1.
fn sum_of_group(local: u32, x: f32) -> f32 {
    partial_sums[local] = x;
    workgroupBarrier();
    var sum = 0.0;
    if local < 16u {
        for (var k = 0u; k < GROUP / 16u; k += 1u) { sum += partial_sums[local + 16u * k]; }
        partial_sums[local] = sum;
    }
    workgroupBarrier();
    if local == 0u {
        for (var k = 1u; k < 16u; k += 1u) { sum += partial_sums[k]; }
    }
    return sum;
}

// Indices of inner nodes, by level. A flag marks those with a moving leaf below.
@if(refit)
@group(0) @binding(next) var<storage, read> inner_nodes: array<u32>;
@else
@group(0) @binding(next) var<storage, read_write> inner_nodes: array<u32>;

@group(0) @binding(next) var<storage, read_write> leaf_nodes: array<u32>;

// Computes the boxes of one level's inner nodes from their children's, and sums the children's areas.
//
// The cost of a tree (surface area heuristic) is the sum of all nodes' areas over the root's. Each workgroup has read the boxes
// of its nodes' children, so it sums their half areas and writes one partial sum: no atomics, and the same bits each time. Every
// level is a dispatch, and its workgroups write to
//
//     costs[params.first_group + number of the workgroup in its dispatch]
//
// where first_group counts the workgroups of the levels dispatched before. So costs holds one f32 for each workgroup of all
// levels, without gaps. After the last level, `sum_costs` adds them up.
//
// If the tree lists its moving parts, a full refit leaves out the areas below nodes that are marked as moving, and the refit of
// moving nodes adds them. So static areas are summed once per tree, and moving ones every frame.

fn box_min(a: vec4<u32>, b: vec4<u32>) -> vec3<u32> {
    return bitcast<vec3<u32>>(min(bitcast<vec3<f32>>(a.xyz), bitcast<vec3<f32>>(b.xyz)));
}

fn box_max(a: vec4<u32>, b: vec4<u32>) -> vec3<u32> {
    return bitcast<vec3<u32>>(max(bitcast<vec3<f32>>(a.xyz), bitcast<vec3<f32>>(b.xyz)));
}

// Writes the box of one inner node. Returns the half areas of both children.
fn refit_node(inner: u32) -> f32 {
    let marked = inner_nodes[inner];
    let node = marked & ~MOVES;
    let pair = children(inner);
    nodes[2u * node] = vec4<u32>(box_min(pair.left_low, pair.right_low), 2u * inner + 1u);
    nodes[2u * node + 1u] = vec4<u32>(box_max(pair.left_high, pair.right_high), 0u);
    return select(areas(pair), 0.0, params.listed == 0u && marked != node);
}

@compute @workgroup_size(128)
fn refit(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = element(id, groups, 128u);
    var area = 0.0;
    if i < params.count {
        var inner = params.first + i;
        if params.listed == 1u { inner = topology[inner]; }
        area = refit_node(inner);
    }
    let sum = sum_of_group(local, area);
    // In a two-dimensional dispatch, the last workgroups may have no node.
    if local == 0u && i < params.count { costs[params.first_group + group.x + group.y * groups.x] = sum; }
}

// Boxes of an inner node's children.

// Flag in `inner_nodes`: a moving leaf is below.
const MOVES: u32 = 0x80000000u;

struct Children {
    left_low: vec4<u32>,
    left_high: vec4<u32>,
    right_low: vec4<u32>,
    right_high: vec4<u32>,
}

fn children(inner: u32) -> Children {
    let at = 2u * (2u * inner + 1u);
    return Children(nodes[at], nodes[at + 1u], nodes[at + 2u], nodes[at + 3u]);
}

fn areas(pair: Children) -> f32 {
    return half_area(pair.left_low, pair.left_high) + half_area(pair.right_low, pair.right_high);
}

// Expands a tree's topology to the lists of leaves and inner nodes that refit uses.
@compute @workgroup_size(128)
fn expand(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let node = element(id, groups, 128u);
    if node >= params.node_count { return; }
    let word = node >> 5u;
    let bit = 1u << (node & 31u);
    let bits = topology[params.leaf_bits_at + word];
    let rank = topology[params.leaf_ranks_at + word] + countOneBits(bits & (bit - 1u));
    if (bits & bit) != 0u {
        leaf_nodes[rank] = node;
    } else {
        inner_nodes[node - rank] = node;
    }
}

// Flags inner nodes with a moving leaf below, from the tree's list.
@compute @workgroup_size(128)
fn mark_moving(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 128u);
    if i >= params.count { return; }
    let inner = topology[params.first + i];
    inner_nodes[inner] |= 0x80000000u;
}

// Adds up `params.count` partial sums of refit's workgroups, in one workgroup.
@compute @workgroup_size(128)
fn sum_costs(@builtin(local_invocation_index) local: u32) {
    var sums = vec4<f32>(0.0);
    for (var i = 4u * local; i < params.count; i += 512u) {
        let valid = vec4<u32>(i, i + 1u, i + 2u, i + 3u) < vec4<u32>(params.count);
        sums += select(vec4<f32>(0.0), costs[i / 4u], valid);
    }
    let sum = sum_of_group(local, (sums.x + sums.y) + (sums.z + sums.w));
    if local == 0u {
        counts[params.first] = bitcast<u32>(sum);
        counts[5] = bitcast<u32>(half_area(nodes[0], nodes[1]));
    }
}
