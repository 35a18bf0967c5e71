// Multi-word integers for any f32 input, in limbs of 32 bits.
//
// A number is a sign word (1 if negative) followed by its magnitude, least significant limb first. While it accumulates, it is a
// two's complement of the length in use and its sign word is unused. The length is derived from the actual exponents, so that
// ordinary numbers take few limbs. The storage suffices for all numbers.
//
// Bound on the length: a corner's coordinate relative to the ray's start is a difference of two multiples of one unit.
// If both are f32, the difference is below 2^278 units. If the start is that of a shadow ray, in scene units, the
// difference is below 2^281 units: if the scale exponent k is not negative, start and corner are below 2^131 and
// multiples of 2^-149. Otherwise, start and corner are below 2^(k + 42) and multiples of 2^(k - 149). If coordinates
// have B bits, a difference of two products has 2B + 1. A sum of three products of such a difference with a coordinate,
// or with a direction of at most 277 bits, has 3B + 3. The sum of three such sums has 2 more, plus a sign bit: 849
// bits, or 27 limbs. A product of two such numbers has 54 limbs.

// Layout of `words`, the scratch memory of all numbers: corners, direction, a cross product, two intersections, the
// number 1, two products.
const COORDINATE_STRIDE: u32 = 10u;
const CORNERS_OFFSET: u32 = 0u;
const DIRECTION_OFFSET: u32 = 90u;
const CROSS_OFFSET: u32 = 120u;
// Numerators and denominators of two intersections, 28 words each.
const INTERSECTIONS_OFFSET: u32 = 140u;
const ONE_OFFSET: u32 = 254u;
const PRODUCTS_OFFSET: u32 = 256u;
const PRODUCT_STRIDE: u32 = 55u;

var<private> words: array<u32, 366>;

fn clear(at: u32, len: u32) {
    for (var i = 0u; i <= len; i += 1u) { words[at + i] = 0u; }
}

// Returns the 64-bit product, low word first. The build turns it into one SPIR-V instruction: see build/harden.rs.
fn multiply_32(a: u32, b: u32) -> vec2<u32> {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let first = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let second = (a & 0xffffu) * (b >> 16u) + (first & 0xffffu);
    return vec2<u32>((second << 16u) | (low & 0xffffu), (a >> 16u) * (b >> 16u) + (first >> 16u) + (second >> 16u));
}

// Returns the sum and the carry.
fn add_32(a: u32, b: u32) -> vec2<u32> {
    let sum = a + b;
    return vec2<u32>(sum, select(0u, 1u, sum < a));
}

// Adds a * b, or subtracts it if `flip` is 1. One loop does both, because not(not(x) + y) is x - y.
fn accumulate_product(at: u32, len: u32, a: u32, a_len: u32, b: u32, b_len: u32, flip: u32) {
    let mask = 0u - (words[a] ^ words[b] ^ flip);
    for (var i = 0u; i < a_len; i += 1u) {
        let x = words[a + 1u + i];
        if x == 0u { continue; }
        var carry = 0u;
        for (var j = 0u; i + j < len && (j < b_len || carry != 0u); j += 1u) {
            var product = vec2<u32>(0u);
            if j < b_len { product = multiply_32(x, words[b + 1u + j]); }
            let destination = at + 1u + i + j;
            let first = add_32(product.x, words[destination] ^ mask);
            let sum = add_32(first.x, carry);
            carry = product.y + first.y + sum.y;
            words[destination] = sum.x ^ mask;
        }
    }
}

// Adds mantissa * 2^shift, or subtracts it if `negative` is set.
fn add_shifted(at: u32, len: u32, mantissa: u32, shift: u32, negative: bool) {
    let mask = select(0u, 0xffffffffu, negative);
    let bit_shift = shift & 31u;
    var addend = vec2<u32>(mantissa << bit_shift, select(mantissa >> ((32u - bit_shift) & 31u), 0u, bit_shift == 0u));
    var carry = 0u;
    for (var i = shift >> 5u; i < len && (addend.x | addend.y | carry) != 0u; i += 1u) {
        let partial = addend.x + (words[at + 1u + i] ^ mask);
        let sum = partial + carry;
        carry = select(0u, 1u, partial < addend.x || sum < carry);
        words[at + 1u + i] = sum ^ mask;
        addend = vec2<u32>(addend.y, 0u);
    }
}

// Converts a two's complement to sign and magnitude.
fn to_sign_magnitude(at: u32, len: u32) {
    let negative = (words[at + len] >> 31u) == 1u;
    words[at] = select(0u, 1u, negative);
    if !negative { return; }
    var carry = 1u;
    for (var i = at + 1u; i <= at + len; i += 1u) {
        let x = ~words[i] + carry;
        carry = select(0u, carry, x == 0u);
        words[i] = x;
    }
}

// Returns the number of bits of the magnitude; 0 for zero.
fn bit_length(at: u32, len: u32) -> i32 {
    for (var i = len; i > 0u; i -= 1u) {
        let x = words[at + i];
        if x != 0u { return i32(32u * i - countLeadingZeros(x)); }
    }
    return 0;
}

fn sign_of_number(at: u32, len: u32) -> i32 {
    if bit_length(at, len) == 0 { return 0; }
    return select(1, -1, words[at] == 1u);
}

// Returns 32 bits of the magnitude from bit `low` on. `low` may be negative.
fn bits_from(at: u32, len: u32, low: i32) -> u32 {
    if low <= -32 || low >= 32 * i32(len) { return 0u; }
    if low < 0 { return words[at + 1u] << u32(-low); }
    let i = at + 1u + (u32(low) >> 5u);
    let bit_shift = u32(low) & 31u;
    var bits = words[i] >> bit_shift;
    if bit_shift > 0u && i < at + len { bits |= words[i + 1u] << (32u - bit_shift); }
    return bits;
}

// Compares |a| * 2^a_exponent with |b| * 2^b_exponent. Returns -1, 0 or 1.
fn compare_magnitudes(a: u32, a_len: u32, a_exponent: i32, b: u32, b_len: u32, b_exponent: i32) -> i32 {
    let bits_a = bit_length(a, a_len);
    let bits_b = bit_length(b, b_len);
    if bits_a == 0 || bits_b == 0 || bits_a + a_exponent != bits_b + b_exponent {
        let length_a = select(bits_a + a_exponent, -100000, bits_a == 0);
        let length_b = select(bits_b + b_exponent, -100000, bits_b == 0);
        return sign(length_a - length_b);
    }
    // The leading bits of both have the same weight.
    for (var down = 32; down < max(bits_a, bits_b) + 32; down += 32) {
        let x = bits_from(a, a_len, bits_a - down);
        let y = bits_from(b, b_len, bits_b - down);
        if x != y { return select(-1, 1, x > y); }
    }
    return 0;
}

// A finite number is mantissa_of * 2^unit_of.
fn unit_of(bits: u32) -> i32 { return max(i32((bits >> 23u) & 255u), 1) - 150; }

fn mantissa_of(bits: u32) -> u32 {
    return (bits & 0x7fffffu) | select(0x800000u, 0u, ((bits >> 23u) & 255u) == 0u);
}
