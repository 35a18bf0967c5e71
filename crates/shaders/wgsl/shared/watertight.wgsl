// Woop, Benthin, Wald 2013, with exact signs and symbolic ties: see ARCHITECTURE.md.

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

// What a first look at a triangle tells: whether the ray surely passes by it or surely goes through; if it does,
// t lies in low ..= high, between its nearest and its farthest corner.
struct Glance { passes: bool, sure: bool, low: f32, high: f32 }

fn glance(ray: Prepared, corners: Corners) -> Glance {
    let a = shear(ray, corners.a);
    let b = shear(ray, corners.b);
    let c = shear(ray, corners.c);
    let u = edge(c, b);
    let v = edge(a, c);
    let w = edge(b, a);
    let passes = min(u, min(v, w)) < 0.0 && max(u, max(v, w)) > 0.0;
    let low = sub(min(a.z, min(b.z, c.z)), ray.pad);
    let high = add(max(a.z, max(b.z, c.z)), ray.pad);
    return Glance(passes, signs_stand(u, v, w), low, high);
}

// Whether the edge functions' signs are those of the exact ones.
fn signs_stand(u: f32, v: f32, w: f32) -> bool {
    let least = min(abs(u), min(abs(v), abs(w)));
    let sum = bitcast<u32>(add(add(u, v), w)) & 0x7fffffffu;
    // 2^-100: what is smaller may have lost its sign to flushing. Minima may hide a NaN, a sum does not.
    return least >= 7.888609052210118e-31 && sum < 0x7f000000u;
}

// Where the ray meets a triangle that it does not surely pass by, within its own box; infinite if nowhere.
fn distance_to(ray: Prepared, corners: Corners) -> f32 {
    let a = shear(ray, corners.a);
    let b = shear(ray, corners.b);
    let c = shear(ray, corners.c);
    let u = edge(c, b);
    let v = edge(a, c);
    let w = edge(b, a);
    if !signs_stand(u, v, w) {
        let side = edge_sign(u, c, b);
        if side == 0 || side != edge_sign(v, a, c) || side != edge_sign(w, b, a) { return bitcast<f32>(0x7f800000u | params.zero); }
    }
    let found = solve(flushed(u), flushed(v), flushed(w), a.z, b.z, c.z);
    return within_own(ray, corners, divide(found.t, found.det));
}
