// The whole-number line from a hit to the light.

// The way is in scaled units, and the corners are not.
fn set_line_along(way: ToLight) {
    set_line(bitcast<vec3<u32>>(way.origin), bitcast<vec3<u32>>(way.direction), 0u, 0x3f800000u, params.scale_exponent);
}
