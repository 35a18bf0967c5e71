// Blends key frames to positions.

import package::lib::exact::{soft_add, soft_multiply};
import package::lib::ieee::{add, mul, sub};
import package::lib::params::{element_index, params};

@group(0) @binding(next) var<storage, read> earlier: array<vec4<u32>>;
@group(0) @binding(next) var<storage, read> later: array<vec4<u32>>;
@group(0) @binding(next) var<storage, read_write> positions: array<vec4<u32>>;
@group(0) @binding(next) var<storage, read> moving_rows: array<u32>;

// Blends one number as geom::Pose::blend does. Numbers are passed as bits.

fn blend(a: u32, b: u32) -> u32 {
    let native = blend_native(a, b);
    if needs_exact_blend(a, b, native) { return blend_exact(a, b); }
    return native;
}

fn blend_native(a: u32, b: u32) -> u32 {
    let x = bitcast<f32>(a);
    return bitcast<u32>(add(x, mul(sub(bitcast<f32>(b), x), params.alpha)));
}

// Returns whether `native` may be wrong because a device flushes subnormal numbers. If the result is at least 2^-100,
// flushed coordinates are below its rounding error, so only a subnormal weight matters.
fn needs_exact_blend(a: u32, b: u32, native: u32) -> bool {
    let small = (native & 0x7fffffffu) < 0x0d800000u || params.alpha < 1.1754943508222875e-38;
    return small && ((a | b) & 0x7fffffffu) != 0u;
}

fn blend_exact(a: u32, b: u32) -> u32 {
    if !is_finite_bits(a) || !is_finite_bits(b) {
        let x = bitcast<f32>(a);
        return bitcast<u32>(add(x, sub(bitcast<f32>(b), x)));
    }
    let difference = soft_add(b, a ^ 0x80000000u);
    // The difference overflowed, so the weight changes nothing.
    if !is_finite_bits(difference) { return difference; }
    return soft_add(a, soft_multiply(difference, bitcast<u32>(params.alpha)));
}

fn is_finite_bits(x: u32) -> bool { return (x & 0x7f800000u) != 0x7f800000u; }

// Blends four numbers at a time, in all rows or in those that contain moving vertices.
// Parameters: interpolation.
// Loaded with every scene.
@compute @workgroup_size(128)
fn interpolate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    var i = element_index(id, groups, 128u);
    if i >= params.count { return; }
    if params.interpolation.uses_list == 1u { i = moving_rows[i]; }
    let a = earlier[i];
    // At a key frame the bits are copied and the later frame is not read.
    if bitcast<u32>(params.alpha) == 0u {
        positions[i] = a;
        return;
    }
    let b = later[i];
    positions[i] = vec4<u32>(blend(a.x, b.x), blend(a.y, b.y), blend(a.z, b.z), blend(a.w, b.w));
}
