// Woop, Benthin, Wald 2013, with exact signs and symbolic ties: see ARCHITECTURE.md.

// A hit at t / det with weights v / det and w / det, divided only where it matters.
struct Candidate { hit: bool, t: f32, v: f32, w: f32, det: f32 }

struct Corners { a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, triangle: u32 }

// x, y, the depth, and the distance along the axis that it comes from.
struct Sheared { x: f32, y: f32, z: f32, along: f32 }

fn corners_of(leaf: u32) -> Corners {
    let first = records[3u * leaf];
    let b = bitcast<vec3<f32>>(records[3u * leaf + 1u].xyz);
    let c = bitcast<vec3<f32>>(records[3u * leaf + 2u].xyz);
    return Corners(bitcast<vec3<f32>>(first.xyz), b, c, first.w);
}

// Entry and exit of the triangle's own box.
fn own_span(ray: Prepared, k: Corners) -> vec2<f32> {
    return slab(ray, min(min(k.a, k.b), k.c), max(max(k.a, k.b), k.c));
}

fn shear(ray: Prepared, vertex: vec3<f32>) -> Sheared {
    let a = permute(vec3<f32>(sub(vertex.x, ray.origin.x), sub(vertex.y, ray.origin.y), sub(vertex.z, ray.origin.z)), ray.axis);
    return Sheared(sub(a.x, mul(ray.shear_x, a.z)), sub(a.y, mul(ray.shear_y, a.z)), mul(ray.shear_z, a.z), a.z);
}

fn edge(p: Sheared, q: Sheared) -> f32 {
    return sub(mul(p.x, q.y), mul(p.y, q.x));
}

// The sign of p.x * q.y - p.y * q.x, exactly; where that is zero, as if the ray were moved by (e, e^2).
fn edge_sign(value: f32, p: Sheared, q: Sheared) -> i32 {
    let magnitude = bitcast<u32>(value) & 0x7fffffffu;
    if magnitude >= 0x0d800000u && magnitude < 0x7f800000u {
        return select(1, -1, value < 0.0);
    }
    let exact = sign_of_difference(p.x, q.y, p.y, q.x);
    if exact != 0 { return exact; }
    if p.y != q.y { return select(-1, 1, p.y > q.y); }
    return select(0, 1, q.x > p.x) - select(0, 1, q.x < p.x);
}

fn intersect(ray: Prepared, corners: Corners) -> Candidate {
    let a = shear(ray, corners.a);
    let b = shear(ray, corners.b);
    let c = shear(ray, corners.c);
    let u = edge(c, b);
    let v = edge(a, c);
    let w = edge(b, a);
    let miss = Candidate(false, 0.0, 0.0, 0.0, 1.0);
    if min(u, min(v, w)) < 0.0 && max(u, max(v, w)) > 0.0 { return miss; }
    let least = min(abs(u), min(abs(v), abs(w)));
    let sum = bitcast<u32>(add(add(u, v), w)) & 0x7fffffffu;
    // 2^-100: what is smaller may have lost its sign to flushing. Minima may hide a NaN, a sum does not.
    if least < 7.888609052210118e-31 || sum >= 0x7f000000u {
        let su = edge_sign(u, c, b);
        if su == 0 || su != edge_sign(v, a, c) || su != edge_sign(w, b, a) { return miss; }
    }
    return solve(flushed(u), flushed(v), flushed(w), a.z, b.z, c.z);
}

// Distance and weights of a hit, from its edge functions and depths.
fn solve(u: f32, v: f32, w: f32, az: f32, bz: f32, cz: f32) -> Candidate {
    let det = add(add(u, v), w);
    let size = bitcast<u32>(det) & 0x7fffffffu;
    if size == 0u || size >= 0x7f800000u {
        return Candidate(true, az, 0.0, 0.0, 1.0);
    }
    let t = add(add(flushed(mul(u, az)), flushed(mul(v, bz))), flushed(mul(w, cz)));
    return Candidate(true, t, v, w, det);
}
