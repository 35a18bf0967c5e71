//! use params
// A record of a tree to the two lists that refit walks.

@group(0) @binding(1) var<storage, read> topology: array<u32>;
@group(0) @binding(2) var<storage, read_write> leaf_nodes: array<u32>;
@group(0) @binding(3) var<storage, read_write> inner_nodes: array<u32>;

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
