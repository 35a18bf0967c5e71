// How a triangle stands: whether a ray can hit it at all.

const SOUND: u32 = 0u;
const INACTIVE: u32 = 1u;
const DEGENERATE: u32 = 2u;

// Of a triangle's corners as they are given, and in scaled units.
fn standing(given_a: vec3<u32>, given_b: vec3<u32>, given_c: vec3<u32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> u32 {
    if !(is_finite(given_a) && is_finite(given_b) && is_finite(given_c)) { return INACTIVE; }
    return select(SOUND, DEGENERATE, is_flat(given_a, given_b, given_c, a, b, c));
}
