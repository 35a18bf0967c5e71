// The textbook intersectors `moller_trumbore` and `woop`.

import package::geometry::ray::{MISS, PreparedRay, clamp_to_span, padded_slab};
import package::geometry::record::{Corners, corners_of};
import package::geometry::units::in_ray_units;
import package::lib::buffers::{counts, records};
import package::lib::counters::HIT_COUNT;

// Shared by both: t is clamped to the triangle's own box, so that the hit does not depend on the tree.

struct TriangleHit { is_hit: bool, t: f32, u: f32, v: f32, triangle: u32 }

const NO_TRIANGLE_HIT: TriangleHit = TriangleHit(false, 0.0, 0.0, 0.0, 0xffffffffu);

fn hit_within_own_box(ray: PreparedRay, corners: Corners, t: f32, u: f32, v: f32) -> TriangleHit {
    let span = padded_slab(ray, ray.inverse, min(min(corners.a, corners.b), corners.c), max(max(corners.a, corners.b), corners.c));
    return TriangleHit(span.x <= span.y, clamp_to_span(t, span), u, v, corners.triangle);
}

// Möller, Trumbore 1997, without culling and without its epsilon. It leaks near edges.
// Uses the device's own arithmetic, which may fuse operations and divide inexactly.

// Returns where the ray hits the leaf's triangle within its own box.
@if(!WOOP)
fn intersect_leaf(ray: PreparedRay, leaf: u32) -> TriangleHit {
    let corners = corners_of(leaf);
    let e1 = corners.b - corners.a;
    let e2 = corners.c - corners.a;
    let p = cross(ray.direction, e2);
    let inverse = 1.0 / dot(e1, p);
    let s = ray.origin - corners.a;
    let u = dot(s, p) * inverse;
    let q = cross(s, e1);
    let v = dot(ray.direction, q) * inverse;
    // A determinant of zero makes u or v infinite or NaN: no hit.
    if !(u >= 0.0 && v >= 0.0 && u + v <= 1.0) { return NO_TRIANGLE_HIT; }
    return hit_within_own_box(ray, corners, dot(e2, q) * inverse, u, v);
}

// Woop 2004: an affine transform maps each triangle to the unit triangle. It leaks near edges.
// Uses the device's own arithmetic, which may fuse operations and divide inexactly.

// Returns where the ray hits the leaf's triangle within its own box.
@if(WOOP)
fn intersect_leaf(ray: PreparedRay, leaf: u32) -> TriangleHit {
    let to_u = bitcast<vec4<f32>>(records[3u * leaf]);
    let to_v = bitcast<vec4<f32>>(records[3u * leaf + 1u]);
    let to_height = bitcast<vec4<f32>>(records[3u * leaf + 2u]);
    let origin = vec4<f32>(ray.origin, 1.0);
    let t = -dot(to_height, origin) / dot(to_height.xyz, ray.direction);
    let u = fma(t, dot(to_u.xyz, ray.direction), dot(to_u, origin));
    let v = fma(t, dot(to_v.xyz, ray.direction), dot(to_v, origin));
    // If the ray is parallel to the plane, t, u and v are infinite or NaN: no hit.
    if !(u >= 0.0 && v >= 0.0 && u + v <= 1.0) { return NO_TRIANGLE_HIT; }
    return hit_within_own_box(ray, corners_of(leaf), t, u, v);
}

// Closest-hit search: the best hit so far.

struct TextbookBest { t: f32, u: f32, v: f32, triangle: u32 }

fn textbook_initial_best(ray: PreparedRay) -> TextbookBest { return TextbookBest(ray.t_max, 0.0, 0.0, 0xffffffffu); }

// Returns the distance beyond which nodes are skipped. Nodes before 2^-100 may contain a hit at 0.
fn textbook_search_limit(best: TextbookBest) -> f32 { return max(best.t, 7.888609052210118e-31); }

// Tests the leaf's triangle. Keeps it if it precedes the best hit by t, then by index.
fn textbook_intersect_leaf_closest(ray: PreparedRay, leaf: u32, best: TextbookBest) -> TextbookBest {
    let hit = intersect_leaf(ray, leaf);
    let inside = hit.is_hit && hit.t > ray.t_min && hit.t < ray.t_max;
    let before = hit.t < best.t || (hit.t == best.t && hit.triangle < best.triangle);
    if inside && before { return TextbookBest(hit.t, hit.u, hit.v, hit.triangle); }
    return best;
}

// Returns the hit to write for a ray, with t in the ray's own units.
fn textbook_hit_of(i: u32, ray: PreparedRay, best: TextbookBest) -> vec4<u32> {
    if best.triangle == 0xffffffffu { return MISS; }
    atomicAdd(&counts[HIT_COUNT], 1u);
    let t = in_ray_units(best.t, ray.exponent);
    return vec4<u32>(t, bitcast<u32>(best.u), bitcast<u32>(best.v), best.triangle);
}

// Rasterization: the hit of one triangle.

// Returns the distance at which ray `i` hits a leaf's triangle, or the ray's t_max.
fn textbook_nearest_t(i: u32, ray: PreparedRay, leaf: u32) -> f32 { return textbook_intersect_single(ray, leaf).t; }

fn textbook_intersect_single(ray: PreparedRay, leaf: u32) -> TextbookBest {
    return textbook_intersect_leaf_closest(ray, leaf, textbook_initial_best(ray));
}

fn textbook_has_hit(best: TextbookBest) -> bool { return best.triangle != 0xffffffffu; }

// Any-hit search: returns whether the ray hits a leaf's triangle.

fn textbook_intersect_leaf_any(ray: PreparedRay, leaf: u32, ignore: u32) -> bool {
    let hit = intersect_leaf(ray, leaf);
    return hit.is_hit && hit.triangle != ignore && hit.t > ray.t_min && hit.t < ray.t_max;
}
