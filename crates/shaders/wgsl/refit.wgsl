//! use params
// Boxes of one level's inner nodes from those of their children.

@group(0) @binding(1) var<storage, read> inner_nodes: array<u32>;
@group(0) @binding(2) var<storage, read_write> nodes: array<vec4<u32>>;

fn box_min(a: vec4<u32>, b: vec4<u32>) -> vec3<u32> {
    return bitcast<vec3<u32>>(min(bitcast<vec3<f32>>(a.xyz), bitcast<vec3<f32>>(b.xyz)));
}

fn box_max(a: vec4<u32>, b: vec4<u32>) -> vec3<u32> {
    return bitcast<vec3<u32>>(max(bitcast<vec3<f32>>(a.xyz), bitcast<vec3<f32>>(b.xyz)));
}

@compute @workgroup_size(128)
fn refit(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 128u);
    if i >= params.count { return; }
    let inner = params.first + i;
    let node = inner_nodes[inner];
    let child = 2u * inner + 1u;
    let at = 2u * child;
    nodes[2u * node] = vec4<u32>(box_min(nodes[at], nodes[at + 2u]), child);
    nodes[2u * node + 1u] = vec4<u32>(box_max(nodes[at + 1u], nodes[at + 3u]), 0u);
}
