//! use params {treelets.refit}
// Boxes of one level of treelets from the roots of the level below; of all treelets or of those that move.

@group(0) @binding(1) var<storage, read> topology: array<u32>;
@group(0) @binding(2) var<storage, read_write> nodes: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> costs: array<f32>;

@compute @workgroup_size(256)
fn refit_treelets(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let place = group.x + group.y * groups.x;
    if place >= params.count { return; }
    let number = treelet_at(place);
    let t = treelet(number);
    if local < t.leaf_count {
        let low = nodes[t.first_leaf + 2u * local];
        let high = nodes[t.first_leaf + 2u * local + 1u];
        keep_box(LEAVES + local, low.xyz, high.xyz);
        keep_leaf(local, low.w);
    }
    workgroupBarrier();
    let area = refit_treelet(t, local);
    write_treelet(t, local);
    let sum = sum_of_group(local, area);
    if local == 0u { costs[number] = sum; }
}
