// The ray along that way.

fn ray_to_light(way: ToLight) -> Prepared {
    let origin = snapped3(way.origin);
    // Origin and direction are both in scaled units already.
    return prepare_scaled(origin, way.direction, root_from(origin));
}
