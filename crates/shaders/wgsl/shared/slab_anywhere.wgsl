// Where rays that may look behind them meet a node's box before `bound`; met if x <= y.

fn slab_interval(ray: Prepared, low: vec4<u32>, high: vec4<u32>, bound: f32) -> vec2<f32> {
    let s = loose_slab(ray, bitcast<vec3<f32>>(low.xyz), bitcast<vec3<f32>>(high.xyz));
    return vec2<f32>(max(s.x, ray.t_min), min(s.y, bound));
}
