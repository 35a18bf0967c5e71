//! use params ieee rest divide exact soft blend
// Key frames to positions, four numbers at a time; of all rows or of those in which anything moves.

@group(0) @binding(1) var<storage, read> earlier: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> later: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> positions: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> moving_rows: array<u32>;

@compute @workgroup_size(128)
fn interpolate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    var i = element(id, groups, 128u);
    if i >= params.count { return; }
    if params.listed == 1u { i = moving_rows[i]; }
    let a = earlier[i];
    // At a key frame the bits are copied and the later frame is not read.
    if bitcast<u32>(params.alpha) == 0u {
        positions[i] = a;
        return;
    }
    let b = later[i];
    positions[i] = vec4<u32>(blend(a.x, b.x), blend(a.y, b.y), blend(a.z, b.z), blend(a.w, b.w));
}
