//! use params {treelets.adopt}
// A tree just adopted to its triangles' vertices in leaf order, so that no later stage
// has to ask which triangle a leaf is before it can ask for the vertices. To no treelet has any other come yet.

@group(0) @binding(1) var<storage, read> topology: array<u32>;
@group(0) @binding(2) var<storage, read> triangles: array<u32>;
// Three words a leaf.
@group(0) @binding(3) var<storage, read_write> leaf_corners: array<u32>;
// See climb.wgsl.
@group(0) @binding(4) var<storage, read_write> costs: array<u32>;

const SHARED: u32 = 0x80000000u;

@compute @workgroup_size(256)
fn gather_corners(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 256u);
    if i >= params.count { return; }
    if i < params.first_group { costs[params.first_group + i] = 0u; }
    let triangle = topology[params.leaf_triangles_at + i / 3u] & ~SHARED;
    leaf_corners[i] = triangles[3u * triangle + i % 3u];
}
