// Kernels that trace extreme rays for `watertight` and `exact`. With these intersectors, other kernels treat rays that they
// know to be extreme as misses: see "Extreme rays" in docs/design/hits.md.

import package::geometry::queries::{is_invalid_ray, query_ray, set_line_of_query};
import package::geometry::range::{is_measured_extreme, makes_rays_extreme};
import package::geometry::ray::MISS;
import package::geometry::record::NO_TRIANGLE;
import package::geometry::triangle::points_of;
import package::geometry::units::{is_extreme, is_finite, scale_bits};
import package::intersect::extreme::{any_extreme_hit, closest_extreme_hit};
import package::intersect::line::{prepare_line, set_line, store_corners, store_determinant};
import package::lib::buffers::{counts, hits, occluded};
import package::lib::counters::{FOUND_EXTREME, HIT_COUNT, OCCLUDED_COUNT};
import package::lib::exact::{soft_add, soft_multiply};
import package::lib::integers::{
    INTERSECTIONS_OFFSET, ONE_OFFSET, PRODUCTS_OFFSET, accumulate_product, clear, sign_of_number, to_sign_magnitude,
};
import package::lib::params::{element_index, params};

// Shadow rays of extreme rays. The host's counterpart is `shadow_ray` in cpu-ref/src/extreme.rs. All numbers are bits, added and
// multiplied by IEEE rules, except that the largest finite number replaces infinity.

fn saturated(x: u32) -> u32 { return select(x, (x & 0x80000000u) | 0x7f7fffffu, (x & 0x7fffffffu) >= 0x7f800000u); }

fn add_saturated(a: u32, b: u32) -> u32 { return saturated(soft_add(a, b)); }

fn multiply_saturated(a: u32, b: u32) -> u32 { return saturated(soft_multiply(a, b)); }

fn scale_saturated(x: u32, exponent: i32) -> u32 { return saturated(bitcast<u32>(scale_bits(x, exponent))); }

fn negate(x: u32) -> u32 { return x ^ 0x80000000u; }

fn max_magnitude(given: u32, point: vec3<u32>) -> u32 {
    let size = point & vec3<u32>(0x7fffffffu);
    return max(given, max(size.x, max(size.y, size.z)));
}

// A hit point, and a bound on the error of each coordinate.
struct HitPoint { position: vec3<u32>, error: u32 }

// Computes the hit point along the ray, or within the triangle if the corners are at least four times smaller. Along
// the ray, the error bound is 4 * 2^-24 of the numbers. Within the triangle, it is 12 * 2^-24 (0x35400000) of the corners.
fn hit_point(origin: vec3<u32>, direction: vec3<u32>, hit: vec4<u32>, points: array<vec3<u32>, 3>) -> HitPoint {
    var displacement: vec3<u32>;
    for (var i = 0u; i < 3u; i += 1u) { displacement[i] = multiply_saturated(hit.x, direction[i]); }
    let largest_along = max_magnitude(max_magnitude(0u, origin), displacement);
    let largest_within = max_magnitude(max_magnitude(max_magnitude(0u, points[0]), points[1]), points[2]);
    var p: vec3<u32>;
    if scale_saturated(largest_within, 2) > largest_along {
        for (var i = 0u; i < 3u; i += 1u) { p[i] = add_saturated(origin[i], displacement[i]); }
        return HitPoint(p, scale_saturated(max_magnitude(largest_along, p), -22));
    }
    for (var i = 0u; i < 3u; i += 1u) {
        let a = points[0][i];
        let by_u = multiply_saturated(hit.y, add_saturated(points[1][i], negate(a)));
        let by_v = multiply_saturated(hit.z, add_saturated(points[2][i], negate(a)));
        p[i] = add_saturated(a, add_saturated(by_u, by_v));
    }
    return HitPoint(p, multiply_saturated(0x35400000u, largest_within));
}

// Returns the side of a triangle's plane on which a point is.
fn side_of(points: array<vec3<u32>, 3>, point: vec3<u32>) -> i32 {
    // The determinant N depends only on the line's start. Direction 1.0 and t_max infinity are arbitrary.
    set_line(point, vec3<u32>(0x3f800000u, 0u, 0u), 0u, 0x7f800000u, 0);
    prepare_line();
    let stored = store_corners(points);
    store_determinant(PRODUCTS_OFFSET, 3u, stored.len);
    return sign_of_number(PRODUCTS_OFFSET, stored.len.triple);
}

// Returns the sign of a component of a triangle's normal. For the direction 1.0 along an axis, U + V + W is the
// negative of this component. So the loop subtracts.
fn normal_sign(points: array<vec3<u32>, 3>, axis: u32) -> i32 {
    var direction = vec3<u32>(0u);
    direction[axis] = 0x3f800000u;
    set_line(points[0], direction, 0u, 0x7f800000u, 0);
    prepare_line();
    let stored = store_corners(points);
    clear(INTERSECTIONS_OFFSET, stored.len.triple);
    for (var side = 0u; side < 3u; side += 1u) {
        store_determinant(PRODUCTS_OFFSET, side, stored.len);
        accumulate_product(INTERSECTIONS_OFFSET, stored.len.triple, PRODUCTS_OFFSET, stored.len.triple, ONE_OFFSET, 1u, 1u);
    }
    to_sign_magnitude(INTERSECTIONS_OFFSET, stored.len.triple);
    return sign_of_number(INTERSECTIONS_OFFSET, stored.len.triple);
}

// Returns whether the hit of a ray is in shadow. The light is in scene units.
fn is_in_extreme_shadow(origin: vec3<u32>, direction: vec3<u32>, hit: vec4<u32>) -> bool {
    let points = points_of(hit.w);
    let light = bitcast<vec3<u32>>(params.light);
    let point = hit_point(origin, direction, hit, points);
    var side = side_of(points, light);
    if side == 0 { side = side_of(points, origin); }
    // 4 as bits is 2^-147, four times the smallest positive number.
    let delta = max(point.error, 4u);
    var start: vec3<u32>;
    var shadow_direction: vec3<u32>;
    for (var i = 0u; i < 3u; i += 1u) {
        let direction_sign = side * normal_sign(points, i);
        var offset = 0u;
        if direction_sign > 0 { offset = delta; }
        if direction_sign < 0 { offset = negate(delta); }
        start[i] = add_saturated(point.position[i], offset);
        shadow_direction[i] = soft_add(bitcast<u32>(scale_bits(light[i], -1)), negate(bitcast<u32>(scale_bits(start[i], -1))));
    }
    if !is_finite(shadow_direction) || all((shadow_direction & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u)) { return false; }
    // t is in (0, 2), because the direction is half the vector to the light.
    set_line(start, shadow_direction, 0u, 0x40000000u, 0);
    return any_extreme_hit(hit.w);
}

// Returns whether any ray may be extreme. For explicit rays, the search recorded it. For a camera's rays, the host
// dispatches this kernel only if they are extreme or the range is unknown. An unknown range is read from `range`.
fn may_have_extreme_rays() -> bool {
    if params.extreme == 1u || range_makes_rays_extreme() { return true; }
    if params.width > 0u { return params.extreme != 2u; }
    return atomicLoad(&counts[FOUND_EXTREME]) > 0u;
}

// Returns whether a ray is extreme by the parameters alone. For a camera, the kernels call this only if all rays are
// extreme.
fn is_extreme_by_params(i: u32) -> bool { return params.width > 0u || is_extreme(query_ray(i).origin); }

// Returns whether the measured range makes rays extreme. The search ran without that range.
@if(extreme_rays)
fn range_makes_rays_extreme() -> bool { return params.extreme == 2u && makes_rays_extreme(); }
@else
fn range_makes_rays_extreme() -> bool { return false; }

@if(extreme_rays)
fn is_extreme_ray(i: u32) -> bool {
    if params.extreme == 2u { return is_measured_extreme(query_ray(i).origin); }
    return is_extreme_by_params(i);
}
// For shadow rays, the host knows the range.
@else
fn is_extreme_ray(i: u32) -> bool { return is_extreme_by_params(i); }

// The closest hits of extreme rays, four words each. If `answer_words` is 1: whether each ray hits anything.

@group(0) @binding(next) var<storage, read_write> answers: array<u32>;

// Removes the hit that the search counted for ray `i`, if any. If the host did not know the range, the search has traced all
// rays except those with extreme origins.
fn discount_hit(i: u32) {
    let last = answers[params.extremes.answer_words * (i + 1u) - 1u];
    let was_hit = select(last != NO_TRIANGLE, last == 1u, params.extremes.answer_words == 1u);
    if params.extreme == 2u && was_hit { atomicSub(&counts[HIT_COUNT], 1u); }
}

fn write_answer(i: u32, hit: vec4<u32>) {
    if params.extremes.answer_words == 1u {
        answers[i] = u32(hit.w != NO_TRIANGLE);
        return;
    }
    for (var word = 0u; word < 4u; word += 1u) { answers[4u * i + word] = hit[word]; }
}

fn trace_extreme_ray(i: u32) {
    discount_hit(i);
    var hit = MISS;
    let ray = query_ray(i);
    if !is_invalid_ray(ray.first, ray.second) {
        set_line_of_query(i);
        hit = closest_extreme_hit(params.extremes.answer_words == 1u);
    }
    write_answer(i, hit);
}

// Parameters: extremes.
@compute @workgroup_size(64)
fn extreme_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    if !may_have_extreme_rays() { return; }
    for (var i = element_index(id, groups, 64u); i < params.count; i += 64u * groups.x * groups.y) {
        if is_extreme_ray(i) { trace_extreme_ray(i); }
    }
}

// The shadow rays of the hits of extreme rays.

fn trace_extreme_shadow(i: u32) {
    occluded[i] = 0u;
    if hits[i].w == NO_TRIANGLE { return; }
    let ray = query_ray(i);
    if is_in_extreme_shadow(ray.first.xyz, ray.second.xyz, hits[i]) {
        occluded[i] = 1u;
        atomicAdd(&counts[OCCLUDED_COUNT], 1u);
    }
}

// Parameters: extremes.
@compute @workgroup_size(64)
fn extreme_shadow_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    if !may_have_extreme_rays() { return; }
    for (var i = element_index(id, groups, 64u); i < params.count; i += 64u * groups.x * groups.y) {
        if is_extreme_ray(i) { trace_extreme_shadow(i); }
    }
}
