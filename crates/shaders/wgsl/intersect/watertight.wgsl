// The intersector `watertight`: sheared triangles with exact edge signs.

import package::geometry::node::NO_LEAF;
import package::geometry::ray::{MISS, PreparedRay};
import package::geometry::units::in_ray_units;
import package::intersect::sheared::{
    Edges, PermutedTriangle, Sheared, clamp_to_own_box, edges_of, loose_own_pad, padded_span, permuted_corners,
    undivided_hit,
};
import package::lib::buffers::{counts, records};
import package::lib::counters::HIT_COUNT;
import package::lib::exact::sign_of_difference;
import package::lib::ieee::{add, divide, divide_by, divisor};
import package::lib::params::params;

// Woop, Benthin, Wald 2013, with exact signs. A symbolic perturbation breaks ties: see docs/design/hits.md.

// Returns the exact sign of p.x * q.y - p.y * q.x. If that is zero, returns the sign after the ray is moved by (e, e^2)
// for an infinitesimal e.
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

fn surely_misses_triangle(e: Edges) -> bool {
    return min(e.u, min(e.v, e.w)) < 0.0 && max(e.u, max(e.v, e.w)) > 0.0;
}

// Returns whether the edge functions' signs are those of the exact ones.
fn signs_are_exact(e: Edges) -> bool {
    let least = min(abs(e.u), min(abs(e.v), abs(e.w)));
    let sum = bitcast<u32>(add(add(e.u, e.v), e.w)) & 0x7fffffffu;
    // 2^-100: smaller values may have lost their sign to flushing. Minima may hide a NaN; a sum does not.
    return least >= 7.888609052210118e-31 && sum < 0x7f000000u;
}

// Returns an upper bound on the padding of the triangle's own box along the main axis. The padding of the root box
// is such a bound. Some kernels compute a tighter one if `params.spread` is 1.
fn own_padding(ray: PreparedRay, e: Edges) -> f32 {
    @if(!(trace_packets || trace_packets_by_subgroups || resolve))
    if params.spread == 1u { return loose_own_pad(ray, e); }
    return ray.depth_padding;
}

fn depth_span(pad: f32, e: Edges) -> vec2<f32> { return padded_span(pad, e.a.z, e.b.z, e.c.z); }

// Returns whether a span that begins at `low` is surely beyond t_min. A t below 2^-100 is zero.
fn begins_after_t_min(ray: PreparedRay, low: f32) -> bool { return low > max(ray.t_min, 7.888609052210118e-31); }

// Returns where the ray hits a triangle within its own box, or infinity. The caller must have excluded triangles that the ray
// surely misses.
fn distance_to(ray: PreparedRay, corners: PermutedTriangle, e: Edges) -> f32 {
    if !signs_are_exact(e) {
        let side = edge_sign(e.u, e.c, e.b);
        if side == 0 || side != edge_sign(e.v, e.a, e.c) || side != edge_sign(e.w, e.b, e.a) {
            return bitcast<f32>(0x7f800000u | params.zero);
        }
    }
    let c = undivided_hit(e);
    return clamp_to_own_box(ray, corners, divide(c.t, c.det));
}

// Closest-hit search. The nearest and farthest depths of two triangles usually decide which hit comes first. Distances are
// computed only where they do not.

// The t of the best hit so far is in low ..= high.
struct WatertightBest { low: f32, high: f32, leaf: u32 }

fn watertight_initial_best(ray: PreparedRay) -> WatertightBest { return WatertightBest(ray.t_max, ray.t_max, NO_LEAF); }

// Returns the best hit so far at `t`. A hit below 2^-100 counts as one at 0, and nodes before 2^-100 may contain others.
fn watertight_best_at(t: f32, leaf: u32) -> WatertightBest { return WatertightBest(t, max(t, 7.888609052210118e-31), leaf); }

// Returns the distance beyond which nodes are skipped.
fn watertight_search_limit(best: WatertightBest) -> f32 { return best.high; }

// Tests the leaf's triangle. Keeps it if it precedes the best hit by t, then by index.
fn watertight_intersect_leaf_closest(ray: PreparedRay, leaf: u32, best: WatertightBest) -> WatertightBest {
    let corners = permuted_corners(ray.axes, leaf);
    let e = edges_of(ray, corners);
    if surely_misses_triangle(e) { return best; }
    let pad = own_padding(ray, e);
    let span = depth_span(pad, e);
    if span.x > best.high || span.y <= ray.t_min { return best; }
    // A long interval would let the search continue far beyond the hit. 8192 pads are 0.008 D.
    let is_thin = span.y - span.x < max(0.125 * span.y, 8192.0 * pad);
    if signs_are_exact(e) && begins_after_t_min(ray, span.x) && is_thin && span.y < best.low {
        return WatertightBest(span.x, span.y, leaf);
    }
    let t = distance_to(ray, corners, e);
    if !(t > ray.t_min && t < ray.t_max) || t > best.high { return best; }
    if best.leaf == NO_LEAF || t < best.low { return watertight_best_at(t, leaf); }
    let previous = permuted_corners(ray.axes, best.leaf);
    return watertight_earlier(t, leaf, distance_to(ray, previous, edges_of(ray, previous)), best.leaf);
}

// Returns the hit that comes first, by t, then by index.
fn watertight_earlier(t: f32, leaf: u32, other_t: f32, other: u32) -> WatertightBest {
    if t < other_t || (t == other_t && records[3u * leaf].w < records[3u * other].w) { return watertight_best_at(t, leaf); }
    return watertight_best_at(other_t, other);
}

// Returns the hit to write for a ray, with t in the ray's own units.
fn watertight_hit_of(i: u32, ray: PreparedRay, best: WatertightBest) -> vec4<u32> {
    if best.leaf == NO_LEAF { return MISS; }
    @if(!MODULE) atomicAdd(&counts[HIT_COUNT], 1u);
    let corners = permuted_corners(ray.axes, best.leaf);
    let c = undivided_hit(edges_of(ray, corners));
    let by = divisor(c.det);
    let t = clamp_to_own_box(ray, corners, divide_by(c.t, by));
    let weights = vec2<f32>(divide_by(c.v, by), divide_by(c.w, by));
    return vec4<u32>(in_ray_units(t, ray.exponent), bitcast<vec2<u32>>(weights), corners.triangle);
}

// Any-hit search: returns whether the ray hits a leaf's triangle.

fn watertight_intersect_leaf_any(ray: PreparedRay, leaf: u32, ignore: u32) -> bool {
    let corners = permuted_corners(ray.axes, leaf);
    let e = edges_of(ray, corners);
    if surely_misses_triangle(e) || corners.triangle == ignore { return false; }
    let span = depth_span(own_padding(ray, e), e);
    if span.x >= ray.t_max || span.y <= ray.t_min { return false; }
    if signs_are_exact(e) && begins_after_t_min(ray, span.x) && span.y < ray.t_max { return true; }
    let t = distance_to(ray, corners, e);
    return t > ray.t_min && t < ray.t_max;
}
