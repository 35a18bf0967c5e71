// A triangle's own box, asked without dividing where that is enough: see "Own boxes" in ARCHITECTURE.md.

// Boxes decide hits where one is kept, at most.
fn inverse_for(ray: Prepared) -> vec3<f32> { return 1.0 / pushed_from_zero(ray.direction); }

struct Box { low: vec3<f32>, high: vec3<f32> }

fn own_box(ray: Prepared, k: Turned) -> Box {
    let low = vec3<f32>(least_of(k.x), least_of(k.y), least_of(k.z));
    let high = vec3<f32>(most_of(k.x), most_of(k.y), most_of(k.z));
    return Box(unpermute(low, ray.axis), unpermute(high, ray.axis));
}

// Whether t surely lies within a padded box, so that slab need not be asked.
fn loose_within(ray: Prepared, own: Box, t: f32) -> bool {
    let negative = are_negative(ray.inverse);
    let pad = 0.25 * ray.slack * abs(ray.inverse);
    let n = (select(own.low, own.high, negative) - ray.origin) * ray.inverse - pad;
    let f = (select(own.high, own.low, negative) - ray.origin) * ray.inverse + pad;
    // 2^100: beyond it products may be infinite.
    return abs(t) < 1.2676506002282294e30 && t >= max(n.x, max(n.y, n.z)) && t <= min(f.x, min(f.y, f.z));
}

fn own_span(ray: Prepared, own: Box) -> vec2<f32> { return slab(ray, inverse_of(ray), own.low, own.high); }

// t within a triangle's own box, so that no tree can change it; infinite if the ray passes by that.
fn within_own(ray: Prepared, k: Turned, t: f32) -> f32 {
    let own = own_box(ray, k);
    if loose_within(ray, own, t) { return flushed(t); }
    let span = own_span(ray, own);
    if !(span.x <= span.y) { return bitcast<f32>(0x7f800000u | params.zero); }
    return clamped(t, span);
}
