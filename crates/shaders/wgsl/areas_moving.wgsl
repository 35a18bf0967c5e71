//! use params area children
// Half areas of the children of inner nodes that move, one partial sum a workgroup, as refit writes them.

const GROUP: u32 = 128u;

@group(0) @binding(1) var<storage, read> topology: array<u32>;
@group(0) @binding(2) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> costs: array<f32>;

@compute @workgroup_size(128)
fn areas_moving(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = element(id, groups, 128u);
    var area = 0.0;
    if i < params.count { area = areas(children(topology[params.first + i])); }
    let sum = sum_of_group(local, area);
    if local == 0u && i < params.count { costs[group.x + group.y * groups.x] = sum; }
}
