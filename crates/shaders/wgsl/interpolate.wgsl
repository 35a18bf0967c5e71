//! use params ieee
// Key frames to positions: geom::Pose::blend, four numbers at a time.

@group(0) @binding(1) var<storage, read> earlier: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> later: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> positions: array<vec4<u32>>;

fn blend(a: u32, b: u32) -> u32 {
    let x = bitcast<f32>(a);
    return bitcast<u32>(add(x, mul(sub(bitcast<f32>(b), x), params.alpha)));
}

@compute @workgroup_size(128)
fn interpolate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 128u);
    if i >= params.count { return; }
    let a = earlier[i];
    // At a key frame the bits are copied and the later frame is not read.
    if params.alpha == 0.0 {
        positions[i] = a;
        return;
    }
    let b = later[i];
    positions[i] = vec4<u32>(blend(a.x, b.x), blend(a.y, b.y), blend(a.z, b.z), blend(a.w, b.w));
}
