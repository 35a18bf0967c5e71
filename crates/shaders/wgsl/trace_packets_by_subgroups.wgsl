//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.closest} {intersector.any} {treelets.nodes} slab_ahead camera eye seen any_singly any from_triangle {intersector.way} shade is_occluded {intersector.packets} lanes_subgroup cover packet
// Closest hits of a camera's rays and their shadows, packet by packet: a subgroup of 32 each, four of them two by two.

@compute @workgroup_size(128)
fn trace_packets_by_subgroups(@builtin(subgroup_invocation_id) lane: u32, @builtin(subgroup_id) packet: u32, @builtin(workgroup_id) group: vec3<u32>) {
    trace_tile(2u * group.xy + vec2<u32>(packet & 1u, packet >> 1u), lane);
}
