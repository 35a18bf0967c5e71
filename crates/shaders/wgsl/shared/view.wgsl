// A triangle seen along a ray, in the device's own arithmetic, and how far that may be off: "On GPUs" of `exact` in ARCHITECTURE.md.

// 2^-60: what counting small numbers as zero may change.
const SMALL: f32 = 8.673617379884035e-19;

// The two directions that a triangle is seen along, the error of a sheared coordinate
// a unit of depth, and the most it can be in this scene.
struct View { across: vec3<f32>, up: vec3<f32>, doubts: vec2<f32>, most: vec2<f32> }

var<private> view: View;

fn set_view(ray: Prepared) {
    view.across = unpermute(vec3<f32>(1.0, 0.0, -ray.shear_x), ray.axis);
    view.up = unpermute(vec3<f32>(0.0, 1.0, -ray.shear_y), ray.axis);
    // 4.01 * 2^-24 of what the shear takes away, and 2^-37, below which a direction's component was zero.
    view.doubts = 2.3901462554931640625e-7 * abs(vec2<f32>(ray.shear_x, ray.shear_y)) + 7.3e-12;
    // The slack is 17 * 2^-24 * D.
    view.most = view.doubts * (986896.0 * ray.slack) + SMALL;
}

// A triangle from the ray's start, its greatest sheared coordinates, and its edge functions.
struct Seen { a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, wide: vec2<f32>, u: f32, v: f32, w: f32 }

fn from_start(ray: Prepared, p: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(sub(p.x, ray.origin.x), sub(p.y, ray.origin.y), sub(p.z, ray.origin.z));
}

fn look(ray: Prepared, k: Corners) -> Seen {
    let a = from_start(ray, k.a);
    let b = from_start(ray, k.b);
    let c = from_start(ray, k.c);
    let x = vec3<f32>(loose_along(view.across, a), loose_along(view.across, b), loose_along(view.across, c));
    let y = vec3<f32>(loose_along(view.up, a), loose_along(view.up, b), loose_along(view.up, c));
    let wide = vec2<f32>(max(abs(x.x), max(abs(x.y), abs(x.z))), max(abs(y.x), max(abs(y.y), abs(y.z))));
    return Seen(a, b, c, wide, loose_edge(x.z, y.z, x.y, y.y), loose_edge(x.x, y.x, x.z, y.z), loose_edge(x.y, y.y, x.x, y.x));
}

// One factor is 1, another 0, so two roundings at most, fused or not.
fn loose_along(direction: vec3<f32>, p: vec3<f32>) -> f32 {
    return direction.x * p.x + direction.y * p.y + direction.z * p.z;
}

fn loose_edge(px: f32, py: f32, qx: f32, qy: f32) -> f32 { return px * qy - py * qx; }

// How far an edge function may be off, where the shear may be by `most`.
fn loose_doubt(wide: vec2<f32>, most: vec2<f32>) -> f32 {
    // 3.01 * 2^-24
    let r = 1.7940998077392578e-7 * wide + most;
    return 2.0 * (r.x * (wide.y + r.y) + r.y * wide.x);
}

fn least_edge(s: Seen) -> f32 { return min(s.u, min(s.v, s.w)); }
fn most_edge(s: Seen) -> f32 { return max(s.u, max(s.v, s.w)); }

fn surely_out(s: Seen, doubt: f32) -> bool { return least_edge(s) < -doubt && most_edge(s) > doubt; }
fn surely_in(s: Seen, doubt: f32) -> bool { return least_edge(s) > doubt || most_edge(s) < -doubt; }
