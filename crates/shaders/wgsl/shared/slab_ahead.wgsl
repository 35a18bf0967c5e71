// Where rays that look ahead (t_min is not negative) meet a node's box before `bound`; met if x <= y. As whole numbers: floats
// that are not negative compare as their bits do, and what is negative lies behind the ray in either order. Devices tell the
// greatest of three whole numbers in one go (an H200: rays 4 % faster).

fn slab_interval(ray: Prepared, low: vec4<u32>, high: vec4<u32>, bound: f32) -> vec2<i32> {
    let planes = loose_planes(ray, bitcast<vec3<f32>>(low.xyz), bitcast<vec3<f32>>(high.xyz));
    let n = bitcast<vec3<i32>>(planes.near);
    let f = bitcast<vec3<i32>>(planes.far);
    return vec2<i32>(
        max(max(max(n.x, n.y), n.z), bitcast<i32>(ray.t_min)),
        min(min(min(f.x, f.y), f.z), bitcast<i32>(bound)),
    );
}
