//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.packets} {treelets.adopt} camera eye seen tiles lanes_subgroup test_tiles
// First hits triangle by triangle: a subgroup is a team.

@compute @workgroup_size(128)
fn rasterize_by_subgroups(@builtin(local_invocation_index) local: u32, @builtin(subgroup_invocation_id) lane: u32, @builtin(subgroup_id) team: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    test_share(4u * group.x + team, 4u * groups.x, count_stamps(local, group.x), lane);
}
