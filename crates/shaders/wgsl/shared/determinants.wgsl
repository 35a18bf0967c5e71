// Whether and where a ray meets a triangle, by four determinants in registers: what one invocation does for itself.

// Whether the triangle is met, or takes longer numbers to know; about t.
struct Decided { met: u32, hard: u32, leaf: u32, exponent: i32, about: About }

struct Fixed { fits: bool, unit: i32, a: Vector64, b: Vector64, c: Vector64 }

// A coordinate from the ray's start.
fn fixed_from(x: u32, origin: u32, unit: i32) -> vec2<u32> {
    return sub_64(in_units(x, unit), in_units(origin, unit - line.shift));
}

fn fixed_point(p: vec3<u32>, unit: i32) -> Vector64 {
    let o = line.origin;
    return Vector64(fixed_from(p.x, o.x, unit), fixed_from(p.y, o.y, unit), fixed_from(p.z, o.z, unit));
}

// Corners from the ray's start, if they and the direction have 62 bits at most, and the ray does not begin before it.
fn fixed(points: array<vec3<u32>, 3>) -> Fixed {
    let units = units_of(points);
    if units.y - units.x + 25 > 62 || line.bits > 62 || line.t_min > 0x80000000u { return Fixed(); }
    return Fixed(true, units.x, fixed_point(points[0], units.x), fixed_point(points[1], units.x), fixed_point(points[2], units.x));
}

fn fixed_direction() -> Vector64 {
    let d = line.direction;
    return Vector64(in_units(d.x, line.unit), in_units(d.y, line.unit), in_units(d.z, line.unit));
}

// d . (c x b), d . (a x c), d . (b x a) and a . (c x b).
fn determinant(f: Fixed, side: u32) -> Whole192 {
    var x = fixed_direction();
    var p = f.c;
    var q = f.b;
    if side == 1u { p = f.a; q = f.c; }
    if side == 2u { p = f.b; q = f.a; }
    if side == 3u { x = f.a; }
    return triple_192(x, p, q);
}

struct Four { u: Whole192, v: Whole192, w: Whole192, n: Whole192 }
struct Concluded { made: Decided, d: Whole192, n: Whole192 }

// D, N and what they say, from the four determinants.
fn conclude(given: Decided, f: Four) -> Concluded {
    var c = Concluded(given, f.u, f.n);
    let signs = vec3<i32>(sign_192(f.u), sign_192(f.v), sign_192(f.w));
    let negative = any(signs < vec3<i32>(0));
    if negative && any(signs > vec3<i32>(0)) { return c; }
    c.d = add_192(add_192(f.u, f.v), f.w);
    if negative {
        c.d = negated_192(c.d);
        c.n = negated_192(c.n);
    }
    // In the triangle's plane, or behind the start.
    if all(signs == vec3<i32>(0)) || sign_192(c.n) <= 0 { return c; }
    c.made.about = quotient_about(about_192(c.n), about_192(c.d), c.made.exponent);
    let since = select(order_of_limit(c.made.about, line.t_min), 1, (line.t_min << 1u) == 0u);
    let until = order_of_limit(c.made.about, line.t_max);
    c.made.met = select(0u, 1u, since > 0 && until < 0);
    c.made.hard = select(0u, 1u, since >= 0 && until <= 0 && (since == 0 || until == 0));
    return c;
}

// Where a crossing's numbers lie, in one of two places.
fn crossing_in(slot: u32, exponent: i32) -> Crossing {
    return Crossing(true, CROSSINGS + 56u * slot, CROSSINGS + 56u * slot + 28u, LIMBS, exponent);
}

// As many limbs as six words have.
const LIMBS: u32 = 6u;

// Puts a number that is not negative where those of any length lie.
fn put_192(at: u32, n: Whole192) {
    words[at] = 0u;
    words[at + 1u] = n.low.x;
    words[at + 2u] = n.low.y;
    words[at + 3u] = n.low.z;
    words[at + 4u] = n.high.x;
    words[at + 5u] = n.high.y;
    words[at + 6u] = n.high.z;
}

// -1 before a limit, which is not negative, 1 beyond it, 0 if near.
fn order_of_limit(about: About, bits: u32) -> i32 {
    if bits == 0x7f800000u { return -1; }
    // Subnormal limits are rare.
    if (bits >> 23u) - 1u >= 254u { return 0; }
    let limit = About(bitcast<f32>((bits & 0x7fffffu) | 0x3f800000u), i32(bits >> 23u) - 127);
    return compare_about(about, limit);
}
