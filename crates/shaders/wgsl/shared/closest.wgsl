// Closest hit.

const LEAF: u32 = 0x80000000u;
// No node at all; as a leaf it would be beyond all others.
const NONE: u32 = 0xffffffffu;

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

// The child to go to, where any is met; the farther of two is left on the stack.
struct Descent { next: u32, later: u32 }

fn descend_closest(ray: Prepared, at: u32, best: f32) -> Descent {
    let l0 = nodes[2u * at];
    let l1 = nodes[2u * at + 1u];
    let r0 = nodes[2u * at + 2u];
    let r1 = nodes[2u * at + 3u];
    let l = slab(ray, bitcast<vec3<f32>>(l0.xyz), bitcast<vec3<f32>>(l1.xyz));
    let r = slab(ray, bitcast<vec3<f32>>(r0.xyz), bitcast<vec3<f32>>(r1.xyz));
    let meets_l = l.x <= l.y && l.x <= best && l.y >= ray.t_min;
    let meets_r = r.x <= r.y && r.x <= best && r.y >= ray.t_min;
    if meets_l && meets_r {
        let right_first = r.x < l.x;
        return Descent(select(l0.w, r0.w, right_first), select(r0.w, l0.w, right_first));
    }
    return Descent(select(select(NONE, r0.w, meets_r), l0.w, meets_l), NONE);
}

// One loop, each turn of which takes two nodes and a triangle at most. Turns of one kind of work
// each (Aila, Laine 2009: "if-if") were a tenth slower, and descending to a leaf slower still.
fn find_closest(ray: Prepared) -> Found {
    var best = Found(ray.t_max, 0.0, 0.0, 1.0, 0xffffffffu);
    var stack: array<u32, 64>;
    var depth = 0u;
    var at = nodes[0].w;
    let root = slab(ray, bitcast<vec3<f32>>(nodes[0].xyz), bitcast<vec3<f32>>(nodes[1].xyz));
    if !(root.x <= root.y) || root.x > best.t || root.y < ray.t_min { return best; }
    loop {
        for (var i = 0u; i < 2u && (at & LEAF) == 0u; i += 1u) {
            let found = descend_closest(ray, at, best.t);
            at = found.next;
            if found.later != NONE {
                stack[depth] = found.later;
                depth += 1u;
            }
        }
        if (at & LEAF) != 0u {
            if at != NONE { best = meet_closest(ray, at & 0x7fffffffu, best); }
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
