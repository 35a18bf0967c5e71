// The ray along that way.

fn ray_to_light(way: ToLight) -> Prepared {
    let origin = snapped3(way.origin);
    let root = root_from(origin, bitcast<vec3<f32>>(nodes[0].xyz), bitcast<vec3<f32>>(nodes[1].xyz));
    // Origin and direction are both in scaled units already.
    return prepare_scaled(origin, way.direction, root);
}
