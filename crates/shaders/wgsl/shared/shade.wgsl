// The ray along that way.

fn ray_to_light(way: ToLight) -> Prepared {
    let low = bitcast<vec3<f32>>(nodes[0].xyz);
    let high = bitcast<vec3<f32>>(nodes[1].xyz);
    // Origin and direction are both in scaled units already.
    return prepare_scaled(snapped3(way.origin), way.direction, low, high);
}
