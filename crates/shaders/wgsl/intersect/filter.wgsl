// The filter of intersector `exact`, in rounded arithmetic.

import package::geometry::ray::{PreparedRay, relative_to_origin, unpermute};
import package::geometry::record::Corners;
import package::geometry::units::power_of_two;
import package::intersect::sheared::span_of_depths;
import package::lib::ieee::{add, mul};

// A triangle as seen along a ray, in the device's own arithmetic, with error bounds: "The filter" in
// docs/design/exact-arithmetic.md.

// 2^-60: bounds the effect of counting small numbers as zero.
const SMALL: f32 = 8.673617379884035e-19;

// The two directions that span the sheared plane, the error of a sheared coordinate per unit of depth, and the largest such error
// in this scene.
struct View { across: vec3<f32>, up: vec3<f32>, doubts: vec2<f32>, most: vec2<f32> }

var<private> view: View;

fn set_view(ray: PreparedRay) {
    view.across = unpermute(vec3<f32>(1.0, 0.0, -ray.shear_x), ray.axis);
    view.up = unpermute(vec3<f32>(0.0, 1.0, -ray.shear_y), ray.axis);
    // 4.01 * 2^-24 of the sheared part, and 2^-37, below which a component of the direction became zero.
    view.doubts = 2.3901462554931640625e-7 * abs(vec2<f32>(ray.shear_x, ray.shear_y)) + 7.3e-12;
    // The slack is 17 * 2^-24 * D of the root.
    view.most = view.doubts * (986896.0 * ray.max_padding) + SMALL;
}

// A triangle relative to the ray's start, its largest sheared coordinates, and its edge functions.
struct Seen { a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, wide: vec2<f32>, u: f32, v: f32, w: f32 }

fn look(ray: PreparedRay, k: Corners) -> Seen {
    let a = relative_to_origin(ray, k.a);
    let b = relative_to_origin(ray, k.b);
    let c = relative_to_origin(ray, k.c);
    let x = vec3<f32>(loose_along(view.across, a), loose_along(view.across, b), loose_along(view.across, c));
    let y = vec3<f32>(loose_along(view.up, a), loose_along(view.up, b), loose_along(view.up, c));
    let wide = vec2<f32>(max(abs(x.x), max(abs(x.y), abs(x.z))), max(abs(y.x), max(abs(y.y), abs(y.z))));
    return Seen(a, b, c, wide, loose_edge(x.z, y.z, x.y, y.y), loose_edge(x.x, y.x, x.z, y.z), loose_edge(x.y, y.y, x.x, y.x));
}

// One component of `direction` is 1 and another is 0, so there are at most two roundings, fused or not.
fn loose_along(direction: vec3<f32>, p: vec3<f32>) -> f32 {
    return direction.x * p.x + direction.y * p.y + direction.z * p.z;
}

fn loose_edge(px: f32, py: f32, qx: f32, qy: f32) -> f32 { return px * qy - py * qx; }

// Returns the error bound of an edge function for a shear error of at most `most`.
fn loose_doubt(wide: vec2<f32>, most: vec2<f32>) -> f32 {
    // 3.01 * 2^-24
    let r = 1.7940998077392578e-7 * wide + most;
    return 2.0 * (r.x * (wide.y + r.y) + r.y * wide.x);
}

fn least_edge(s: Seen) -> f32 { return min(s.u, min(s.v, s.w)); }
fn most_edge(s: Seen) -> f32 { return max(s.u, max(s.v, s.w)); }

fn surely_out(s: Seen, doubt: f32) -> bool { return least_edge(s) < -doubt && most_edge(s) > doubt; }
fn surely_in(s: Seen, doubt: f32) -> bool { return least_edge(s) > doubt || most_edge(s) < -doubt; }

// Decisions of the filter: "The filter" in docs/design/exact-arithmetic.md.

// Whether a triangle may be hit, and whether it surely is. If it is hit, its exact t is in low ..= high.
struct Judged { possible: bool, sure: bool, low: f32, high: f32 }

const OUT: Judged = Judged(false, false, 0.0, 0.0);

// 2^100: rounded arithmetic does not decide larger determinants and distances.
const DEEP: f32 = 1.2676506002282294e30;

fn judge(ray: PreparedRay, corners: Corners) -> Judged {
    let s = look(ray, corners);
    if surely_out(s, loose_doubt(s.wide, view.most)) { return OUT; }
    return judge_near(ray, corners, s);
}

// Returns the distances along the main axis.
fn depths_of(s: Seen, axis: u32) -> vec3<f32> {
    return select(select(vec3<f32>(s.a.x, s.b.x, s.c.x), vec3<f32>(s.a.y, s.b.y, s.c.y), axis == 1u), vec3<f32>(s.a.z, s.b.z, s.c.z), axis == 2u);
}

// Returns the error bound for the triangle's own depth.
fn closer_doubt(s: Seen, depths: vec3<f32>) -> f32 {
    let deepest = max(abs(depths.x), max(abs(depths.y), abs(depths.z)));
    return loose_doubt(s.wide, view.doubts * deepest + SMALL);
}

fn judge_near(ray: PreparedRay, corners: Corners, s: Seen) -> Judged {
    let depths = depths_of(s, ray.axis);
    var doubt = loose_doubt(s.wide, view.most);
    var certain = surely_in(s, doubt);
    if !certain {
        doubt = closer_doubt(s, depths);
        if surely_out(s, doubt) { return OUT; }
        certain = surely_in(s, doubt);
    }
    // Minima may hide a NaN; the sum does not.
    let det = add(add(s.u, s.v), s.w);
    let size = abs(det);
    let tells = size > 8.0 * doubt && size < DEEP && size > 7.888609052210118e-31;
    var span = vec2<f32>(DEEP, -DEEP);
    if tells { span = loose_span(s, depths * ray.shear_z, det, doubt); }
    if !(abs(span.x) < DEEP && abs(span.y) < DEEP) {
        certain = certain && size <= 3.4028234663852886e38;
        span = span_of_depths(ray, mul(depths.x, ray.shear_z), mul(depths.y, ray.shear_z), mul(depths.z, ray.shear_z));
    }
    if span.y <= ray.t_min || span.x >= ray.t_max { return OUT; }
    return Judged(true, certain && rounds_within(ray, span), span.x, span.y);
}

// Returns whether every t of a span, rounded once in the ray's own units, is within the ray's limits. A float beyond t_min is at
// least the next float, and rounding is monotone, so the limits themselves serve where t is normal. Subnormal numbers have fewer
// digits than scaled ones, so distances below 2^-125 or beyond 2^127 stay open.
fn rounds_within(ray: PreparedRay, span: vec2<f32>) -> bool {
    let small = power_of_two(max(ray.exponent - 125, -99));
    let large = power_of_two(ray.exponent + 127);
    let after = max(select(ray.t_min, small, abs(ray.t_min) < small), -large);
    let before = min(select(ray.t_max, -small, abs(ray.t_max) < small), large);
    return span.x > after && span.y < before;
}

// Returns the interval of the exact t, from the rounded one.
fn loose_span(s: Seen, z: vec3<f32>, det: f32, doubt: f32) -> vec2<f32> {
    let inverse = 1.0 / det;
    let t = (s.u * z.x + s.v * z.y + s.w * z.z) * inverse;
    let spread = max(z.x, max(z.y, z.z)) - min(z.x, min(z.y, z.z));
    let size = max(abs(z.x), max(abs(z.y), abs(z.z)));
    // 24 * 2^-24
    let error = 3.02 * doubt * spread * abs(inverse) + (1.430511474609375e-6 * size + SMALL);
    return vec2<f32>(t - error, t + error);
}
