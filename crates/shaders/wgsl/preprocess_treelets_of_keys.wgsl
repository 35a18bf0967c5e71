//! use params ieee rest divide exact soft blend units degenerate flat {record.write} {treelets.refit} above climb corners_of_keys make_treelet
// As `preprocess_treelets`, but from the two key frames about a moment: need not wait for `interpolate`.

@compute @workgroup_size(256)
fn preprocess_treelets_of_keys(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let place = group.x + group.y * groups.x;
    if place >= params.count { return; }
    make_treelet(local, place);
}
