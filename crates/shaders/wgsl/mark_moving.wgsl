//! use params
// Flags inner nodes with a moving leaf below, as the tree's list names them.

@group(0) @binding(1) var<storage, read> topology: array<u32>;
@group(0) @binding(2) var<storage, read_write> inner_nodes: array<u32>;

@compute @workgroup_size(128)
fn mark_moving(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 128u);
    if i >= params.count { return; }
    let inner = topology[params.first + i];
    inner_nodes[inner] |= 0x80000000u;
}
