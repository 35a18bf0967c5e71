// What every test of rays does with directions, and what it writes where nothing is hit.

fn push_from_zero(x: f32) -> f32 {
    let least = 0x21800000u; // 2^-60
    let bits = bitcast<u32>(x);
    return bitcast<f32>((bits & 0x80000000u) | max(bits & 0x7fffffffu, least));
}

fn pushed_from_zero(d: vec3<f32>) -> vec3<f32> { return vec3<f32>(push_from_zero(d.x), push_from_zero(d.y), push_from_zero(d.z)); }

fn are_negative(v: vec3<f32>) -> vec3<bool> { return (bitcast<vec3<u32>>(v) >> vec3<u32>(31u)) == vec3<u32>(1u); }

// What is written for a ray that hits nothing.
const MISS: vec4<u32> = vec4<u32>(0x7f800000u, 0u, 0u, 0xffffffffu);
