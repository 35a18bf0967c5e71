//! use params ieee divide exact soft blend units degenerate flat {record.write} {treelets.refit} corners_of_keys make_treelet
// As `preprocess_treelets`, but from the two key frames about a moment: need not wait for `interpolate`.

@group(0) @binding(1) var<storage, read> topology: array<u32>;
// Three vertices a triangle, in leaf order: see gather_corners.wgsl.
@group(0) @binding(2) var<storage, read> leaf_corners: array<u32>;
@group(0) @binding(3) var<storage, read> earlier: array<u32>;
@group(0) @binding(4) var<storage, read> later: array<u32>;
@group(0) @binding(5) var<storage, read_write> records: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read_write> nodes: array<vec4<u32>>;
@group(0) @binding(7) var<storage, read_write> costs: array<f32>;
// Inactive and degenerate leaves.
@group(0) @binding(8) var<storage, read_write> counts: array<atomic<u32>>;

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
