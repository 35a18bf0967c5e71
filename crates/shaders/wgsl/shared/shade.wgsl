// Whether the way from a hit to the light is blocked: see "Shadow" in ARCHITECTURE.md.

// `eye` is where the ray that hit came from, in scaled units.
fn way_to_light(hit: vec4<u32>, eye: vec3<f32>) -> ToLight {
    return to_light(hit, eye, bitcast<vec3<f32>>(nodes[0].xyz), bitcast<vec3<f32>>(nodes[1].xyz));
}

fn ray_to_light(way: ToLight) -> Prepared {
    let low = bitcast<vec3<f32>>(nodes[0].xyz);
    let high = bitcast<vec3<f32>>(nodes[1].xyz);
    // Origin and direction are both in scaled units already.
    return prepare_scaled(snapped3(way.origin), way.direction, low, high);
}
