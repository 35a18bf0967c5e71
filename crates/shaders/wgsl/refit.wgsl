//! use params area children
// Boxes of one level's inner nodes from those of their children, and the areas of those children.
//
// What a tree costs (surface area heuristic) is the sum of all nodes' areas
// over the root's. Whoever computes a node's box has its children's at hand, so
// each workgroup adds up the half areas of the children it read, and writes one
// partial sum: no atomics, and the same bits each time. Every level is a
// dispatch, and its workgroups write to
//
//     costs[params.first_group + number of the workgroup in its dispatch]
//
// where first_group counts the workgroups of the levels dispatched before. So
// costs holds one f32 for each workgroup of all levels, without gaps, and after
// the last level `sum_costs` adds them up.
//
// Of a tree with lists of what moves, a refit of all nodes leaves out the areas
// under those that are marked as moving: `areas_moving` adds those up. So what
// lies still is summed once a tree, and what moves every frame.

const GROUP: u32 = 128u;

@group(0) @binding(1) var<storage, read> inner_nodes: array<u32>;
@group(0) @binding(2) var<storage, read_write> nodes: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> costs: array<f32>;
@group(0) @binding(4) var<storage, read> topology: array<u32>;

fn box_min(a: vec4<u32>, b: vec4<u32>) -> vec3<u32> {
    return bitcast<vec3<u32>>(min(bitcast<vec3<f32>>(a.xyz), bitcast<vec3<f32>>(b.xyz)));
}

fn box_max(a: vec4<u32>, b: vec4<u32>) -> vec3<u32> {
    return bitcast<vec3<u32>>(max(bitcast<vec3<f32>>(a.xyz), bitcast<vec3<f32>>(b.xyz)));
}

// Writes the box of one inner node and returns the half areas of both children.
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
    // Of a dispatch in rows, the last workgroups may have no node.
    if local == 0u && i < params.count { costs[params.first_group + group.x + group.y * groups.x] = sum; }
}
