// A camera's rays made ready.

fn camera_ray(direction: vec3<f32>, origin: vec3<f32>, root: Root) -> Prepared {
    return prepare(origin, bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, root);
}

// Whether a ray's line surely passes by the root's box, before anything is made ready: see "Rays that pass by" in ARCHITECTURE.md.
fn passes_by(d: vec3<f32>, root: Root) -> bool {
    let c = (root.low + root.high) * 0.5;
    // 2^-16 * D and 2^-60.
    let h = (root.high - root.low) * 0.5 + vec3<f32>(1.52587890625e-5 * root.reach + 8.673617379884035e-19);
    let size = abs(d);
    let apart = abs(d.yzx * c.zxy - d.zxy * c.yzx);
    // 2^-100: what a device flushes is less.
    let near = size.yzx * h.zxy + size.zxy * h.yzx + vec3<f32>(7.888609052210118e-31);
    // Products beyond range tell nothing.
    let tells = apart < vec3<f32>(3.0e38);
    return any(tells & (apart > near)) && root.reach < FARTHEST;
}

// Whether a pixel's ray surely hits nothing.
fn misses_root(direction: vec3<f32>, origin: vec3<f32>, root: Root) -> bool {
    return is_void_way(direction, origin) || passes_by(direction, root);
}

fn is_void_way(direction: vec3<f32>, origin: vec3<f32>) -> bool {
    let is_zero = all((bitcast<vec3<u32>>(direction) & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u));
    return is_zero || !is_finite_point(direction) || !is_finite_point(origin);
}

// t_min and t_max.
fn limits_of(i: u32) -> vec2<u32> { return vec2<u32>(0u, 0x7f800000u); }
