// Prepared rays, and their box tests.

import package::geometry::units::{flushed, scale_bits};
import package::intersect::intersector::inverse_for;
import package::lib::buffers::nodes;
import package::lib::ieee::{Divisor, add, divide_normal, divisor, mul, parts, sub};
import package::lib::params::params;

// The corners of the root box relative to a ray's start, and the largest magnitude among their coordinates: D of the root.
struct Root { low: vec3<f32>, high: vec3<f32>, reach: f32 }

fn root_from(origin: vec3<f32>) -> Root {
    let low = bitcast<vec3<f32>>(nodes[0].xyz);
    let high = bitcast<vec3<f32>>(nodes[1].xyz);
    let to_low = vec3<f32>(sub(low.x, origin.x), sub(low.y, origin.y), sub(low.z, origin.z));
    let to_high = vec3<f32>(sub(high.x, origin.x), sub(high.y, origin.y), sub(high.z, origin.z));
    let away = max(abs(to_low), abs(to_high));
    return Root(to_low, to_high, max(away.x, max(away.y, away.z)));
}

// 2^80.
const FARTHEST: f32 = 1.2089258196146292e24;

// Shared by all ray tests: directions pushed away from zero, signs, and the hit of a miss.

fn push_from_zero(x: f32) -> f32 {
    let least = 0x21800000u; // 2^-60
    let bits = bitcast<u32>(x);
    return bitcast<f32>((bits & 0x80000000u) | max(bits & 0x7fffffffu, least));
}

fn pushed_from_zero(d: vec3<f32>) -> vec3<f32> { return vec3<f32>(push_from_zero(d.x), push_from_zero(d.y), push_from_zero(d.z)); }

fn are_negative(v: vec3<f32>) -> vec3<bool> { return (bitcast<vec3<u32>>(v) >> vec3<u32>(31u)) == vec3<u32>(1u); }

// The hit of a ray that hits nothing.
const MISS: vec4<u32> = vec4<u32>(0x7f800000u, 0u, 0u, 0xffffffffu);

// The least and the greatest of three components.

fn least_of(v: vec3<f32>) -> f32 { return min(min(v.x, v.y), v.z); }
fn most_of(v: vec3<f32>) -> f32 { return max(max(v.x, v.y), v.z); }

// A prepared ray, and the padded box test: see "Box test" in docs/design/hits.md.

struct Prepared {
    origin: vec3<f32>,
    direction: vec3<f32>,
    t_min: f32,
    t_max: f32,
    // 1 / d per axis, with d pushed away from zero. The device's own reciprocal, where it decides no hit.
    inverse: vec3<f32>,
    // No box is padded by more than slack * |1 / d|: 17 * 2^-24 * D of the root.
    slack: f32,
    // Terms that loose_planes adds to the near and far planes times the inverse.
    to_near: vec3<f32>,
    to_far: vec3<f32>,
    // The axis of the largest |d|, and the shear along it.
    axis: u32,
    // The axes in the order (kx, ky, kz), and the origin in that order.
    rows: vec3<u32>,
    start: vec3<f32>,
    shear_x: f32,
    shear_y: f32,
    shear_z: f32,
    // Padding along the main axis. Infinite if D reaches 2^80.
    pad: f32,
    // t in the ray's own units is t * 2^-exponent.
    exponent: i32,
}

// Reorders components to (kx, ky, kz), where kz is the main axis.
fn permute(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v.yzx, v.zxy, axis == 1u), v, axis == 2u);
}

// Returns the axes in that order.
fn rows_along(axis: u32) -> vec3<u32> {
    return select(select(vec3<u32>(1u, 2u, 0u), vec3<u32>(2u, 0u, 1u), axis == 1u), vec3<u32>(0u, 1u, 2u), axis == 2u);
}

// Restores the original order.
fn unpermute(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v.zxy, v.yzx, axis == 1u), v, axis == 2u);
}

fn main_axis(d: vec3<f32>) -> u32 {
    let m = abs(d);
    if m.x >= m.y && m.x >= m.z { return 0u; }
    return select(2u, 1u, m.y >= m.z);
}

// Divides a component by the main one. A zero gets the sign of the main component.
fn slope(component: f32, by: Divisor) -> f32 {
    let zero = bitcast<f32>(bitcast<u32>(by.value) & 0x80000000u);
    return select(divide_normal(component, by), zero, component == 0.0);
}

// Prepares a ray with a finite, non-zero direction. The origin is in scaled units. The direction, t_min and t_max are the ray's
// own, as bits.
fn prepare(origin: vec3<f32>, direction: vec3<u32>, t_min: u32, t_max: u32, root: Root) -> Prepared {
    return prepare_shifted(origin, direction, t_min, t_max, root, params.scale_exponent);
}

// Prepares a ray whose origin and direction are both in scaled units, for t in (0, 1).
fn prepare_scaled(origin: vec3<f32>, direction: vec3<f32>, root: Root) -> Prepared {
    return prepare_shifted(origin, bitcast<vec3<u32>>(direction), 0u, 0x3f800000u, root, 0);
}

fn prepare_shifted(origin: vec3<f32>, direction: vec3<u32>, t_min: u32, t_max: u32, root: Root, shift: i32) -> Prepared {
    var ray: Prepared;
    let sizes = direction & vec3<u32>(0x7fffffffu);
    let e = parts(max(sizes.x, max(sizes.y, sizes.z))).exponent - 127;
    let d = components(direction, e);
    let axis = main_axis(d);
    let k = permute(d, axis);
    ray.origin = origin;
    ray.direction = d;
    ray.axis = axis;
    ray.rows = rows_along(axis);
    ray.start = permute(origin, axis);
    let by = divisor(k.z);
    ray.shear_x = slope(k.x, by);
    ray.shear_y = slope(k.y, by);
    ray.shear_z = divide_normal(1.0, by);
    ray.exponent = e - shift;
    ray.t_min = flushed(scale_bits(t_min, ray.exponent));
    ray.t_max = flushed(scale_bits(t_max, ray.exponent));

    let reach = root.reach;
    // 17 * 2^-24 * D, and D is at most 2^80.
    ray.slack = mul(1.01327896118164062e-6, min(reach, FARTHEST));
    ray.pad = select(mul(ray.slack, abs(ray.shear_z)), bitcast<f32>(0x7f800000u | params.zero), reach >= FARTHEST);
    ray.inverse = inverse_for(ray);
    return loosely(ray, reach);
}

// Adds the terms that loose_planes needs: see "Inner boxes" in docs/design/hits.md.
fn loosely(given: Prepared, reach: f32) -> Prepared {
    var ray = given;
    // 32 * 2^-24 * D and 4 * 2^-24 * |o|. From 2^80 on, D is cut, and |o| counts ten times as much instead.
    let of_origin = select(2.384185791015625e-7, 2.384185791015625e-6, reach >= FARTHEST);
    let pad = abs(ray.inverse) * (1.9073486328125e-6 * min(reach, FARTHEST) + of_origin * abs(ray.origin));
    let start = ray.origin * ray.inverse;
    // From 2^100 on, an axis decides nothing.
    let tells = abs(start) < vec3<f32>(1.2676506002282294e30);
    ray.to_near = select(vec3<f32>(-8.507059173023462e37), -start - pad, tells);
    ray.to_far = select(vec3<f32>(8.507059173023462e37), pad - start, tells);
    return ray;
}

// Returns x * 2^-e for the components of a direction. The largest result is in [1, 2); results below 2^-37 are zero.
fn components(direction: vec3<u32>, e: i32) -> vec3<f32> {
    if e > -80 {
        let exponents = vec3<i32>((direction >> vec3<u32>(23u)) & vec3<u32>(255u)) - e;
        // Subnormal components become zero.
        let scaled = bitcast<vec3<f32>>(direction - vec3<u32>(bitcast<u32>(e) << 23u));
        return select(scaled, vec3<f32>(0.0), exponents < vec3<i32>(90));
    }
    return vec3<f32>(component(direction.x, e), component(direction.y, e), component(direction.z, e));
}

fn component(bits: u32, e: i32) -> f32 {
    let x = scale_bits(bits, -e);
    return select(x, 0.0, abs(x) < 7.275957614183426e-12);
}

// Where a ray enters and leaves a box along each axis.
struct Planes { near: vec3<f32>, far: vec3<f32> }

// Enters no later and leaves no earlier than `slab` finds for any box within. Used for nodes, which decide no hit. The driver
// may fuse these operations.
fn loose_planes(ray: Prepared, low: vec3<f32>, high: vec3<f32>) -> Planes {
    // Packets and rasterization never trace at spread moments, and this branch would cost them a tenth of their time.
    @if(!(trace_packets || trace_packets_by_subgroups || resolve))
    if params.spread == 1u { return loose_planes_apart(ray, low, high); }
    let negative = are_negative(ray.inverse);
    let near = select(low, high, negative) * ray.inverse + ray.to_near;
    return Planes(near, select(high, low, negative) * ray.inverse + ray.to_far);
}

// The same for coordinates of very different sizes. Pads by the box's own D, which is at least that of any box within.
fn loose_planes_apart(ray: Prepared, low: vec3<f32>, high: vec3<f32>) -> Planes {
    let negative = are_negative(ray.inverse);
    let to_low = low - ray.origin;
    let to_high = high - ray.origin;
    let away = max(abs(to_low), abs(to_high));
    // 32 * 2^-24
    let pad = 1.9073486328125e-6 * min(most_of(away), FARTHEST) * abs(ray.inverse);
    let near = select(to_low, to_high, negative) * ray.inverse - pad;
    return Planes(near, select(to_high, to_low, negative) * ray.inverse + pad);
}

fn loose_slab(ray: Prepared, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let planes = loose_planes(ray, low, high);
    let n = planes.near;
    let f = planes.far;
    return vec2<f32>(max(n.x, max(n.y, n.z)), min(f.x, min(f.y, f.z)));
}

// Returns whether a ray meets a node's box before `bound`. The corners are the first three words of each row.
fn meets_box(ray: Prepared, low: vec4<u32>, high: vec4<u32>, bound: f32) -> bool {
    let s = loose_slab(ray, bitcast<vec3<f32>>(low.xyz), bitcast<vec3<f32>>(high.xyz));
    return s.x <= s.y && s.x <= bound && s.y >= ray.t_min;
}

// Returns a point relative to the ray's start.
fn from_start(ray: Prepared, p: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(sub(p.x, ray.origin.x), sub(p.y, ray.origin.y), sub(p.z, ray.origin.z));
}

// Returns 1 / d per axis, rounded once.
fn inverse_of(ray: Prepared) -> vec3<f32> {
    let k = permute(ray.direction, ray.axis);
    let x = divide_normal(1.0, divisor(push_from_zero(k.x)));
    let y = divide_normal(1.0, divisor(push_from_zero(k.y)));
    // Along the main axis, which is far from zero, the shear is the reciprocal.
    return unpermute(vec3<f32>(x, y, ray.shear_z), ray.axis);
}

// Returns entry and exit of the padded box, which is met if x <= y. The padding uses the box's own D.
fn slab(ray: Prepared, inverse: vec3<f32>, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let negative = are_negative(inverse);
    let near = from_start(ray, select(low, high, negative));
    let far = from_start(ray, select(high, low, negative));
    // 17 * 2^-24
    let slack = mul(1.01327896118164062e-6, min(most_of(max(abs(near), abs(far))), FARTHEST));
    let pad = vec3<f32>(mul(slack, abs(inverse.x)), mul(slack, abs(inverse.y)), mul(slack, abs(inverse.z)));
    let n = vec3<f32>(
        sub(mul(near.x, inverse.x), pad.x), sub(mul(near.y, inverse.y), pad.y), sub(mul(near.z, inverse.z), pad.z),
    );
    let f = vec3<f32>(
        add(mul(far.x, inverse.x), pad.x), add(mul(far.y, inverse.y), pad.y), add(mul(far.z, inverse.z), pad.z),
    );
    return vec2<f32>(max(n.x, max(n.y, n.z)), min(f.x, min(f.y, f.z)));
}

// Clamps t to the box's span. A NaN is kept; a result below 2^-100 becomes zero.
fn clamped(t: f32, span: vec2<f32>) -> f32 {
    let later = select(t, span.x, t < span.x);
    return flushed(select(later, span.y, later > span.y));
}
