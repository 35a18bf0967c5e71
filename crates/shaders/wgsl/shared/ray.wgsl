// A ray made ready, and the padded box test: see "What a hit is" in ARCHITECTURE.md.

struct Prepared {
    origin: vec3<f32>,
    t_min: f32,
    t_max: f32,
    // 1 / d per axis, pushed away from zero, and the padding.
    inverse: vec3<f32>,
    pad: vec3<f32>,
    // The axis of the largest |d|, and the shear along it.
    axis: u32,
    shear_x: f32,
    shear_y: f32,
    shear_z: f32,
    // t in the ray's own units is t * 2^-exponent.
    exponent: i32,
}

// x * 2^e for |e| up to 252, exact barring overflow and underflow.
fn scale_by(x: f32, e: i32) -> f32 {
    let half = e / 2;
    return mul(mul(x, power_of_two(half)), power_of_two(e - half));
}

fn power_of_two(e: i32) -> f32 {
    return bitcast<f32>(u32(clamp(e + 127, 1, 254)) << 23u);
}

// To (kx, ky, kz) order, kz being the axis.
fn permute(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v.yzx, v.zxy, axis == 1u), v, axis == 2u);
}

fn main_axis(d: vec3<f32>) -> u32 {
    let m = abs(d);
    if m.x >= m.y && m.x >= m.z { return 0u; }
    return select(2u, 1u, m.y >= m.z);
}

fn push_from_zero(x: f32) -> f32 {
    let least = 0x21800000u; // 2^-60
    let bits = bitcast<u32>(x);
    return bitcast<f32>((bits & 0x80000000u) | max(bits & 0x7fffffffu, least));
}

// The origin and the root's corners are in scaled units, the direction in the scene's; (t_min, t_max) is the ray's own.
fn prepare(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32, low: vec3<f32>, high: vec3<f32>) -> Prepared {
    return prepare_shifted(origin, direction, t_min, t_max, low, high, params.scale_exponent);
}

// Likewise, with the direction in scaled units.
fn prepare_scaled(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32, low: vec3<f32>, high: vec3<f32>) -> Prepared {
    return prepare_shifted(origin, direction, t_min, t_max, low, high, 0);
}

fn prepare_shifted(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32, low: vec3<f32>, high: vec3<f32>, shift: i32) -> Prepared {
    var ray: Prepared;
    let axis = main_axis(direction);
    let largest = permute(direction, axis).z;
    let e = i32((bitcast<u32>(largest) >> 23u) & 255u) - 127;
    let d = vec3<f32>(scale_by(direction.x, -e), scale_by(direction.y, -e), scale_by(direction.z, -e));
    let k = permute(d, axis);
    ray.origin = origin;
    ray.axis = axis;
    ray.shear_x = divide(k.x, k.z);
    ray.shear_y = divide(k.y, k.z);
    ray.shear_z = divide(1.0, k.z);
    ray.exponent = e - shift;
    ray.t_min = scale_t(t_min, ray.exponent);
    ray.t_max = scale_t(t_max, ray.exponent);

    let to_low = vec3<f32>(sub(low.x, origin.x), sub(low.y, origin.y), sub(low.z, origin.z));
    let to_high = vec3<f32>(sub(high.x, origin.x), sub(high.y, origin.y), sub(high.z, origin.z));
    let far = max(abs(to_low), abs(to_high));
    // 17 * 2^-24 * D
    let slack = mul(1.01327896118164062e-6, max(far.x, max(far.y, far.z)));
    ray.inverse = vec3<f32>(divide(1.0, push_from_zero(d.x)), divide(1.0, push_from_zero(d.y)), divide(1.0, push_from_zero(d.z)));
    ray.pad = vec3<f32>(mul(slack, abs(ray.inverse.x)), mul(slack, abs(ray.inverse.y)), mul(slack, abs(ray.inverse.z)));
    return ray;
}

fn scale_t(t: f32, e: i32) -> f32 {
    // Infinity times a power of two is not for every device to know.
    return select(scale_by(t, e), t, (bitcast<u32>(t) & 0x7fffffffu) == 0x7f800000u);
}

// Entry and exit of the padded box; met if x <= y.
fn slab(ray: Prepared, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let negative = (bitcast<vec3<u32>>(ray.inverse) >> vec3<u32>(31u)) == vec3<u32>(1u);
    let near = select(low, high, negative);
    let far = select(high, low, negative);
    let n = vec3<f32>(
        sub(mul(sub(near.x, ray.origin.x), ray.inverse.x), ray.pad.x),
        sub(mul(sub(near.y, ray.origin.y), ray.inverse.y), ray.pad.y),
        sub(mul(sub(near.z, ray.origin.z), ray.inverse.z), ray.pad.z),
    );
    let f = vec3<f32>(
        add(mul(sub(far.x, ray.origin.x), ray.inverse.x), ray.pad.x),
        add(mul(sub(far.y, ray.origin.y), ray.inverse.y), ray.pad.y),
        add(mul(sub(far.z, ray.origin.z), ray.inverse.z), ray.pad.z),
    );
    return vec2<f32>(max(n.x, max(n.y, n.z)), min(f.x, min(f.y, f.z)));
}
