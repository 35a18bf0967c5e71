// Whether a triangle's area is exactly zero, in integer arithmetic of any width f32 can ask for.

// A magnitude in units of 2^-149: 9 limbs hold every finite f32 and every difference of two.
const LIMBS: u32 = 9u;

struct Fixed { limbs: array<u32, 9>, negative: bool }

fn fixed(bits: u32) -> Fixed {
    var result: Fixed;
    let exponent = (bits >> 23u) & 255u;
    let mantissa = (bits & 0x7fffffu) | select(0x800000u, 0u, exponent == 0u);
    let shift = max(exponent, 1u) - 1u;
    let limb = shift >> 5u;
    let within = shift & 31u;
    for (var i = 0u; i < LIMBS; i += 1u) {
        var word = 0u;
        if i == limb { word = mantissa << within; }
        if i == limb + 1u && within > 0u { word = mantissa >> (32u - within); }
        result.limbs[i] = word;
    }
    result.negative = (bits >> 31u) == 1u;
    return result;
}

fn compare_fixed(a: Fixed, b: Fixed) -> i32 {
    for (var i = LIMBS; i > 0u; i -= 1u) {
        let x = a.limbs[i - 1u];
        let y = b.limbs[i - 1u];
        if x != y { return select(-1, 1, x > y); }
    }
    return 0;
}

fn subtract_fixed(a: Fixed, b: Fixed) -> Fixed {
    var result: Fixed;
    if a.negative != b.negative {
        var carry = 0u;
        for (var i = 0u; i < LIMBS; i += 1u) {
            let x = a.limbs[i] + b.limbs[i];
            let y = x + carry;
            carry = select(0u, 1u, x < a.limbs[i] || y < x);
            result.limbs[i] = y;
        }
        result.negative = a.negative;
        return result;
    }
    let swap = compare_fixed(a, b) < 0;
    var borrow = 0u;
    for (var i = 0u; i < LIMBS; i += 1u) {
        let big = select(a.limbs[i], b.limbs[i], swap);
        let small = select(b.limbs[i], a.limbs[i], swap);
        let x = big - small;
        let y = x - borrow;
        borrow = select(0u, 1u, big < small || x < borrow);
        result.limbs[i] = y;
    }
    result.negative = a.negative != swap;
    return result;
}

// The product's magnitude in 16-bit digits, so that no 64-bit product is needed.
fn multiply_fixed(a: Fixed, b: Fixed) -> array<u32, 36> {
    var digits: array<u32, 36>;
    for (var i = 0u; i < 36u; i += 1u) { digits[i] = 0u; }
    for (var i = 0u; i < 18u; i += 1u) {
        let x = (a.limbs[i >> 1u] >> ((i & 1u) * 16u)) & 0xffffu;
        if x == 0u { continue; }
        var carry = 0u;
        for (var j = 0u; j < 18u; j += 1u) {
            let y = (b.limbs[j >> 1u] >> ((j & 1u) * 16u)) & 0xffffu;
            let sum = x * y + digits[i + j] + carry;
            digits[i + j] = sum & 0xffffu;
            carry = sum >> 16u;
        }
        digits[i + 18u] = carry;
    }
    return digits;
}

fn is_zero_fixed(a: Fixed) -> bool {
    for (var i = 0u; i < LIMBS; i += 1u) {
        if a.limbs[i] != 0u { return false; }
    }
    return true;
}

// Whether a * b == c * d.
fn products_equal(a: Fixed, b: Fixed, c: Fixed, d: Fixed) -> bool {
    let left_zero = is_zero_fixed(a) || is_zero_fixed(b);
    let right_zero = is_zero_fixed(c) || is_zero_fixed(d);
    if left_zero || right_zero { return left_zero && right_zero; }
    if (a.negative != b.negative) != (c.negative != d.negative) { return false; }
    let left = multiply_fixed(a, b);
    let right = multiply_fixed(c, d);
    for (var i = 0u; i < 36u; i += 1u) {
        if left[i] != right[i] { return false; }
    }
    return true;
}

fn collinear_in(a: vec2<u32>, b: vec2<u32>, c: vec2<u32>) -> bool {
    let ex = subtract_fixed(fixed(b.x), fixed(a.x));
    let ey = subtract_fixed(fixed(b.y), fixed(a.y));
    let fx = subtract_fixed(fixed(c.x), fixed(a.x));
    let fy = subtract_fixed(fixed(c.y), fixed(a.y));
    return products_equal(ex, fy, ey, fx);
}

// Whether one component of the cross product stands clear of its rounding
// error (two differences, one product, one difference: 8 units of 2^-23 cover
// them), and of underflow.
fn stands_clear(ei: f32, ej: f32, fi: f32, fj: f32) -> bool {
    let p = mul(ei, fj);
    let q = mul(ej, fi);
    let size = add(abs(p), abs(q));
    return size > 1e-30 && abs(sub(p, q)) > 9.5367431640625e-7 * size;
}

// Whether rounded arithmetic already shows an area; coordinates are zero or at least 2^-64.
fn has_area(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    let e = vec3<f32>(sub(b.x, a.x), sub(b.y, a.y), sub(b.z, a.z));
    let f = vec3<f32>(sub(c.x, a.x), sub(c.y, a.y), sub(c.z, a.z));
    return stands_clear(e.x, e.y, f.x, f.y) || stands_clear(e.y, e.z, f.y, f.z)
        || stands_clear(e.z, e.x, f.z, f.x);
}

// Whether an active triangle has exactly no area; coordinates as bits.
fn is_degenerate(a: vec3<u32>, b: vec3<u32>, c: vec3<u32>) -> bool {
    if all(a == b) || all(b == c) || all(c == a) {
        return true;
    }
    return collinear_in(a.xy, b.xy, c.xy) && collinear_in(a.yz, b.yz, c.yz)
        && collinear_in(a.zx, b.zx, c.zx);
}
