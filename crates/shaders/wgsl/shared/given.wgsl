// Rays given one by one, two rows each: origin and t_min, direction and t_max.

fn given_ray(i: u32) -> Prepared {
    let a = rays[2u * i];
    let b = rays[2u * i + 1u];
    let origin = scaled_point(a.xyz);
    return prepare(origin, b.xyz, a.w, b.w, root_from(origin));
}

// The host marks rays that can hit nothing by a direction of zero; an origin may be too far for the scene's scale.
fn is_void(i: u32) -> bool {
    let marked = all((rays[2u * i + 1u].xyz & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u));
    let origin = scaled_point(rays[2u * i].xyz);
    if LEAVES_EXTREMES { return marked || is_extreme(origin); }
    return marked || !is_finite_point(origin);
}

// t_min and t_max.
fn limits_of(i: u32) -> vec2<u32> { return vec2<u32>(rays[2u * i].w, rays[2u * i + 1u].w); }
