// Closest hit: one loop that takes either one node or one triangle a turn.

const LEAF: u32 = 0x80000000u;

// The weights are v / det and w / det.
struct Found { t: f32, v: f32, w: f32, det: f32, triangle: u32 }

fn corner_of(leaf: u32, which: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(records[3u * leaf + which].xyz);
}

// Tests the leaf's triangle and keeps it if it is the least by t, then by index.
fn meet_closest(ray: Prepared, leaf: u32, best: Found) -> Found {
    let first = records[3u * leaf];
    let v0 = bitcast<vec3<f32>>(first.xyz);
    let v1 = corner_of(leaf, 1u);
    let v2 = corner_of(leaf, 2u);
    let c = intersect(ray, v0, v1, v2);
    if !c.hit { return best; }
    // The answer is clamped to the triangle's own box, so that no tree can change it.
    let own = slab(ray, min(min(v0, v1), v2), max(max(v0, v1), v2));
    let least = clamped(rough_span(c.t, c.det).x, own);
    if !(own.x <= own.y) || least > best.t { return best; }
    let t = clamped(divide(c.t, c.det), own);
    let inside = t > ray.t_min && t < ray.t_max;
    let before = t < best.t || (t == best.t && first.w < best.triangle);
    if inside && before { return Found(t, c.v, c.w, c.det, first.w); }
    return best;
}

fn find_closest(ray: Prepared) -> Found {
    var best = Found(ray.t_max, 0.0, 0.0, 1.0, 0xffffffffu);
    var stack: array<u32, 64>;
    var depth = 0u;
    var at = nodes[0].w;
    let root = slab(ray, bitcast<vec3<f32>>(nodes[0].xyz), bitcast<vec3<f32>>(nodes[1].xyz));
    if !(root.x <= root.y) || root.x > best.t || root.y < ray.t_min { return best; }
    loop {
        var pop = true;
        if (at & LEAF) != 0u {
            best = meet_closest(ray, at & 0x7fffffffu, best);
        } else {
            let l0 = nodes[2u * at];
            let l1 = nodes[2u * at + 1u];
            let r0 = nodes[2u * at + 2u];
            let r1 = nodes[2u * at + 3u];
            let l = slab(ray, bitcast<vec3<f32>>(l0.xyz), bitcast<vec3<f32>>(l1.xyz));
            let r = slab(ray, bitcast<vec3<f32>>(r0.xyz), bitcast<vec3<f32>>(r1.xyz));
            let meets_l = l.x <= l.y && l.x <= best.t && l.y >= ray.t_min;
            let meets_r = r.x <= r.y && r.x <= best.t && r.y >= ray.t_min;
            if meets_l && meets_r {
                let right_first = r.x < l.x;
                stack[depth] = select(r0.w, l0.w, right_first);
                depth += 1u;
                at = select(l0.w, r0.w, right_first);
                pop = false;
            } else if meets_l || meets_r {
                at = select(r0.w, l0.w, meets_l);
                pop = false;
            }
        }
        if pop {
            if depth == 0u { break; }
            depth -= 1u;
            at = stack[depth];
        }
    }
    return best;
}

// What is written for a ray: t in the ray's own units, then u, v and the triangle.
fn as_hit(ray: Prepared, best: Found) -> vec4<u32> {
    if best.triangle == 0xffffffffu {
        return vec4<u32>(0x7f800000u, 0u, 0u, 0xffffffffu);
    }
    let t = scale_bits(bitcast<u32>(best.t), -ray.exponent);
    let by = divisor(best.det);
    let u = divide_by(best.v, by);
    let v = divide_by(best.w, by);
    return vec4<u32>(bitcast<u32>(t), bitcast<u32>(u), bitcast<u32>(v), best.triangle);
}
