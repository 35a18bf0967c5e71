// A camera's rays made ready.

fn camera_ray(direction: vec3<f32>, origin: vec3<f32>) -> Prepared {
    let low = bitcast<vec3<f32>>(nodes[0].xyz);
    let high = bitcast<vec3<f32>>(nodes[1].xyz);
    return prepare(origin, bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, low, high);
}

// Whether a pixel's ray leads nowhere.
fn is_void_way(direction: vec3<f32>, origin: vec3<f32>) -> bool {
    let is_zero = all((bitcast<vec3<u32>>(direction) & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u));
    return is_zero || !is_finite_point(direction) || (!TAKES_FAR && !is_finite_point(origin));
}
