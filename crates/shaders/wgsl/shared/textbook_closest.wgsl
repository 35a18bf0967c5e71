// What a search for the closest hit keeps of the leaves it sees: a textbook test's best.

struct Found { t: f32, u: f32, v: f32, triangle: u32 }

fn nothing_found(ray: Prepared) -> Found { return Found(ray.t_max, 0.0, 0.0, 0xffffffffu); }

// Nodes entered beyond this need no visit.
fn limit(found: Found) -> f32 { return found.t; }

// Tests the leaf's triangle and keeps it if it is the least by t, then by index.
fn intersect_leaf_closest(ray: Prepared, leaf: u32, best: Found) -> Found {
    let m = meet_leaf(ray, leaf);
    let inside = m.hit && m.t > ray.t_min && m.t < ray.t_max;
    let before = m.t < best.t || (m.t == best.t && m.triangle < best.triangle);
    if inside && before { return Found(m.t, m.u, m.v, m.triangle); }
    return best;
}

// What is written for a ray, t in the ray's own units.
fn hit_of(i: u32, ray: Prepared, best: Found) -> vec4<u32> {
    if best.triangle == 0xffffffffu { return MISS; }
    atomicAdd(&counts[2], 1u);
    let t = in_ray_units(best.t, ray.exponent);
    return vec4<u32>(t, bitcast<u32>(best.u), bitcast<u32>(best.v), best.triangle);
}

// Every hit stands.
fn is_unresolved(hit: vec4<u32>) -> bool { return false; }
