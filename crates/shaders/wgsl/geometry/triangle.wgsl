// A triangle's corners in scene units, and the test for zero area.

import package::lib::buffers::{positions, triangles};
import package::lib::double_float::sub_each;
import package::lib::ieee::{add, mul, sub};
import package::lib::integers::mantissa_of;

// Returns a vertex's position in scene units, as bits.
fn point_of(vertex: u32) -> vec3<u32> {
    return vec3<u32>(positions[3u * vertex], positions[3u * vertex + 1u], positions[3u * vertex + 2u]);
}

// Returns one corner of a triangle in scene units, as bits.
fn corner(triangle: u32, vertex: u32) -> vec3<u32> { return point_of(triangles[3u * triangle + vertex]); }

// Returns a triangle's corners in scene units, as bits.
fn points_of(triangle: u32) -> array<vec3<u32>, 3> {
    return array<vec3<u32>, 3>(
        point_of(triangles[3u * triangle]),
        point_of(triangles[3u * triangle + 1u]),
        point_of(triangles[3u * triangle + 2u]),
    );
}

// Tests whether a triangle's corners span an area.

// Returns whether scaling turned a non-zero coordinate into zero.
fn snaps_coordinate(before: vec3<u32>, after: vec3<f32>) -> bool {
    let was_zero = (before & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u);
    return any((after == vec3<f32>(0.0)) != was_zero);
}

// Returns whether a rounded test shows that three finite corners span an area, as it does for most triangles. The corners are
// passed in scene units and in scaled units.
fn surely_has_area(
    scene_a: vec3<u32>, scene_b: vec3<u32>, scene_c: vec3<u32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>,
) -> bool {
    let is_snapped = snaps_coordinate(scene_a, a) || snaps_coordinate(scene_b, b) || snaps_coordinate(scene_c, c);
    return !is_snapped && has_area_when_rounded(a, b, c);
}

// The exact test for zero area. In units of 2^-149 every coordinate is an integer below 2^277, and a component of the cross
// product is below 2^557. It is zero if it is zero modulo 36 primes, whose product exceeds 2^575. The test is rare and may be
// slow. It uses no long integers, since these would take registers from the kernels that call it.

const PRIMES: u32 = 36u;
const LARGEST_PRIME: u32 = 65521u;

// Half the gap between each prime and the next smaller one, four bits each.
fn half_gaps(word: u32) -> u32 {
    switch word {
        case 0u: { return 0x2751f9b1u; }
        case 1u: { return 0xd2756733u; }
        case 2u: { return 0x95193872u; }
        case 3u: { return 0xa2132a5du; }
        default: { return 0x00000363u; }
    }
}

// Returns a coordinate modulo a prime.
fn residue(bits: u32, prime: u32) -> u32 {
    let exponent = (bits >> 23u) & 255u;
    var value = mantissa_of(bits) % prime;
    var power = 2u;
    for (var shift = max(exponent, 1u) - 1u; shift > 0u; shift >>= 1u) {
        if (shift & 1u) != 0u { value = (value * power) % prime; }
        power = (power * power) % prime;
    }
    return select(value, (prime - value) % prime, (bits >> 31u) == 1u);
}

fn residues(v: vec3<u32>, prime: u32) -> vec3<u32> {
    return vec3<u32>(residue(v.x, prime), residue(v.y, prime), residue(v.z, prime));
}

// Returns whether the cross product of two edges is zero modulo a prime.
fn cross_product_vanishes(a: vec3<u32>, b: vec3<u32>, c: vec3<u32>, prime: u32) -> bool {
    let p = vec3<u32>(prime);
    let residue_a = residues(a, prime);
    let e = (residues(b, prime) + (p - residue_a)) % p;
    let f = (residues(c, prime) + (p - residue_a)) % p;
    return all((e.yzx * f.zxy) % p == (e.zxy * f.yzx) % p);
}

// Returns whether a component of the cross product exceeds underflow and its rounding error. The error of two
// differences, a product and the final difference is at most 8 * 2^-23 of the magnitude.
fn exceeds_rounding_error(ei: f32, ej: f32, fi: f32, fj: f32) -> bool {
    let p = mul(ei, fj);
    let q = mul(ej, fi);
    let magnitude = add(abs(p), abs(q));
    return magnitude > 1e-30 && abs(sub(p, q)) > 9.5367431640625e-7 * magnitude;
}

// Returns whether rounded arithmetic shows an area. Coordinates are zero or at least 2^-64.
fn has_area_when_rounded(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    let e = sub_each(b, a);
    let f = sub_each(c, a);
    return exceeds_rounding_error(e.x, e.y, f.x, f.y) || exceeds_rounding_error(e.y, e.z, f.y, f.z)
        || exceeds_rounding_error(e.z, e.x, f.z, f.x);
}

// Returns whether an active triangle has exactly zero area. Coordinates are passed as bits.
fn is_degenerate(a: vec3<u32>, b: vec3<u32>, c: vec3<u32>) -> bool {
    var prime = LARGEST_PRIME;
    for (var i = 0u; i < PRIMES; i += 1u) {
        if !cross_product_vanishes(a, b, c, prime) { return false; }
        prime -= 2u * ((half_gaps(i >> 3u) >> (4u * (i & 7u))) & 15u);
    }
    return true;
}
