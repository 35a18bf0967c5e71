// The textbook intersectors `moller_trumbore` and `woop`.

import package::geometry::ray::{MISS, PreparedRay, clamp_to_span, padded_slab, rounded_inverse};
import package::geometry::record::{Corners, corners_of};
import package::geometry::units::in_ray_units;
import package::lib::buffers::{counts, records};
import package::lib::counters::HIT_COUNT;
import package::lib::params::params;

// Shared by both: t is clamped to the triangle's own box, so that the hit does not depend on the tree.

// The exact reciprocal: boxes decide hits at each candidate triangle.
fn textbook_inverse_for(ray: PreparedRay) -> vec3<f32> { return rounded_inverse(ray); }

struct Meeting { hit: bool, t: f32, u: f32, v: f32, triangle: u32 }

const NO_MEETING: Meeting = Meeting(false, 0.0, 0.0, 0.0, 0xffffffffu);

fn within_box(ray: PreparedRay, k: Corners, t: f32, u: f32, v: f32) -> Meeting {
    let own = padded_slab(ray, ray.inverse, min(min(k.a, k.b), k.c), max(max(k.a, k.b), k.c));
    return Meeting(own.x <= own.y, clamp_to_span(t, own), u, v, k.triangle);
}

// Möller, Trumbore 1997, without culling and without its epsilon. It leaks near edges.
// Uses the device's own arithmetic, which may fuse operations and divide inexactly.

// Returns where the ray hits the leaf's triangle within its own box.
@if(!WOOP)
fn meet_leaf(ray: PreparedRay, leaf: u32) -> Meeting {
    let k = corners_of(leaf);
    let e1 = k.b - k.a;
    let e2 = k.c - k.a;
    let p = cross(ray.direction, e2);
    let inverse = 1.0 / dot(e1, p);
    let s = ray.origin - k.a;
    let u = dot(s, p) * inverse;
    let q = cross(s, e1);
    let v = dot(ray.direction, q) * inverse;
    // A determinant of zero makes u or v infinite or NaN: no hit.
    if !(u >= 0.0 && v >= 0.0 && u + v <= 1.0) { return NO_MEETING; }
    return within_box(ray, k, dot(e2, q) * inverse, u, v);
}

// Woop 2004: an affine transform maps each triangle to the unit triangle. It leaks near edges.
// Uses the device's own arithmetic, which may fuse operations and divide inexactly.

// Returns where the ray hits the leaf's triangle within its own box.
@if(WOOP)
fn meet_leaf(ray: PreparedRay, leaf: u32) -> Meeting {
    let to_u = bitcast<vec4<f32>>(records[3u * leaf]);
    let to_v = bitcast<vec4<f32>>(records[3u * leaf + 1u]);
    let to_height = bitcast<vec4<f32>>(records[3u * leaf + 2u]);
    let origin = vec4<f32>(ray.origin, 1.0);
    let t = -dot(to_height, origin) / dot(to_height.xyz, ray.direction);
    let u = fma(t, dot(to_u.xyz, ray.direction), dot(to_u, origin));
    let v = fma(t, dot(to_v.xyz, ray.direction), dot(to_v, origin));
    // If the ray is parallel to the plane, t, u and v are infinite or NaN: no hit.
    if !(u >= 0.0 && v >= 0.0 && u + v <= 1.0) { return NO_MEETING; }
    return within_box(ray, corners_of(leaf), t, u, v);
}

// Closest-hit search: the best hit so far.

struct TextbookFound { t: f32, u: f32, v: f32, triangle: u32 }

fn textbook_nothing_found(ray: PreparedRay) -> TextbookFound { return TextbookFound(ray.t_max, 0.0, 0.0, 0xffffffffu); }

// Nodes with an entry beyond this are skipped.
fn textbook_limit(found: TextbookFound) -> f32 { return found.t; }

// Tests the leaf's triangle. Keeps it if it precedes the best hit by t, then by index.
fn textbook_intersect_leaf_closest(ray: PreparedRay, leaf: u32, best: TextbookFound) -> TextbookFound {
    let m = meet_leaf(ray, leaf);
    let inside = m.hit && m.t > ray.t_min && m.t < ray.t_max;
    let before = m.t < best.t || (m.t == best.t && m.triangle < best.triangle);
    if inside && before { return TextbookFound(m.t, m.u, m.v, m.triangle); }
    return best;
}

// Returns the hit to write for a ray, with t in the ray's own units.
fn textbook_hit_of(i: u32, ray: PreparedRay, best: TextbookFound) -> vec4<u32> {
    if best.triangle == 0xffffffffu { return MISS; }
    atomicAdd(&counts[HIT_COUNT], 1u);
    let t = in_ray_units(best.t, ray.exponent);
    return vec4<u32>(t, bitcast<u32>(best.u), bitcast<u32>(best.v), best.triangle);
}

// No hit is left open.
fn textbook_is_unresolved(hit: vec4<u32>) -> bool { return false; }

// Rasterization: the hit of one triangle.

// Returns the distance at which a ray hits a leaf's triangle, or infinity.
fn textbook_begin_of(ray: PreparedRay, leaf: u32) -> f32 { return textbook_hit_on(ray, leaf).t; }

fn textbook_hit_on(ray: PreparedRay, leaf: u32) -> TextbookFound {
    return textbook_intersect_leaf_closest(ray, leaf, textbook_nothing_found(ray));
}

fn textbook_is_found(best: TextbookFound) -> bool { return best.triangle != 0xffffffffu; }

// Any-hit search: returns whether the ray hits a leaf's triangle.

fn textbook_intersect_leaf_any(ray: PreparedRay, leaf: u32, ignore: u32) -> bool {
    let m = meet_leaf(ray, leaf);
    return m.hit && m.triangle != ignore && m.t > ray.t_min && m.t < ray.t_max;
}
