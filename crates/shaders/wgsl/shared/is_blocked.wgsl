// Whether the way from a hit to the light is blocked, asked at once.

fn is_blocked(hit: vec4<u32>, eye: vec3<f32>) -> bool {
    let way = way_to_light(hit, eye);
    if !way.traced { return false; }
    return ask_any(ray_to_light(way), hit.w);
}
