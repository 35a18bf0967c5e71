// Whether a ray meets a triangle, by whole numbers in registers where they fit, and of any length where not.

struct Fixed { fits: bool, unit: i32, a: Vector64, b: Vector64, c: Vector64 }

fn fixed_point(p: vec3<u32>, unit: i32) -> Vector64 {
    let o = unit - line.shift;
    return Vector64(
        sub_64(in_units(p.x, unit), in_units(line.origin.x, o)),
        sub_64(in_units(p.y, unit), in_units(line.origin.y, o)),
        sub_64(in_units(p.z, unit), in_units(line.origin.z, o)),
    );
}

// Corners from the ray's start, if they and the direction have 62 bits at most.
fn fixed(points: array<vec3<u32>, 3>) -> Fixed {
    let units = units_of(points);
    if units.y - units.x + 25 > 62 || line.bits > 62 { return Fixed(); }
    return Fixed(true, units.x, fixed_point(points[0], units.x), fixed_point(points[1], units.x), fixed_point(points[2], units.x));
}

fn fixed_direction() -> Vector64 {
    let d = line.direction;
    return Vector64(in_units(d.x, line.unit), in_units(d.y, line.unit), in_units(d.z, line.unit));
}

// The determinant whose sign says on which side of an edge the line passes: c x b, a x c, b x a.
fn side(f: Fixed, x: Vector64, edge: u32) -> Whole192 {
    var p = f.c;
    var q = f.b;
    if edge == 1u { p = f.a; q = f.c; }
    if edge == 2u { p = f.b; q = f.a; }
    return triple_192(x, p, q);
}

// Whether the line passes within a triangle: signs that rounding leaves open are taken exactly. Distances are not asked for.
fn passes_within(ray: Prepared, f: Fixed, s: Seen, doubt: f32) -> bool {
    let d = fixed_direction();
    let values = vec3<f32>(s.u, s.v, s.w);
    var positive = false;
    var negative = false;
    for (var i = 0u; i < 3u; i += 1u) {
        var sign = 0;
        if abs(values[i]) > doubt {
            sign = select(-1, 1, (values[i] > 0.0) == (ray.shear_z > 0.0));
        } else {
            sign = sign_192(side(f, d, i));
        }
        positive = positive || sign > 0;
        negative = negative || sign < 0;
    }
    return positive != negative;
}

// Puts a number where those of any length lie.
fn put_192(at: u32, given: Whole192) {
    let negative = sign_192(given) < 0;
    words[at] = select(0u, 1u, negative);
    var n = given;
    if negative { n = negated_192(given); }
    for (var i = 0u; i < 3u; i += 1u) {
        words[at + 1u + i] = n.low[i];
        words[at + 4u + i] = n.high[i];
    }
}

// The crossing of the line with a closed triangle within the ray's limits, kept in place `slot` of two.
fn cross_exactly(points: array<vec3<u32>, 3>, slot: u32) -> Crossing {
    let f = fixed(points);
    if !f.fits { return meet_exactly(points, slot); }
    let made = Crossing(true, CROSSINGS + 56u * slot, CROSSINGS + 56u * slot + 28u, 6u, f.unit - line.shift - line.unit);
    if !cross_fixed(f, made) || !is_within(made) { return NOT_MET; }
    return made;
}

fn cross_fixed(f: Fixed, made: Crossing) -> bool {
    let d = fixed_direction();
    var positive = false;
    var negative = false;
    var sum = Whole192();
    for (var i = 0u; i < 4u; i += 1u) {
        var x = d;
        if i == 3u { x = f.a; }
        let n = side(f, x, i);
        if i == 3u {
            put_192(made.numerator, n);
            break;
        }
        let sign = sign_192(n);
        positive = positive || sign > 0;
        negative = negative || sign < 0;
        if positive && negative { return false; }
        sum = add_192(sum, n);
    }
    put_192(made.denominator, sum);
    words[made.numerator] ^= words[made.denominator];
    words[made.denominator] = 0u;
    return positive || negative;
}

// What whole numbers say of a triangle that may be hit; the crossing was made only where its place matters.
struct Decided { met: bool, crossing: Crossing }

fn decide(ray: Prepared, corners: Corners, j: Judged, slot: u32) -> Decided {
    let points = points_of(corners.triangle);
    if j.low > ray.t_min && j.high < ray.t_max {
        let f = fixed(points);
        if f.fits {
            let s = look(ray, corners);
            return Decided(passes_within(ray, f, s, closer_doubt(s, depths_of(s, ray.axis))), NOT_MET);
        }
    }
    let c = cross_exactly(points, slot);
    return Decided(c.met, c);
}
