// Woop, Benthin, Wald 2013, with exact signs and symbolic ties: see ARCHITECTURE.md.

struct Candidate { hit: bool, t: f32, u: f32, v: f32 }

struct Sheared { x: f32, y: f32, z: f32 }

fn shear(ray: Prepared, vertex: vec3<f32>) -> Sheared {
    let a = permute(vec3<f32>(sub(vertex.x, ray.origin.x), sub(vertex.y, ray.origin.y), sub(vertex.z, ray.origin.z)), ray.axis);
    return Sheared(sub(a.x, mul(ray.shear_x, a.z)), sub(a.y, mul(ray.shear_y, a.z)), mul(ray.shear_z, a.z));
}

fn edge(p: Sheared, q: Sheared) -> f32 {
    return sub(mul(p.x, q.y), mul(p.y, q.x));
}

// The sign of p.x * q.y - p.y * q.x, exactly; where that is zero, as if the ray were moved by (e, e^2).
fn edge_sign(value: f32, p: Sheared, q: Sheared) -> i32 {
    let magnitude = bitcast<u32>(value) & 0x7fffffffu;
    if magnitude >= 0x00800000u && magnitude < 0x7f800000u {
        return select(1, -1, value < 0.0);
    }
    let exact = sign_of_difference(p.x, q.y, p.y, q.x);
    if exact != 0 { return exact; }
    if p.y != q.y { return select(-1, 1, p.y > q.y); }
    return select(0, 1, q.x > p.x) - select(0, 1, q.x < p.x);
}

fn intersect(ray: Prepared, v0: vec3<f32>, v1: vec3<f32>, v2: vec3<f32>) -> Candidate {
    let a = shear(ray, v0);
    let b = shear(ray, v1);
    let c = shear(ray, v2);
    let u = edge(c, b);
    let v = edge(a, c);
    let w = edge(b, a);
    let miss = Candidate(false, 0.0, 0.0, 0.0);
    if min(u, min(v, w)) < 0.0 && max(u, max(v, w)) > 0.0 { return miss; }
    let least = min(abs(u), min(abs(v), abs(w)));
    let largest = max(abs(u), max(abs(v), abs(w)));
    if least < 1.1754943508222875e-38 || !(largest < 3e38) {
        let su = edge_sign(u, c, b);
        if su == 0 || su != edge_sign(v, a, c) || su != edge_sign(w, b, a) { return miss; }
    }
    let det = add(add(u, v), w);
    let size = bitcast<u32>(det) & 0x7fffffffu;
    if size == 0u || size >= 0x7f800000u {
        return Candidate(true, a.z, 0.0, 0.0);
    }
    let t = add(add(mul(u, a.z), mul(v, b.z)), mul(w, c.z));
    return Candidate(true, divide(t, det), divide(v, det), divide(w, det));
}
