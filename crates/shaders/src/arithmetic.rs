//! The self-test of a device's arithmetic.
//!
//! When a backend opens a device, it runs the kernel `arithmetic` on [`operands`] and refuses the device if [`verify`]
//! fails. Equal results on all devices need single rounding, no fusing, no regrouping, and the integer arithmetic of
//! `wgsl/lib/ieee.wgsl` and `wgsl/lib/exact.wgsl`. The same kernel also measures how the device divides and sums
//! products without these restrictions, and whether its driver ends long loops early.

use crate::Packets;
use backend::Arithmetic;

/// Device properties that select kernels, and for each kernel the code with or without fused multiply-add. By default, no
/// optional property is present.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traits {
    /// Whether an explicit fused multiply-add rounds once.
    pub fma_rounds_once: bool,
    /// How invocations search together, if the device can trace packets.
    pub packets: Option<Packets>,
    /// Whether buffers have a 64-bit atomic minimum, which rasterization needs.
    pub rasterizes: bool,
}

/// Expected number of iterations of the self-test's loop.
const ITERATIONS: u32 = 100_000;

/// Operand quadruples: moderate exponents, near cancellation, halfway mantissas, exponents far apart, equal products, and
/// quotients down to `2^-120`.
pub fn operands() -> Vec<[f32; 4]> {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut next = move || {
        // SplitMix64 (Steele, Lea, Flood 2014).
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    };
    let mut number = move |spread: u32| {
        let bits = next();
        let exponent = 127 - spread / 2 + (bits >> 32) as u32 % spread;
        let mantissa = match bits >> 60 {
            0 => 0,
            1 => 0x7f_ffff,
            2 => 0x40_0000,
            _ => bits as u32 & 0x7f_ffff,
        };
        f32::from_bits(((bits >> 50) as u32 & 1) << 31 | exponent << 23 | mantissa)
    };
    let step = |x: f32, by: i32| f32::from_bits(x.to_bits().wrapping_add_signed(by));
    let quadruple = |i: usize| {
        let (a, b, c, d) = (number(40), number(40), number(40), number(40));
        let far = f32::exp2(40.0);
        match i % 7 {
            0 => [a, b, c, d],
            1 => [a, b, -step(a, 1), step(b, -1)],
            2 => [a, b, b, a],
            3 => [a, b, -a, step(b, 1)],
            4 => [a, step(a, 2), step(a, 1), step(a, 1)],
            5 => [a, number(2), c, number(2)],
            _ => [a / far, b * far, c, d],
        }
    };
    (0..4096).map(quadruple).collect()
}

/// Compares the results of the kernel with those of IEEE 754. Returns the device's behaviour for operations that it
/// may round freely, and [`Traits::fma_rounds_once`].
///
/// `results` holds a pair for each of `operands`. The first element must be correct. The second one holds the device's
/// own quotient, its sum of products, the number of loop iterations (in the first pair only), and the rounding error
/// of `a * b` by a fused multiply-add.
///
/// # Errors
/// Fails on the first wrong operation, or if the driver silently ends long loops early.
pub fn verify(
    operands: &[[f32; 4]],
    results: &[[[u32; 4]; 2]],
) -> Result<(Arithmetic, bool), String> {
    const NAMES: [&str; 4] = [
        "a * b + c * d",
        "(a + b) - a",
        "a / b",
        "the sign of a * b - c * d",
    ];
    let mut behaviour = Arithmetic::IEEE;
    let mut fma_rounds_once = !operands.is_empty();
    for (x, [found, free]) in operands.iter().zip(results) {
        let expected = expect(*x);
        if let Some(i) = (0..4).find(|&i| found[i] != expected[i]) {
            let (name, found, expected) = (NAMES[i], found[i], expected[i]);
            return Err(format!(
                "{name} of {x:?} gives bits {found:#010x}, IEEE 754 has {expected:#010x}"
            ));
        }
        let [sum, _, quotient, _] = expected;
        behaviour.rounds_division &= free[0] == quotient;
        behaviour.fuses |= free[1] != sum;
        fma_rounds_once &= free[3] == product_rounding_error(*x).to_bits();
    }
    match results.first().map_or(ITERATIONS, |r| r[1][2]) {
        ITERATIONS => Ok((behaviour, fma_rounds_once)),
        iterations => Err(format!(
            "the driver ends loops after {iterations} iterations; software drivers of Mesa need version 23.1 or newer"
        )),
    }
}

fn product_rounding_error([a, b, ..]: [f32; 4]) -> f32 {
    a.mul_add(b, -(a * b))
}

fn expect([a, b, c, d]: [f32; 4]) -> [u32; 4] {
    // Products of two f32 are exact in f64.
    let [p, q] = [f64::from(a) * f64::from(b), f64::from(c) * f64::from(d)];
    let sign = i32::from(p > q) - i32::from(p < q);
    [
        (a * b + c * d).to_bits(),
        ((a + b) - a).to_bits(),
        (a / b).to_bits(),
        sign as u32,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the results of a device that conforms to IEEE 754, but has no fused multiply-add that rounds once.
    fn right(all: &[[f32; 4]]) -> Vec<[[u32; 4]; 2]> {
        let of = |x: &[f32; 4]| {
            let [sum, back, quotient, sign] = expect(*x);
            [[sum, back, quotient, sign], [quotient, sum, 0, 0]]
        };
        let mut all: Vec<_> = all.iter().map(of).collect();
        all[0][1][2] = ITERATIONS;
        all
    }

    /// Verifies results in which word `i` of element `part` of each pair is replaced.
    fn with(part: usize, i: usize, f: fn([f32; 4]) -> u32) -> Result<(Arithmetic, bool), String> {
        let all = operands();
        let mut results = right(&all);
        for (r, x) in results.iter_mut().zip(&all) {
            r[part][i] = f(*x);
        }
        verify(&all, &results)
    }

    #[test]
    fn rejects_drivers_that_truncate_loops() {
        let refused = with(1, 2, |_| 65_535).unwrap_err();
        assert!(
            refused.contains("after 65535 iterations")
                && refused.contains("Mesa need version 23.1")
        );
    }

    #[test]
    fn detects_optional_arithmetic_behaviour() {
        let free = |i, f| with(1, i, f).unwrap();
        let (divides, _) = free(0, |[a, b, ..]| (a * (1.0 / b)).to_bits());
        assert!(!divides.rounds_division && !divides.fuses);
        let (fuses, _) = free(1, |[a, b, c, d]| a.mul_add(b, c * d).to_bits());
        assert!(fuses.rounds_division && fuses.fuses);
        assert!(free(3, |x| product_rounding_error(x).to_bits()).1);
        assert!(!free(3, |[a, b, ..]| (a * b - a * b).to_bits()).1);
        let in_fewer_places = |[a, b, ..]: [f32; 4]| {
            let lost = f64::from(a) * f64::from(b) - f64::from(a * b);
            ((lost * (1.0 + 1e-6)) as f32).to_bits()
        };
        assert!(!free(3, in_fewer_places).1);
    }

    #[test]
    fn detects_fused_and_regrouped_operations() {
        let all = operands();
        let (found, _) = verify(&all, &right(&all)).unwrap();
        assert_eq!(found, Arithmetic::IEEE);
        let rounded: fn([f32; 4]) -> u32 = |[a, b, c, d]| {
            let s = a * b - c * d;
            (i32::from(s > 0.0) - i32::from(s < 0.0)) as u32
        };
        type Wrong = (&'static str, fn([f32; 4]) -> u32);
        let wrong: [Wrong; 4] = [
            ("a * b + c * d of ", |[a, b, c, d]| {
                a.mul_add(b, c * d).to_bits()
            }),
            ("(a + b) - a of ", |x| x[1].to_bits()),
            ("a / b of ", |x| (x[0] * (1.0 / x[1])).to_bits()),
            ("the sign of ", rounded),
        ];
        for (i, (operation, f)) in wrong.into_iter().enumerate() {
            let refused = with(0, i, f).unwrap_err();
            assert!(refused.starts_with(operation), "{refused}");
        }
    }
}
