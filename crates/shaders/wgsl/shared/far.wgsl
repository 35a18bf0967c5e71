// Rays from so far away that rounded arithmetic says nothing of them: boxes and distances by whole numbers alone.

// Whether the line passes through a box in scaled units, widened by 2^-64: a coordinate below that became zero.
fn passes(low: vec3<u32>, high: vec3<u32>) -> bool {
    // An empty box.
    if low.x == 0x7f800000u { return false; }
    let shift = -params.scale_exponent;
    var units = with_units(vec2<i32>(-64), line.origin, shift);
    units = with_units(with_units(units, low, 0), high, 0);
    let bits = units.y - units.x + 26;
    let len = limbs(bits + 1);
    let both = limbs(bits + line.bits + 3);
    // Seen along each axis, corners of the box on both sides of the line, or on it.
    for (var turn = 0u; turn < 6u; turn += 1u) {
        let j = (turn / 2u + 1u) % 3u;
        let k = (turn / 2u + 2u) % 3u;
        let greatest = (turn & 1u) == 0u;
        let up_j = (line.direction[k] >> 31u == 0u) == greatest;
        let up_k = (line.direction[j] >> 31u == 1u) == greatest;
        put_side(CORNERS, len, select(low[j], high[j], up_j), line.origin[j], units.x, up_j);
        put_side(CORNERS + 13u, len, select(low[k], high[k], up_k), line.origin[k], units.x, up_k);
        clear(PRODUCTS, both);
        accumulate(PRODUCTS, both, CORNERS, len, DIRECTION + COORDINATE * k, line.len, 0u);
        accumulate(PRODUCTS, both, CORNERS + 13u, len, DIRECTION + COORDINATE * j, line.len, 1u);
        finish(PRODUCTS, both);
        let s = sign_of_number(PRODUCTS, both);
        if s == select(1, -1, greatest) { return false; }
    }
    return true;
}

// A box's side from the ray's start, moved outwards. At most 12 limbs: from 2^254, where the scale lifts a start that
// is an f32, down to 2^-87, the last place of the least coordinate.
fn put_side(at: u32, len: u32, x: u32, origin: u32, unit: i32, up: bool) {
    clear(at, len);
    if (x & 0x7fffffffu) != 0u { add_shifted(at, len, mantissa_of(x), u32(unit_of(x) - unit), (x >> 31u) == 1u); }
    if (origin & 0x7fffffffu) != 0u {
        add_shifted(at, len, mantissa_of(origin), u32(unit_of(origin) - params.scale_exponent - unit), (origin >> 31u) == 0u);
    }
    add_shifted(at, len, 1u, u32(-64 - unit), !up);
    finish(at, len);
}

// t, rounded once.
fn rounded_t(c: Crossing) -> u32 {
    let bits_n = bit_length(c.numerator, c.len);
    if bits_n == 0 { return 0u; }
    let up = bits_n - bit_length(c.denominator, c.len);
    // Both brought to one length, bit by bit: 26 bits of the quotient.
    let len = c.len + 1u;
    let a = PRODUCTS;
    let b = PRODUCTS + PRODUCT;
    for (var i = 0u; i < 2u; i += 1u) {
        let side = select(c.numerator, c.denominator, i == 1u);
        let by = max(select(-up, up, i == 1u), 0);
        let to = select(a, b, i == 1u);
        words[to] = 0u;
        for (var k = 0u; k < len; k += 1u) { words[to + 1u + k] = bits_from(side, c.len, 32 * i32(k) - by); }
    }
    var quotient = 0u;
    for (var i = 0u; i < 26u; i += 1u) {
        let fits = compare_sizes(a, len, 0, b, len, 0) >= 0;
        quotient = 2u * quotient + select(0u, 1u, fits);
        if fits { accumulate(a, len, b, len, ONE, 1u, 1u); }
        double_up(a, len);
    }
    let sticky = bit_length(a, len) != 0;
    let sign = words[c.numerator] << 31u;
    if quotient < 0x2000000u { return sign | round_quotient(quotient, sticky, up + c.exponent + 126); }
    return sign | round_quotient(quotient >> 1u, sticky || (quotient & 1u) == 1u, up + c.exponent + 127);
}

// Doubles a magnitude.
fn double_up(at: u32, len: u32) {
    var carry = 0u;
    for (var i = at + 1u; i <= at + len; i += 1u) {
        let x = words[i];
        words[i] = (x << 1u) | carry;
        carry = x >> 31u;
    }
}
