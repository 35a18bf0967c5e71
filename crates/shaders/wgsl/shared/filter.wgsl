// What rounded arithmetic says of a triangle, and what it leaves open: "Filter" and "Span" of `exact` in ARCHITECTURE.md.

// Rays from beyond 2^80 scaled units are asked too, in whole numbers alone.
const TAKES_FAR: bool = true;

// A triangle that is not surely missed; its exact t, if it is hit, lies in low ..= high.
struct Judged { possible: bool, sure: bool, low: f32, high: f32 }

// Of f32's unit, 2^-24: 9.5 for a sheared coordinate, 32 for a depth.
const SHEAR_ERROR: f32 = 5.662441253662109e-7;
const DEPTH_ERROR: f32 = 1.9073486328125e-6;
// 2^-60 and 2^-100: what counting small numbers as zero may change.
const SMALL: f32 = 8.673617379884035e-19;
const LEAST: f32 = 7.888609052210118e-31;

// The triangle where the ray is the axis, and its edge functions.
struct Seen { a: Sheared, b: Sheared, c: Sheared, u: f32, v: f32, w: f32 }

fn look(ray: Prepared, corners: Corners) -> Seen {
    let a = shear(ray, corners.a);
    let b = shear(ray, corners.b);
    let c = shear(ray, corners.c);
    return Seen(a, b, c, edge(c, b), edge(a, c), edge(b, a));
}

fn judge(ray: Prepared, corners: Corners) -> Judged {
    let s = look(ray, corners);
    let wide_x = max(abs(s.a.x), max(abs(s.b.x), abs(s.c.x)));
    let wide_y = max(abs(s.a.y), max(abs(s.b.y), abs(s.c.y)));
    let wide = max(wide_x, wide_y);
    let along = max(abs(s.a.along), max(abs(s.b.along), abs(s.c.along)));
    let slack = add(mul(SHEAR_ERROR, add(wide, mul(2.0, along))), SMALL);
    let doubt = mul(slack, add(mul(4.0, wide), mul(2.0, slack)));
    let least = min(s.u, min(s.v, s.w));
    let most = max(s.u, max(s.v, s.w));
    if least < -doubt && most > doubt { return Judged(false, false, 0.0, 0.0); }
    let own = own_span(ray, corners);
    var span = vec2<f32>(max(own.x, ray.t_min), own.y);
    // The tree's boxes are met more often than the triangle's own.
    if !(own.x <= own.y && span.x <= span.y && span.x <= ray.t_max) { return Judged(false, false, 0.0, 0.0); }
    let finite = max(most, -least) <= 3.4028234663852886e38;
    let certain = (least > doubt || most < -doubt) && finite;
    if certain { span = narrowed(s, doubt, span); }
    return Judged(true, certain && span.x > ray.t_min && span.y < ray.t_max, span.x, span.y);
}

// The part of the box's span that is near the rounded t of a triangle that is surely hit.
fn narrowed(s: Seen, doubt: f32, span: vec2<f32>) -> vec2<f32> {
    let least_det = sub(abs(add(add(s.u, s.v), s.w)), mul(4.0, doubt));
    if !(least_det > mul(4.0, doubt)) { return span; }
    let depths = vec3<f32>(s.a.z, s.b.z, s.c.z);
    let spread = sub(max(depths.x, max(depths.y, depths.z)), min(depths.x, min(depths.y, depths.z)));
    let size = max(abs(depths.x), max(abs(depths.y), abs(depths.z)));
    let of_weights = divide(mul(3.0, add(mul(doubt, spread), mul(LEAST, add(1.0, size)))), least_det);
    let error = add(add(of_weights, mul(DEPTH_ERROR, size)), SMALL);
    let c = solved(s);
    let t = divide(c.t, c.det);
    let low = sub(t, error);
    let high = add(t, error);
    let near = vec2<f32>(select(span.x, low, low > span.x), select(span.y, high, high < span.y));
    return select(span, near, near.x <= near.y);
}

fn solved(s: Seen) -> Candidate {
    return solve(flushed(s.u), flushed(s.v), flushed(s.w), s.a.z, s.b.z, s.c.z);
}

// What is written for a triangle that is hit: t as the watertight test has it, clamped to the box and t_min, weights to [0, 1].
fn reported(ray: Prepared, corners: Corners) -> vec4<u32> {
    let c = solved(look(ray, corners));
    let own = own_span(ray, corners);
    let entry = max(own.x, ray.t_min);
    let t = divide(c.t, c.det);
    let later = select(entry, t, t > entry);
    let clamped = flushed(select(own.y, later, later < own.y));
    let by = divisor(c.det);
    return vec4<u32>(in_ray_units(clamped, ray.exponent), weight(divide_by(c.v, by)), weight(divide_by(c.w, by)), corners.triangle);
}

// A weight within [0, 1], 0 for what is not a number; by bits, since it may be subnormal.
fn weight(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return select(min(bits, 0x3f800000u), 0u, bits > 0x7f800000u);
}
