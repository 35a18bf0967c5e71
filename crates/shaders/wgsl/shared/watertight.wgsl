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

fn surely_passes(e: Edges) -> bool {
    return min(e.u, min(e.v, e.w)) < 0.0 && max(e.u, max(e.v, e.w)) > 0.0;
}

// Whether the edge functions' signs are those of the exact ones.
fn signs_stand(e: Edges) -> bool {
    let least = min(abs(e.u), min(abs(e.v), abs(e.w)));
    let sum = bitcast<u32>(add(add(e.u, e.v), e.w)) & 0x7fffffffu;
    // 2^-100: what is smaller may have lost its sign to flushing. Minima may hide a NaN, a sum does not.
    return least >= 7.888609052210118e-31 && sum < 0x7f000000u;
}

fn span_of(ray: Prepared, e: Edges) -> vec2<f32> { return span_of_depths(ray, e.a.z, e.b.z, e.c.z); }

// Whether a span that begins at `low` surely lies behind t_min. 2^-100: a t below that is zero.
fn begins_within(ray: Prepared, low: f32) -> bool { return low > max(ray.t_min, 7.888609052210118e-31); }

// Where the ray meets a triangle that it does not surely pass by, within its own box; infinite if nowhere.
fn distance_to(ray: Prepared, corners: Turned, e: Edges) -> f32 {
    if !signs_stand(e) {
        let side = edge_sign(e.u, e.c, e.b);
        if side == 0 || side != edge_sign(e.v, e.a, e.c) || side != edge_sign(e.w, e.b, e.a) { return bitcast<f32>(0x7f800000u | params.zero); }
    }
    let c = crossing(e);
    return within_own(ray, corners, divide(c.t, c.det));
}
