//! use params area
// What refit's workgroups found, added up by one workgroup: params.count partial sums.

const GROUP: u32 = 128u;

// Four at a time; those beyond the count are left out.
@group(0) @binding(1) var<storage, read> costs: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> nodes: array<vec4<u32>>;
// Word `first`: the sum; word 5: the half area of the root; as f32.
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(128)
fn sum_costs(@builtin(local_invocation_index) local: u32) {
    var sums = vec4<f32>(0.0);
    for (var i = 4u * local; i < params.count; i += 512u) {
        let valid = vec4<u32>(i, i + 1u, i + 2u, i + 3u) < vec4<u32>(params.count);
        sums += select(vec4<f32>(0.0), costs[i / 4u], valid);
    }
    let sum = sum_of_group(local, (sums.x + sums.y) + (sums.z + sums.w));
    if local == 0u {
        counts[params.first] = bitcast<u32>(sum);
        counts[5] = bitcast<u32>(half_area(nodes[0], nodes[1]));
    }
}
