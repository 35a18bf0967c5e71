//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.packets} {treelets.adopt} camera eye seen tiles lanes_group test_tiles
// First hits triangle by triangle: a workgroup is a team.

@compute @workgroup_size(32)
fn rasterize(@builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    test_share(group.x, groups.x, count_stamps(lane, group.x), lane);
}
