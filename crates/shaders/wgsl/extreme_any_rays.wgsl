//! use params ieee rest divide exact soft units range direction whole point points line rounded coarse {layout.nodes} extreme
// Whether those given rays that are extreme meet anything.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> occluded: array<u32>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> rays: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

@compute @workgroup_size(64)
fn extreme_any_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 64u);
    if i >= params.count || !is_extreme(scaled_point(rays[2u * i].xyz)) { return; }
    let a = rays[2u * i];
    let b = rays[2u * i + 1u];
    occluded[i] = 0u;
    if all((b.xyz & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u)) { return; }
    set_line(a.xyz, b.xyz, a.w, b.w, 0);
    if any_extreme(NO_TRIANGLE) {
        occluded[i] = 1u;
        atomicAdd(&counts[2], 1u);
    }
}
