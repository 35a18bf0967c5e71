// A camera's rays made ready.

fn camera_ray(direction: vec3<f32>, origin: vec3<f32>) -> Prepared {
    let low = bitcast<vec3<f32>>(nodes[0].xyz);
    let high = bitcast<vec3<f32>>(nodes[1].xyz);
    return prepare(origin, bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, low, high);
}
