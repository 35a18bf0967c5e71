// Areas of boxes, and their sums over a workgroup.

// Invocations of a workgroup.
@if(refit || areas_moving || sum_costs)
const GROUP: u32 = 128u;
@else
const GROUP: u32 = 256u;

var<workgroup> partial_sums: array<f32, GROUP>;

// Half the surface of a box; 0 if it is empty.
fn half_area(low: vec4<u32>, high: vec4<u32>) -> f32 {
    let d = bitcast<vec3<f32>>(high.xyz) - bitcast<vec3<f32>>(low.xyz);
    return select(0.0, d.x * d.y + d.y * d.z + d.z * d.x, d.x >= 0.0);
}

// The sum of `x` over the workgroup, for invocation 0 alone, always taken in the same order.
// Every invocation must call it, in uniform control flow. Two barriers: all to 16 to 1.
fn sum_of_group(local: u32, x: f32) -> f32 {
    partial_sums[local] = x;
    workgroupBarrier();
    var sum = 0.0;
    if local < 16u {
        for (var k = 0u; k < GROUP / 16u; k += 1u) { sum += partial_sums[local + 16u * k]; }
        partial_sums[local] = sum;
    }
    workgroupBarrier();
    if local == 0u {
        for (var k = 1u; k < 16u; k += 1u) { sum += partial_sums[k]; }
    }
    return sum;
}
