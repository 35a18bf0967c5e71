// The self-test: runs the arithmetic that other kernels rely on, with operands chosen to expose faults.

import package::lib::exact::sign_of_difference;
import package::lib::ieee::{add, divide, mul, sub};
import package::lib::params::{element_index, params};

@group(0) @binding(1) var<storage, read> operands: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> results: array<vec4<u32>>;

// Uses the device's own arithmetic, as the textbook intersectors do.
fn loose_quotient_and_sum(x: vec4<f32>) -> vec2<f32> { return vec2<f32>(x.x / x.y, dot(x.xz, x.yw)); }

// Rounding error of the product, on devices whose fused multiply-add rounds once.
fn product_rounding_error(a: f32, b: f32) -> f32 { return fma(a, b, -mul(a, b)); }

// Runs a loop of 100,000 iterations and counts them in memory. Lavapipe before Mesa 23.1 ends loops after about 65,536
// iterations. Afterwards, only values in memory are reliable.
fn count_iterations() {
    for (var iteration = params.zero; iteration < 100000u; iteration += 1u) { results[1u].z += 1u; }
}

@compute @workgroup_size(128)
fn arithmetic(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element_index(id, groups, 128u);
    if i >= params.count { return; }
    let x = bitcast<vec4<f32>>(operands[i]);
    let sum = add(mul(x.x, x.y), mul(x.z, x.w));
    let difference = sub(add(x.x, x.y), x.x);
    let sign = sign_of_difference(x.x, x.y, x.z, x.w);
    results[2u * i] = vec4<u32>(bitcast<u32>(sum), bitcast<u32>(difference), bitcast<u32>(divide(x.x, x.y)), bitcast<u32>(sign));
    results[2u * i + 1u] = vec4<u32>(
        bitcast<vec2<u32>>(loose_quotient_and_sum(x)), 0u, bitcast<u32>(product_rounding_error(x.x, x.y)),
    );
    if i == 0u { count_iterations(); }
}
