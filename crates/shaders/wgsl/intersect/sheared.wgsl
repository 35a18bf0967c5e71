// Sheared triangles (Woop, Benthin, Wald 2013) and their intersection: see docs/design/hits.md.

import package::geometry::ray::{
    MIN_DISTANCE, PreparedRay, are_negative, clamp_to_span, each_away_from_zero, max_component, min_component, padded_slab,
    rounded_inverse, unpermute,
};
import package::geometry::units::flushed;
import package::lib::buffers::records;
import package::lib::ieee::{add, mul, sub};
import package::lib::params::params;

// A hit at t / det with weights v / det and w / det. The division is deferred until it is needed.
struct UndividedHit { t: f32, v: f32, w: f32, det: f32 }

// A triangle's corners in the ray's axis order (kx, ky, kz), grouped by axis.
struct PermutedTriangle { x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, triangle: u32 }

// Sheared x and y, the depth, and the distance along the main axis that the depth is computed from.
struct Sheared { x: f32, y: f32, z: f32, along: f32 }

// A triangle's sheared corners and edge functions.
struct Edges { a: Sheared, b: Sheared, c: Sheared, u: f32, v: f32, w: f32 }

// Needs no selects, because the rows of the record are read in the order of `axes`.
fn permuted_corners(axes: vec3<u32>, leaf: u32) -> PermutedTriangle {
    let x = records[3u * leaf + axes.x];
    let y = records[3u * leaf + axes.y];
    let z = records[3u * leaf + axes.z];
    return PermutedTriangle(bitcast<vec3<f32>>(x.xyz), bitcast<vec3<f32>>(y.xyz), bitcast<vec3<f32>>(z.xyz), x.w);
}

fn shear(ray: PreparedRay, x: f32, y: f32, z: f32) -> Sheared {
    let along = sub(z, ray.permuted_origin.z);
    return Sheared(
        sub(sub(x, ray.permuted_origin.x), mul(ray.shear_x, along)),
        sub(sub(y, ray.permuted_origin.y), mul(ray.shear_y, along)),
        mul(ray.shear_z, along),
        along,
    );
}

fn edge_function(p: Sheared, q: Sheared) -> f32 {
    return sub(mul(p.x, q.y), mul(p.y, q.x));
}

// Computes distance and weights of a hit from its edge functions and depths.
fn solve_hit(u: f32, v: f32, w: f32, az: f32, bz: f32, cz: f32) -> UndividedHit {
    let det = add(add(u, v), w);
    let size = bitcast<u32>(det) & 0x7fffffffu;
    if size == 0u || size >= 0x7f800000u {
        return UndividedHit(az, 0.0, 0.0, 1.0);
    }
    let t = add(add(flushed(mul(u, az)), flushed(mul(v, bz))), flushed(mul(w, cz)));
    return UndividedHit(t, v, w, det);
}

// Returns the interval in which a triangle can be hit: from its nearest to its farthest corner, extended by the padding. If D
// reaches 2^80, the interval is infinite.
fn span_of_depths(ray: PreparedRay, a: f32, b: f32, c: f32) -> vec2<f32> { return padded_span(ray.depth_padding, a, b, c); }

fn padded_span(pad: f32, a: f32, b: f32, c: f32) -> vec2<f32> {
    return vec2<f32>(sub(min(a, min(b, c)), pad), add(max(a, max(b, c)), pad));
}

// Returns an upper bound on the padding of the triangle's own box along the main axis. Relative to the origin,
// a corner's coordinate is at most its larger sheared coordinate plus its distance along the main axis.
fn loose_own_pad(ray: PreparedRay, edges: Edges) -> f32 {
    let across = max(
        max(abs(edges.a.x), abs(edges.a.y)), max(max(abs(edges.b.x), abs(edges.b.y)), max(abs(edges.c.x), abs(edges.c.y))),
    );
    let along = max(abs(edges.a.along), max(abs(edges.b.along), abs(edges.c.along)));
    // 20 * 2^-24
    return 1.1920928955078125e-6 * max(across + along, MIN_DISTANCE) * abs(ray.shear_z);
}

fn edges_of(ray: PreparedRay, corners: PermutedTriangle) -> Edges {
    let a = shear(ray, corners.x.x, corners.y.x, corners.z.x);
    let b = shear(ray, corners.x.y, corners.y.y, corners.z.y);
    let c = shear(ray, corners.x.z, corners.y.z, corners.z.z);
    return Edges(a, b, c, edge_function(c, b), edge_function(a, c), edge_function(b, a));
}

// Returns where a triangle is hit. The signs of the edge functions are not tested.
fn undivided_hit(edges: Edges) -> UndividedHit {
    return solve_hit(flushed(edges.u), flushed(edges.v), flushed(edges.w), edges.a.z, edges.b.z, edges.c.z);
}

// The test of a triangle's own box, which avoids divisions where possible: see "Own boxes" in docs/design/hits.md.

// The device's own reciprocal suffices. Hits use `rounded_inverse` instead.
fn sheared_inverse_for(ray: PreparedRay) -> vec3<f32> { return 1.0 / each_away_from_zero(ray.direction); }

struct Box { low: vec3<f32>, high: vec3<f32> }

fn own_box(ray: PreparedRay, corners: PermutedTriangle) -> Box {
    let low = vec3<f32>(min_component(corners.x), min_component(corners.y), min_component(corners.z));
    let high = vec3<f32>(max_component(corners.x), max_component(corners.y), max_component(corners.z));
    return Box(unpermute(low, ray.axis), unpermute(high, ray.axis));
}

// Returns whether t is surely within the padded box, so that `padded_slab` is not needed.
fn loose_within(ray: PreparedRay, own: Box, t: f32) -> bool {
    let negative = are_negative(ray.inverse);
    let near = select(own.low, own.high, negative) - ray.origin;
    let far = select(own.high, own.low, negative) - ray.origin;
    // 4.25 * 2^-24
    let pad = 2.53319740295410156e-7 * max_component(max(abs(near), abs(far))) * abs(ray.inverse);
    let n = near * ray.inverse - pad;
    let f = far * ray.inverse + pad;
    // 2^100: from there on, products may be infinite.
    return abs(t) < 1.2676506002282294e30 && t >= max(n.x, max(n.y, n.z)) && t <= min(f.x, min(f.y, f.z));
}

fn own_span(ray: PreparedRay, own: Box) -> vec2<f32> { return padded_slab(ray, rounded_inverse(ray), own.low, own.high); }

// Clamps t to the triangle's own box, so that the hit does not depend on the tree. Returns infinity if the ray misses the box.
fn clamp_to_own_box(ray: PreparedRay, corners: PermutedTriangle, t: f32) -> f32 {
    let own = own_box(ray, corners);
    if loose_within(ray, own, t) { return flushed(t); }
    let span = own_span(ray, own);
    if !(span.x <= span.y) { return bitcast<f32>(0x7f800000u | params.zero); }
    return clamp_to_span(t, span);
}
