// Sums and products with subnormal numbers as IEEE has them, in integer
// arithmetic: for the rare operands that a device may flush. Finite operands only.

fn soft_multiply(a: u32, b: u32) -> u32 {
    let sign = (a ^ b) & 0x80000000u;
    let xa = a & 0x7fffffffu;
    let xb = b & 0x7fffffffu;
    if xa == 0u || xb == 0u { return sign; }
    let pa = parts(xa);
    let pb = parts(xb);
    let product = multiply_24(pa.mantissa, pb.mantissa);
    let large = product.hi >= 0x800000u;
    let drop = select(22u, 23u, large);
    let quotient = (product.hi << (24u - drop)) | (product.lo >> drop);
    let rest = product.lo & ((1u << drop) - 1u);
    return sign | round_quotient(quotient, rest != 0u, pa.exponent + pb.exponent - select(127, 126, large));
}

fn soft_add(a: u32, b: u32) -> u32 {
    let swap = (a & 0x7fffffffu) < (b & 0x7fffffffu);
    let big = select(a, b, swap);
    let small = select(b, a, swap);
    if (big & 0x7fffffffu) == 0u { return big & small; }
    let e = field(big);
    // Six bits below the last place, the lowest of them for all that fell off.
    let m = mantissa(big) << 6u;
    let shift = e - field(small);
    let n = mantissa(small) << 6u;
    let kept = select(n >> (shift & 31u), 0u, shift > 31u);
    let lost = select(0u, 1u, select((kept << (shift & 31u)) != n, n != 0u, shift > 31u));
    let opposite = ((a ^ b) >> 31u) == 1u;
    let sum = select(m + (kept | lost), m - (kept | lost), opposite);
    if sum == 0u { return 0u; }
    return (big & 0x80000000u) | round_sum(sum, i32(e));
}

// sum * 2^(e - 156), rounded to nearest even, as bits without sign.
fn round_sum(sum: u32, e: i32) -> u32 {
    let top = 31 - i32(countLeadingZeros(sum));
    let drop = max(top - 23, 7 - e);
    let exponent = e - 6 + drop;
    if drop <= 0 { return (sum << u32(-drop)) + (u32(exponent - 1) << 23u); }
    let kept = sum >> u32(drop);
    let rest = sum & ((1u << u32(drop)) - 1u);
    let half = 1u << u32(drop - 1);
    let up = rest > half || (rest == half && (kept & 1u) == 1u);
    return min(kept + select(0u, 1u, up) + (u32(exponent - 1) << 23u), 0x7f800000u);
}

// The exponent's field, 1 for subnormal numbers as well.
fn field(bits: u32) -> u32 { return max((bits >> 23u) & 255u, 1u); }

fn mantissa(bits: u32) -> u32 {
    return (bits & 0x7fffffu) | select(0x800000u, 0u, ((bits >> 23u) & 255u) == 0u);
}
