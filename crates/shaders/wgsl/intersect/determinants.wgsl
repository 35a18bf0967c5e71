// Ray-triangle intersection by four determinants of 192 bits in registers.

import package::geometry::triangle::points_of;
import package::intersect::candidates::{NO_NOTE, note_at};
import package::intersect::line::{Crossing, is_within, line, units_of};
import package::lib::buffers::{counts, occluded, records};
import package::lib::fixed::{
    Approximation, Int192, Int64x3, add_192, approximate_192, approximate_quotient, in_units, negate_192,
    round_quotient_192, sign_192, sub_64, triple_product_192,
};
import package::lib::integers::{INTERSECTIONS_OFFSET, words};

// Whether the triangle is hit, whether it needs longer integers, and t: approximate, and rounded once, as bits.
struct Decided { met: u32, hard: u32, leaf: u32, exponent: i32, about: Approximation, t: u32 }

struct Fixed { fits: bool, unit: i32, a: Int64x3, b: Int64x3, c: Int64x3 }

// Returns a coordinate relative to the ray's start.
fn fixed_from(x: u32, origin: u32, unit: i32) -> vec2<u32> {
    return sub_64(in_units(x, unit), in_units(origin, unit - line.shift));
}

fn fixed_point(p: vec3<u32>, unit: i32) -> Int64x3 {
    let o = line.origin;
    return Int64x3(fixed_from(p.x, o.x, unit), fixed_from(p.y, o.y, unit), fixed_from(p.z, o.z, unit));
}

// Returns the corners relative to the ray's start. Requires that they and the direction have at most 60 bits and that t_min is
// not negative; else `fits` is false.
fn fixed(points: array<vec3<u32>, 3>) -> Fixed {
    let units = units_of(points);
    if units.y - units.x + 25 > 60 || line.bits > 60 || line.t_min > 0x80000000u { return Fixed(); }
    return Fixed(true, units.x, fixed_point(points[0], units.x), fixed_point(points[1], units.x), fixed_point(points[2], units.x));
}

fn fixed_direction() -> Int64x3 {
    let d = line.direction;
    return Int64x3(in_units(d.x, line.unit), in_units(d.y, line.unit), in_units(d.z, line.unit));
}

// Returns d . (c x b), d . (a x c), d . (b x a) or a . (c x b).
fn determinant(f: Fixed, side: u32) -> Int192 {
    var x = fixed_direction();
    var p = f.c;
    var q = f.b;
    if side == 1u { p = f.a; q = f.c; }
    if side == 2u { p = f.b; q = f.a; }
    if side == 3u { x = f.a; }
    return triple_product_192(x, p, q);
}

struct Four { u: Int192, v: Int192, w: Int192, n: Int192 }
struct Concluded { made: Decided, d: Int192, n: Int192 }

// Derives the denominator D, the numerator N and the decision from the four determinants.
fn conclude(given: Decided, f: Four) -> Concluded {
    var c = Concluded(given, f.u, f.n);
    let signs = vec3<i32>(sign_192(f.u), sign_192(f.v), sign_192(f.w));
    let negative = any(signs < vec3<i32>(0));
    if negative && any(signs > vec3<i32>(0)) { return c; }
    c.d = add_192(add_192(f.u, f.v), f.w);
    if negative {
        c.d = negate_192(c.d);
        c.n = negate_192(c.n);
    }
    // The ray is in the triangle's plane, or the triangle is behind its start.
    if all(signs == vec3<i32>(0)) || sign_192(c.n) <= 0 { return c; }
    c.made.about = approximate_quotient(approximate_192(c.n), approximate_192(c.d), c.made.exponent);
    c.made.t = round_quotient_192(c.n, c.d, c.made.exponent);
    c.made.met = select(0u, 1u, is_within(c.made.t));
    return c;
}

// Returns where a crossing's numbers are stored, in one of two slots.
fn crossing_in(slot: u32, exponent: i32) -> Crossing {
    return Crossing(true, INTERSECTIONS_OFFSET + 56u * slot, INTERSECTIONS_OFFSET + 56u * slot + 28u, LIMBS, exponent);
}

// Number of limbs of 192 bits.
const LIMBS: u32 = 6u;

// Stores a non-negative number in the format of lib/integers.wgsl.
fn put_192(at: u32, n: Int192) {
    words[at] = 0u;
    words[at + 1u] = n.low.x;
    words[at + 2u] = n.low.y;
    words[at + 3u] = n.low.z;
    words[at + 4u] = n.high.x;
    words[at + 5u] = n.high.y;
    words[at + 6u] = n.high.z;
}

// Resolving candidate notes. A workgroup of 64 takes four rays at a time and four notes of each. Four invocations share a note:
// one for each of the determinants U, V, W and N.

const RAYS: u32 = 4u;

// Holds one determinant per invocation at first, then D, V, W and N of each note. The ray hits the triangle at t = N / D *
// 2^exponent. V and W may have either sign.
var<workgroup> determinants: array<Int192, 64>;
var<workgroup> decided: array<Decided, 16>;
// Number of open rays of this submission, and whether a ray of this round has more notes.
var<workgroup> open_rays: u32;
var<workgroup> has_more: u32;

// Returns the number of open rays, the same for all invocations of a workgroup.
fn begin_rounds(local: u32, word: u32) -> u32 {
    if local == 0u { open_rays = atomicLoad(&counts[word]); }
    return workgroupUniformLoad(&open_rays);
}

// Returns the note `places` after the first of a list.
fn note_after(list: u32, places: u32) -> u32 {
    var note = list;
    for (var i = 0u; i < places && note != NO_NOTE; i += 1u) { note = occluded[note_at(note) + 1u]; }
    return note;
}

// Decides up to four notes of each ray, from `list` on, and stores the results in `decided`. The ray's line must be set. All
// invocations of the workgroup must call it.
fn decide_notes(list: u32, local: u32) {
    let note = note_after(list, (local / 4u) % 4u);
    var made = Decided();
    var f = Fixed();
    if note != NO_NOTE {
        made.leaf = occluded[note_at(note)];
        let triangle = records[3u * made.leaf].w;
        f = fixed(points_of(triangle));
        if f.fits { determinants[local] = determinant(f, local & 3u); }
        made.hard = select(1u, 0u, f.fits);
        made.exponent = f.unit - line.shift - line.unit;
    }
    workgroupBarrier();
    if (local & 3u) == 0u {
        if f.fits {
            let all = Four(determinants[local], determinants[local + 1u], determinants[local + 2u], determinants[local + 3u]);
            let c = conclude(made, all);
            made = c.made;
            determinants[local] = c.d;
            determinants[local + 3u] = c.n;
        }
        decided[local / 4u] = made;
    }
    workgroupBarrier();
}

// The rest of a list, and whether all lists of the workgroup are finished.
struct Rest { list: u32, all_done: bool }

// Returns the notes after the next four. All invocations of the workgroup must call it.
fn rest_of(list: u32, local: u32) -> Rest {
    if local == 0u { has_more = 0u; }
    workgroupBarrier();
    let next = note_after(list, 4u);
    if next != NO_NOTE { has_more = 1u; }
    workgroupBarrier();
    return Rest(next, workgroupUniformLoad(&has_more) == 0u);
}

// Computes the four determinants of one triangle in a single invocation.
fn decide_alone(leaf: u32, points: array<vec3<u32>, 3>) -> Concluded {
    let f = fixed(points);
    var made = Decided();
    made.leaf = leaf;
    made.hard = select(1u, 0u, f.fits);
    made.exponent = f.unit - line.shift - line.unit;
    var all = Four();
    if !f.fits { return Concluded(made, all.u, all.n); }
    for (var side = 0u; side < 4u; side += 1u) {
        let n = determinant(f, side);
        if side == 0u { all.u = n; }
        if side == 1u { all.v = n; }
        if side == 2u { all.w = n; }
        if side == 3u { all.n = n; }
    }
    return conclude(made, all);
}
