// The filter of intersector `exact`: classifies triangles as hit, missed or undecided, in rounded arithmetic.

import package::geometry::ray::{PreparedRay, relative_to_origin, unpermute};
import package::geometry::record::Corners;
import package::geometry::units::power_of_two;
import package::intersect::sheared::span_of_depths;
import package::lib::ieee::{add, mul};

// A triangle in a ray's sheared coordinates, with error bounds: "The filter" in docs/design/exact-arithmetic.md. The device may
// fuse these operations and divide inexactly.

// 2^-60: bounds the effect of counting small numbers as zero.
const SMALL: f32 = 8.673617379884035e-19;

// The two directions that span the sheared plane, the error of a sheared coordinate per unit of depth, and the largest such error
// in this scene.
struct ShearView { across: vec3<f32>, up: vec3<f32>, errors_per_depth: vec2<f32>, max_errors: vec2<f32> }

var<private> shear_view: ShearView;

fn set_shear_view(ray: PreparedRay) {
    shear_view.across = unpermute(vec3<f32>(1.0, 0.0, -ray.shear_x), ray.axis);
    shear_view.up = unpermute(vec3<f32>(0.0, 1.0, -ray.shear_y), ray.axis);
    // 4.01 * 2^-24 * |shear|, plus 2^-37 for a component of the direction that was below 2^-37 and became zero.
    shear_view.errors_per_depth = 2.3901462554931640625e-7 * abs(vec2<f32>(ray.shear_x, ray.shear_y)) + 7.3e-12;
    // `max_padding` is 17 * 2^-24 * D of the root, and 986896 is at least 2^24 / 17.
    shear_view.max_errors = shear_view.errors_per_depth * (986896.0 * ray.max_padding) + SMALL;
}

// A triangle relative to the ray's start, its largest sheared coordinates, and its edge functions.
struct ShearedTriangle { a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, extent: vec2<f32>, u: f32, v: f32, w: f32 }

fn shear_triangle(ray: PreparedRay, corners: Corners) -> ShearedTriangle {
    let a = relative_to_origin(ray, corners.a);
    let b = relative_to_origin(ray, corners.b);
    let c = relative_to_origin(ray, corners.c);
    let x = vec3<f32>(loose_dot(shear_view.across, a), loose_dot(shear_view.across, b), loose_dot(shear_view.across, c));
    let y = vec3<f32>(loose_dot(shear_view.up, a), loose_dot(shear_view.up, b), loose_dot(shear_view.up, c));
    let extent = vec2<f32>(max(abs(x.x), max(abs(x.y), abs(x.z))), max(abs(y.x), max(abs(y.y), abs(y.z))));
    return ShearedTriangle(
        a, b, c, extent, loose_edge(x.z, y.z, x.y, y.y), loose_edge(x.x, y.x, x.z, y.z), loose_edge(x.y, y.y, x.x, y.x),
    );
}

// One component of `direction` is 1 and another is 0, so there are at most two roundings, fused or not.
fn loose_dot(direction: vec3<f32>, p: vec3<f32>) -> f32 {
    return direction.x * p.x + direction.y * p.y + direction.z * p.z;
}

fn loose_edge(px: f32, py: f32, qx: f32, qy: f32) -> f32 { return px * qy - py * qx; }

// Returns the error bound of an edge function for a shear error of at most `max_errors`.
fn loose_error_bound(extent: vec2<f32>, max_errors: vec2<f32>) -> f32 {
    // 3.01 * 2^-24
    let r = 1.7940998077392578e-7 * extent + max_errors;
    return 2.0 * (r.x * (extent.y + r.y) + r.y * extent.x);
}

fn min_edge(sheared: ShearedTriangle) -> f32 { return min(sheared.u, min(sheared.v, sheared.w)); }
fn max_edge(sheared: ShearedTriangle) -> f32 { return max(sheared.u, max(sheared.v, sheared.w)); }

fn surely_outside(sheared: ShearedTriangle, error_bound: f32) -> bool {
    return min_edge(sheared) < -error_bound && max_edge(sheared) > error_bound;
}

fn surely_inside(sheared: ShearedTriangle, error_bound: f32) -> bool {
    return min_edge(sheared) > error_bound || max_edge(sheared) < -error_bound;
}

// Decisions of the filter: "The filter" in docs/design/exact-arithmetic.md.

// Whether a triangle may be hit, and whether it certainly is. If it is hit, its exact t is in low ..= high.
struct Classified { possible: bool, certain: bool, low: f32, high: f32 }

const MISSED: Classified = Classified(false, false, 0.0, 0.0);

// 2^100: rounded arithmetic does not decide larger determinants and distances.
const DECIDABLE_LIMIT: f32 = 1.2676506002282294e30;

fn classify(ray: PreparedRay, corners: Corners) -> Classified {
    let sheared = shear_triangle(ray, corners);
    if surely_outside(sheared, loose_error_bound(sheared.extent, shear_view.max_errors)) { return MISSED; }
    return classify_closely(ray, corners, sheared);
}

// Returns the distances along the main axis.
fn depths_of(sheared: ShearedTriangle, axis: u32) -> vec3<f32> {
    return select(
        select(vec3<f32>(sheared.a.x, sheared.b.x, sheared.c.x), vec3<f32>(sheared.a.y, sheared.b.y, sheared.c.y), axis == 1u),
        vec3<f32>(sheared.a.z, sheared.b.z, sheared.c.z),
        axis == 2u,
    );
}

// Returns the error bound for the triangle's own depth.
fn tighter_error_bound(sheared: ShearedTriangle, depths: vec3<f32>) -> f32 {
    let deepest = max(abs(depths.x), max(abs(depths.y), abs(depths.z)));
    return loose_error_bound(sheared.extent, shear_view.errors_per_depth * deepest + SMALL);
}

fn classify_closely(ray: PreparedRay, corners: Corners, sheared: ShearedTriangle) -> Classified {
    let depths = depths_of(sheared, ray.axis);
    var error_bound = loose_error_bound(sheared.extent, shear_view.max_errors);
    var certain = surely_inside(sheared, error_bound);
    if !certain {
        error_bound = tighter_error_bound(sheared, depths);
        if surely_outside(sheared, error_bound) { return MISSED; }
        certain = surely_inside(sheared, error_bound);
    }
    // Minima may hide a NaN; the sum does not.
    let det = add(add(sheared.u, sheared.v), sheared.w);
    let magnitude = abs(det);
    // From 2^-62 on, products that underflow are within the bound of t.
    let is_conclusive = magnitude > 8.0 * error_bound && magnitude < DECIDABLE_LIMIT && magnitude > 2.168404344971009e-19;
    var span = vec2<f32>(DECIDABLE_LIMIT, -DECIDABLE_LIMIT);
    if is_conclusive { span = loose_span(sheared, depths * ray.shear_z, det, error_bound); }
    if !(abs(span.x) < DECIDABLE_LIMIT && abs(span.y) < DECIDABLE_LIMIT) {
        certain = certain && magnitude <= 3.4028234663852886e38;
        span = span_of_depths(ray, mul(depths.x, ray.shear_z), mul(depths.y, ray.shear_z), mul(depths.z, ray.shear_z));
    }
    if span.y <= ray.t_min || span.x >= ray.t_max { return MISSED; }
    return Classified(true, certain && rounds_within(ray, span), span.x, span.y);
}

// Returns whether every t of a span, rounded once in the ray's own units, is within the ray's limits. Rounding is
// monotone, and the ends of the span are floats. So if a limit is a normal number, it suffices that both ends are
// within it. Subnormal numbers have fewer digits than scaled ones. So a t_min near zero is raised to 2^-125 in the
// ray's own units, and at least to 2^-99 in scaled units. A t_max near zero is lowered to the negative of this limit.
fn rounds_within(ray: PreparedRay, span: vec2<f32>) -> bool {
    let smallest = power_of_two(max(ray.exponent - 125, -99));
    let largest = power_of_two(ray.exponent + 127);
    let after = max(select(ray.t_min, smallest, abs(ray.t_min) < smallest), -largest);
    let before = min(select(ray.t_max, -smallest, abs(ray.t_max) < smallest), largest);
    return span.x > after && span.y < before;
}

// Returns the interval of the exact t, from the rounded one.
fn loose_span(sheared: ShearedTriangle, z: vec3<f32>, det: f32, error_bound: f32) -> vec2<f32> {
    let inverse = 1.0 / det;
    let t = (sheared.u * z.x + sheared.v * z.y + sheared.w * z.z) * inverse;
    let spread = max(z.x, max(z.y, z.z)) - min(z.x, min(z.y, z.z));
    let magnitude = max(abs(z.x), max(abs(z.y), abs(z.z)));
    // 24 * 2^-24
    let error = 3.02 * error_bound * spread * abs(inverse) + (1.430511474609375e-6 * magnitude + SMALL);
    return vec2<f32>(t - error, t + error);
}
