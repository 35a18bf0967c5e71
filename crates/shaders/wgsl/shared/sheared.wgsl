// A triangle sheared along a ray (Woop, Benthin, Wald 2013), and where it is crossed: see ARCHITECTURE.md.

// A hit at t / det with weights v / det and w / det, divided only where it matters.
struct Candidate { t: f32, v: f32, w: f32, det: f32 }

struct Corners { a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, triangle: u32 }

// x, y, the depth, and the distance along the axis that it comes from.
struct Sheared { x: f32, y: f32, z: f32, along: f32 }

fn corners_of(leaf: u32) -> Corners {
    let first = records[3u * leaf];
    let b = bitcast<vec3<f32>>(records[3u * leaf + 1u].xyz);
    let c = bitcast<vec3<f32>>(records[3u * leaf + 2u].xyz);
    return Corners(bitcast<vec3<f32>>(first.xyz), b, c, first.w);
}

fn shear(ray: Prepared, vertex: vec3<f32>) -> Sheared {
    let a = permute(vec3<f32>(sub(vertex.x, ray.origin.x), sub(vertex.y, ray.origin.y), sub(vertex.z, ray.origin.z)), ray.axis);
    return Sheared(sub(a.x, mul(ray.shear_x, a.z)), sub(a.y, mul(ray.shear_y, a.z)), mul(ray.shear_z, a.z), a.z);
}

fn edge(p: Sheared, q: Sheared) -> f32 {
    return sub(mul(p.x, q.y), mul(p.y, q.x));
}

// Distance and weights of a hit, from its edge functions and depths.
fn solve(u: f32, v: f32, w: f32, az: f32, bz: f32, cz: f32) -> Candidate {
    let det = add(add(u, v), w);
    let size = bitcast<u32>(det) & 0x7fffffffu;
    if size == 0u || size >= 0x7f800000u {
        return Candidate(az, 0.0, 0.0, 1.0);
    }
    let t = add(add(flushed(mul(u, az)), flushed(mul(v, bz))), flushed(mul(w, cz)));
    return Candidate(t, v, w, det);
}

// Between its nearest and its farthest corner a triangle is met, if at all: less and more the padding. Anywhere, from beyond 2^80.
fn span_of_depths(ray: Prepared, a: f32, b: f32, c: f32) -> vec2<f32> {
    return vec2<f32>(sub(min(a, min(b, c)), ray.pad), add(max(a, max(b, c)), ray.pad));
}

// A triangle's sheared corners, and its edge functions.
struct Edges { a: Sheared, b: Sheared, c: Sheared, u: f32, v: f32, w: f32 }

fn edges_of(ray: Prepared, corners: Corners) -> Edges {
    let a = shear(ray, corners.a);
    let b = shear(ray, corners.b);
    let c = shear(ray, corners.c);
    return Edges(a, b, c, edge(c, b), edge(a, c), edge(b, a));
}

// Where a triangle is crossed that is hit, whatever its signs.
fn crossing(e: Edges) -> Candidate {
    return solve(flushed(e.u), flushed(e.v), flushed(e.w), e.a.z, e.b.z, e.c.z);
}
