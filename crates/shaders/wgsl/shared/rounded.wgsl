// A quotient of whole numbers of any length, rounded once to a float, as bits.
fn rounded(c: Crossing) -> u32 {
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
