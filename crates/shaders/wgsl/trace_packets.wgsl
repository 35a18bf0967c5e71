//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.closest} {intersector.any} {treelets.nodes} slab_ahead camera eye seen any_singly any from_triangle {intersector.way} shade is_occluded {intersector.packets} lanes_group cover packet
// Closest hits of a camera's rays and their shadows, packet by packet: a workgroup each.

@compute @workgroup_size(32)
fn trace_packets(@builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>) {
    trace_tile(group.xy, lane);
}
