// Whether the way from a hit to the light is blocked: see "Shadow" in ARCHITECTURE.md.

// `eye` is where the ray came from, in scaled units.
fn is_blocked(hit: vec4<u32>, eye: vec3<f32>) -> bool {
    let low = bitcast<vec3<f32>>(nodes[0].xyz);
    let high = bitcast<vec3<f32>>(nodes[1].xyz);
    let ray = to_light(hit, eye, low, high);
    if !ray.traced { return false; }
    // Origin and direction are both in scaled units already.
    return find_any(prepare_scaled(ray.origin, ray.direction, low, high), hit.w);
}
