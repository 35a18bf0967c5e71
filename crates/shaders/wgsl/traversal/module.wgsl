// Functions that trace single rays for the caller's own shaders: `abvh::shader_module`. The build
// adds the prefix `abvh_` to all names except those that `module` in build/variants.rs lists.

import package::geometry::queries::is_invalid_ray;
import package::geometry::range::is_measured_extreme;
import package::geometry::ray::{MISS, prepare_ray, root_relative_to};
import package::geometry::units::{is_extreme, scaled_point};
import package::intersect::intersector::{hit_of, trace_any};
import package::lib::params::params;
import package::traversal::traverse::find_closest;

// The hit of a ray: t (the distance as a multiple of the direction's length), the weights of the triangle's second and
// third vertex, and the triangle's index among those of all meshes. The t of a miss is infinite.
struct AbvhHit { t: f32, u: f32, v: f32, triangle: u32 }

// Replaces a triangle index: the ray hits nothing.
const ABVH_MISS: u32 = 0xffffffffu;
// Replaces a triangle index: the ray is extreme. Only the library's queries trace such rays.
const ABVH_EXTREME: u32 = 0xfffffffeu;

// Returns whether the ray needs exact arithmetic, which this module does not contain.
fn is_extreme_origin(origin: vec3<f32>) -> bool {
    if params.extreme == 2u { return is_measured_extreme(origin); }
    return is_extreme(origin);
}

// Returns the closest hit for t between t_min and t_max, both excluded.
fn abvh_closest(origin: vec3<f32>, t_min: f32, direction: vec3<f32>, t_max: f32) -> AbvhHit {
    let first = vec4<u32>(bitcast<vec3<u32>>(origin), bitcast<u32>(t_min));
    let second = vec4<u32>(bitcast<vec3<u32>>(direction), bitcast<u32>(t_max));
    let start = scaled_point(first.xyz);
    var hit = MISS;
    if params.node_count > 0u && !is_invalid_ray(first, second) {
        if is_extreme_origin(start) { return AbvhHit(0.0, 0.0, 0.0, ABVH_EXTREME); }
        let ray = prepare_ray(start, second.xyz, first.w, second.w, root_relative_to(start));
        hit = hit_of(0u, ray, find_closest(ray));
    }
    return AbvhHit(bitcast<f32>(hit.x), bitcast<f32>(hit.y), bitcast<f32>(hit.z), hit.w);
}

// Returns 1 if there is any hit, 0 if not, or ABVH_EXTREME.
fn abvh_any(origin: vec3<f32>, t_min: f32, direction: vec3<f32>, t_max: f32) -> u32 {
    let first = vec4<u32>(bitcast<vec3<u32>>(origin), bitcast<u32>(t_min));
    let second = vec4<u32>(bitcast<vec3<u32>>(direction), bitcast<u32>(t_max));
    let start = scaled_point(first.xyz);
    if params.node_count == 0u || is_invalid_ray(first, second) { return 0u; }
    if is_extreme_origin(start) { return ABVH_EXTREME; }
    let ray = prepare_ray(start, second.xyz, first.w, second.w, root_relative_to(start));
    return u32(trace_any(ray, 0xffffffffu));
}
