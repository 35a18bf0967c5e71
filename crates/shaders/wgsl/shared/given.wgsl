// Rays given one by one, two rows each: origin and t_min, direction and t_max.

fn given_ray(i: u32) -> Prepared {
    let a = rays[2u * i];
    let b = rays[2u * i + 1u];
    let o = bitcast<vec3<f32>>(a.xyz);
    let origin = vec3<f32>(mul(o.x, params.scale), mul(o.y, params.scale), mul(o.z, params.scale));
    let low = bitcast<vec3<f32>>(nodes[0].xyz);
    let high = bitcast<vec3<f32>>(nodes[1].xyz);
    return prepare(origin, bitcast<vec3<f32>>(b.xyz), bitcast<f32>(a.w), bitcast<f32>(b.w), low, high);
}

// The host marks rays that can hit nothing by a direction of zero.
fn is_void(i: u32) -> bool {
    return all((rays[2u * i + 1u].xyz & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u));
}
