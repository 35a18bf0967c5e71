//! use params ieee rest divide units box_of_group
// The box round all finite positions, in scaled units: one part a workgroup, of which there are 128.

@group(0) @binding(1) var<storage, read> positions: array<u32>;
@group(0) @binding(2) var<storage, read_write> boxes: array<vec4<f32>>;

@compute @workgroup_size(256)
fn bounds(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    var low = vec3<f32>(bitcast<f32>(0x7f7fffffu));
    var high = -low;
    for (var i = id.x; i < params.count; i += groups.x * 256u) {
        let bits = vec3<u32>(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
        if is_finite_point(bitcast<vec3<f32>>(bits)) {
            let at = scaled_point(bits);
            low = min(low, at);
            high = max(high, at);
        }
    }
    gather_box(local, low, high);
    if local == 0u {
        boxes[2u * group.x] = vec4<f32>(lows[0], 0.0);
        boxes[2u * group.x + 1u] = vec4<f32>(highs[0], 0.0);
    }
}
