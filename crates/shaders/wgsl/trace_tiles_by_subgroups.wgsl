//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.closest} {intersector.any} {treelets.nodes} stretch_ahead camera eye seen any_singly any from_triangle {intersector.way} shade is_blocked {intersector.tiles} lanes_subgroup cover tile
// Closest hits of a camera's rays and their shadows, tile by tile: a subgroup of 32 each, four of them two by two.

@compute @workgroup_size(128)
fn trace_tiles_by_subgroups(@builtin(subgroup_invocation_id) lane: u32, @builtin(subgroup_id) tile: u32, @builtin(workgroup_id) group: vec3<u32>) {
    trace_tile(2u * group.xy + vec2<u32>(tile & 1u, tile >> 1u), lane);
}
