// Rays prepared for traversal, and their box tests.

import package::geometry::units::{exponent_of, flushed, scale_bits};
import package::intersect::intersector::inverse_for;
import package::lib::buffers::nodes;
import package::lib::ieee::{Divisor, add, divide_normal, divisor, mul, sub};
import package::lib::params::params;

// The corners of the root box relative to a ray's origin, and D of the root: the largest magnitude among their coordinates, at
// least 2^-38.
struct RelativeRoot { low: vec3<f32>, high: vec3<f32>, max_distance: f32 }

fn root_relative_to(origin: vec3<f32>) -> RelativeRoot {
    let low = bitcast<vec3<f32>>(nodes[0].xyz);
    let high = bitcast<vec3<f32>>(nodes[1].xyz);
    let to_low = vec3<f32>(sub(low.x, origin.x), sub(low.y, origin.y), sub(low.z, origin.z));
    let to_high = vec3<f32>(sub(high.x, origin.x), sub(high.y, origin.y), sub(high.z, origin.z));
    let distances = max(abs(to_low), abs(to_high));
    return RelativeRoot(to_low, to_high, max(MIN_DISTANCE, max(distances.x, max(distances.y, distances.z))));
}

// 2^80.
const MAX_DISTANCE: f32 = 1.2089258196146292e24;
// 2^-38. Compared with this D, coordinates that are replaced by zero are negligible.
const MIN_DISTANCE: f32 = 3.637978807091713e-12;

// Limits D of a box, so that no padding is infinite or less than the error of coordinates that are replaced by zero.
fn limit_distance(d: f32) -> f32 { return min(max(d, MIN_DISTANCE), MAX_DISTANCE); }

// Directions clamped away from zero, and signs.

fn away_from_zero(x: f32) -> f32 {
    let minimum = 0x21800000u; // 2^-60
    let bits = bitcast<u32>(x);
    return bitcast<f32>((bits & 0x80000000u) | max(bits & 0x7fffffffu, minimum));
}

fn each_away_from_zero(d: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(away_from_zero(d.x), away_from_zero(d.y), away_from_zero(d.z));
}

fn are_negative(v: vec3<f32>) -> vec3<bool> { return (bitcast<vec3<u32>>(v) >> vec3<u32>(31u)) == vec3<u32>(1u); }

// The hit of a ray that hits nothing.
const MISS: vec4<u32> = vec4<u32>(0x7f800000u, 0u, 0u, 0xffffffffu);

// The least and the greatest of three components.

fn min_component(v: vec3<f32>) -> f32 { return min(min(v.x, v.y), v.z); }
fn max_component(v: vec3<f32>) -> f32 { return max(max(v.x, v.y), v.z); }

// A prepared ray, and the padded box test: see "Box test" in docs/design/hits.md.

struct PreparedRay {
    origin: vec3<f32>,
    direction: vec3<f32>,
    t_min: f32,
    t_max: f32,
    // 1 / d per axis, with d pushed away from zero. It is the device's own reciprocal where it does not decide a hit.
    inverse: vec3<f32>,
    // 17 * 2^-24 * D of the root, with D at most 2^80. A triangle's own box is padded by at most max_padding * |1 / d|.
    max_padding: f32,
    // Terms that loose_planes adds to `plane * inverse`, for near and for far planes.
    near_offset: vec3<f32>,
    far_offset: vec3<f32>,
    // The main axis: that of the largest |d|.
    axis: u32,
    // The axes in the order (kx, ky, kz), and the origin in that order.
    axes: vec3<u32>,
    permuted_origin: vec3<f32>,
    // The shear along the main axis.
    shear_x: f32,
    shear_y: f32,
    shear_z: f32,
    // Padding along the main axis. Infinite if D reaches 2^80.
    depth_padding: f32,
    // t in the ray's own units is t * 2^-exponent.
    exponent: i32,
}

// Reorders components to (kx, ky, kz), where kz is the main axis.
fn permute(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v.yzx, v.zxy, axis == 1u), v, axis == 2u);
}

// Returns the axes (kx, ky, kz), where kz is the main axis.
fn permuted_axes(axis: u32) -> vec3<u32> {
    return select(select(vec3<u32>(1u, 2u, 0u), vec3<u32>(2u, 0u, 1u), axis == 1u), vec3<u32>(0u, 1u, 2u), axis == 2u);
}

// Reorders components from (kx, ky, kz) to (x, y, z).
fn unpermute(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v.zxy, v.yzx, axis == 1u), v, axis == 2u);
}

fn main_axis(d: vec3<f32>) -> u32 {
    let m = abs(d);
    if m.x >= m.y && m.x >= m.z { return 0u; }
    return select(2u, 1u, m.y >= m.z);
}

// Divides a component by the main one. A zero gets the sign of the main component.
fn shear_along(component: f32, by: Divisor) -> f32 {
    let signed_zero = bitcast<f32>(bitcast<u32>(by.value) & 0x80000000u);
    return select(divide_normal(component, by), signed_zero, component == 0.0);
}

// Prepares a ray with a finite, non-zero direction. The origin is in scaled units. The direction, t_min and t_max are the ray's
// own, as bits.
fn prepare_ray(origin: vec3<f32>, direction: vec3<u32>, t_min: u32, t_max: u32, root: RelativeRoot) -> PreparedRay {
    return prepare_ray_at_scale(origin, direction, t_min, t_max, root, params.scale_exponent);
}

// Prepares a ray whose origin and direction are both in scaled units, for t in (0, 1).
fn prepare_scaled_ray(origin: vec3<f32>, direction: vec3<f32>, root: RelativeRoot) -> PreparedRay {
    return prepare_ray_at_scale(origin, bitcast<vec3<u32>>(direction), 0u, 0x3f800000u, root, 0);
}

fn prepare_ray_at_scale(
    origin: vec3<f32>, direction: vec3<u32>, t_min: u32, t_max: u32, root: RelativeRoot, scale_exponent: i32,
) -> PreparedRay {
    var ray: PreparedRay;
    let exponent = exponent_of(direction);
    let scaled = scaled_direction(direction, exponent);
    let axis = main_axis(scaled);
    let permuted = permute(scaled, axis);
    ray.origin = origin;
    ray.direction = scaled;
    ray.axis = axis;
    ray.axes = permuted_axes(axis);
    ray.permuted_origin = permute(origin, axis);
    let main_divisor = divisor(permuted.z);
    ray.shear_x = shear_along(permuted.x, main_divisor);
    ray.shear_y = shear_along(permuted.y, main_divisor);
    ray.shear_z = divide_normal(1.0, main_divisor);
    ray.exponent = exponent - scale_exponent;
    ray.t_min = flushed(scale_bits(t_min, ray.exponent));
    ray.t_max = flushed(scale_bits(t_max, ray.exponent));

    let max_distance = root.max_distance;
    // 17 * 2^-24 * D.
    ray.max_padding = mul(1.01327896118164062e-6, min(max_distance, MAX_DISTANCE));
    ray.depth_padding = select(
        mul(ray.max_padding, abs(ray.shear_z)), bitcast<f32>(0x7f800000u | params.zero), max_distance >= MAX_DISTANCE,
    );
    ray.inverse = inverse_for(ray);
    return with_loose_offsets(ray, max_distance);
}

// Adds the terms that loose_planes needs: see "Inner boxes" in docs/design/hits.md.
fn with_loose_offsets(given: PreparedRay, max_distance: f32) -> PreparedRay {
    var ray = given;
    // 32 * 2^-24 * D and 4 * 2^-24 * |o|. From 2^80 on, D is limited, and the factor of |o| is ten times as large instead.
    let origin_factor = select(2.384185791015625e-7, 2.384185791015625e-6, max_distance >= MAX_DISTANCE);
    let padding = abs(ray.inverse) * (1.9073486328125e-6 * min(max_distance, MAX_DISTANCE) + origin_factor * abs(ray.origin));
    let scaled_origin = ray.origin * ray.inverse;
    // From 2^100 on, an axis is inconclusive.
    let is_conclusive = abs(scaled_origin) < vec3<f32>(1.2676506002282294e30);
    ray.near_offset = select(vec3<f32>(-8.507059173023462e37), -scaled_origin - padding, is_conclusive);
    ray.far_offset = select(vec3<f32>(8.507059173023462e37), padding - scaled_origin, is_conclusive);
    return ray;
}

// Returns x * 2^-e for the components of a direction. The largest result is in [1, 2); results below 2^-37 are zero.
fn scaled_direction(direction: vec3<u32>, e: i32) -> vec3<f32> {
    if e > -80 {
        let exponents = vec3<i32>((direction >> vec3<u32>(23u)) & vec3<u32>(255u)) - e;
        // Subnormal components become zero.
        let shifted = bitcast<vec3<f32>>(direction - vec3<u32>(bitcast<u32>(e) << 23u));
        return select(shifted, vec3<f32>(0.0), exponents < vec3<i32>(90));
    }
    return vec3<f32>(scaled_component(direction.x, e), scaled_component(direction.y, e), scaled_component(direction.z, e));
}

fn scaled_component(bits: u32, e: i32) -> f32 {
    let x = scale_bits(bits, -e);
    return select(x, 0.0, abs(x) < 7.275957614183426e-12);
}

// Where a ray enters and leaves a box along each axis.
struct Planes { near: vec3<f32>, far: vec3<f32> }

// Returns entry and exit distances per axis. The entry is no later, and the exit no earlier, than `padded_slab` finds
// for any box within this one. These distances select nodes and do not decide hits, so the driver may fuse the
// operations.
fn loose_planes(ray: PreparedRay, low: vec3<f32>, high: vec3<f32>) -> Planes {
    // Packets and rasterization are never used if `params.spread` is 1. This branch would cost them a tenth of their time.
    @if(!(trace_packets || trace_packets_by_subgroups || resolve))
    if params.spread == 1u { return loose_planes_own_padding(ray, low, high); }
    let negative = are_negative(ray.inverse);
    let near = select(low, high, negative) * ray.inverse + ray.near_offset;
    return Planes(near, select(high, low, negative) * ray.inverse + ray.far_offset);
}

// Returns the same for scenes with coordinates of very different sizes. Pads by the box's own D, which is at least that of any box
// within.
fn loose_planes_own_padding(ray: PreparedRay, low: vec3<f32>, high: vec3<f32>) -> Planes {
    let negative = are_negative(ray.inverse);
    let to_low = low - ray.origin;
    let to_high = high - ray.origin;
    let distances = max(abs(to_low), abs(to_high));
    // 32 * 2^-24
    let padding = 1.9073486328125e-6 * limit_distance(max_component(distances)) * abs(ray.inverse);
    let near = select(to_low, to_high, negative) * ray.inverse - padding;
    return Planes(near, select(to_high, to_low, negative) * ray.inverse + padding);
}

fn loose_slab(ray: PreparedRay, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let planes = loose_planes(ray, low, high);
    let n = planes.near;
    let f = planes.far;
    return vec2<f32>(max(n.x, max(n.y, n.z)), min(f.x, min(f.y, f.z)));
}

// Returns whether a ray intersects a node's box before `bound`. The corners are the first three words of each row.
fn intersects_box(ray: PreparedRay, low: vec4<u32>, high: vec4<u32>, bound: f32) -> bool {
    let s = loose_slab(ray, bitcast<vec3<f32>>(low.xyz), bitcast<vec3<f32>>(high.xyz));
    return s.x <= s.y && s.x <= bound && s.y >= ray.t_min;
}

// Returns a point relative to the ray's origin.
fn relative_to_origin(ray: PreparedRay, p: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(sub(p.x, ray.origin.x), sub(p.y, ray.origin.y), sub(p.z, ray.origin.z));
}

// Returns 1 / d per axis, rounded once.
fn rounded_inverse(ray: PreparedRay) -> vec3<f32> {
    let permuted = permute(ray.direction, ray.axis);
    let x = divide_normal(1.0, divisor(away_from_zero(permuted.x)));
    let y = divide_normal(1.0, divisor(away_from_zero(permuted.y)));
    // Along the main axis, which is far from zero, the shear is the reciprocal.
    return unpermute(vec3<f32>(x, y, ray.shear_z), ray.axis);
}

// Returns entry and exit of the padded box, which is met if x <= y. The padding uses the box's own D.
fn padded_slab(ray: PreparedRay, inverse: vec3<f32>, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let negative = are_negative(inverse);
    let near = relative_to_origin(ray, select(low, high, negative));
    let far = relative_to_origin(ray, select(high, low, negative));
    // 17 * 2^-24
    let margin = mul(1.01327896118164062e-6, limit_distance(max_component(max(abs(near), abs(far)))));
    let padding = vec3<f32>(mul(margin, abs(inverse.x)), mul(margin, abs(inverse.y)), mul(margin, abs(inverse.z)));
    let n = vec3<f32>(
        sub(mul(near.x, inverse.x), padding.x), sub(mul(near.y, inverse.y), padding.y), sub(mul(near.z, inverse.z), padding.z),
    );
    let f = vec3<f32>(
        add(mul(far.x, inverse.x), padding.x), add(mul(far.y, inverse.y), padding.y), add(mul(far.z, inverse.z), padding.z),
    );
    return vec2<f32>(max(n.x, max(n.y, n.z)), min(f.x, min(f.y, f.z)));
}

// Clamps t to the box's span. A NaN remains NaN. A result below 2^-100 becomes zero.
fn clamp_to_span(t: f32, span: vec2<f32>) -> f32 {
    let later = select(t, span.x, t < span.x);
    return flushed(select(later, span.y, later > span.y));
}
