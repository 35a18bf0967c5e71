//! use params ieee divide exact units ray {intersector.settle} settle_any {layout.nodes} any given line_of
// Whether given rays that `any_rays` left open meet anything.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> blocked: array<u32>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> rays: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

@compute @workgroup_size(64)
fn settle_any_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let open = atomicLoad(&counts[7]);
    for (var k = element(id, groups, 64u); k < open; k += groups.x * groups.y * 64u) {
        let i = blocked[params.first + k];
        set_given_line(i);
        settle_any(i, given_ray(i), 0xffffffffu, 2u);
    }
}
