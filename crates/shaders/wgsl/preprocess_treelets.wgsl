//! use params ieee rest divide units degenerate flat {record.write} {treelets.refit} stay point corners make_treelet
// Positions to triangle records, boxes of leaves, and boxes of all nodes within treelets of triangles;
// of all those treelets or of those that move.

@compute @workgroup_size(256)
fn preprocess_treelets(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let place = group.x + group.y * groups.x;
    if place >= params.count { return; }
    make_treelet(local, place);
}
