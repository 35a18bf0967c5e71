// Which rays are extreme: geom::Range.

// By its start in scaled units. 2^40 and 2^-24; a NaN is extreme.
fn is_extreme(origin: vec3<f32>) -> bool {
    let size = abs(origin);
    let farthest = max(size.x, max(size.y, size.z));
    return params.extreme != 0u || !is_finite_point(origin) || farthest >= 1099511627776.0 || (params.tiny != 0u && farthest < 5.9604644775390625e-8);
}

// Floats in order as whole numbers, and back.
fn ordered(bits: u32) -> i32 {
    let size = bitcast<i32>(bits & 0x7fffffffu);
    return select(size, -size, (bits >> 31u) == 1u);
}

fn from_ordered(x: i32) -> u32 { return select(bitcast<u32>(x), bitcast<u32>(-x) | 0x80000000u, x < 0); }

// The float nearest to t strictly within two limits, or t itself where there is none; all as bits.
fn nearest_within(t: u32, limits: vec2<u32>) -> u32 {
    let least = ordered(limits.x) + 1;
    let most = ordered(limits.y) - 1;
    return from_ordered(select(clamp(ordered(t), least, most), ordered(t), least > most));
}
