//! Vectors as plain arrays, which the compiler may vectorize.

use super::{Eight, Halves, Lanes, PlaneVector};
use geom::Point;
use std::array::from_fn;

/// An array of `N` numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plain<const N: usize>([f32; N]);

impl<const N: usize> Plain<N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(from_fn(|i| f(self.0[i], other.0[i])))
    }
}

macro_rules! lanewise {
    ($( $name:ident: $each:expr; )*) => { $(
        #[inline(always)]
        fn $name(self, other: Self) -> Self {
            self.zip(other, $each)
        }
    )* };
}

impl<const N: usize> PlaneVector for Plain<N> {
    type Array = [f32; N];

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    fn load(from: &[f32; N]) -> Self {
        Self(*from)
    }
    lanewise! {
        sub: |a, b| a - b;
        mul: |a, b| a * b;
        min: |a, b| if a < b { a } else { b };
        max: |a, b| if a > b { a } else { b };
    }
}

impl<const N: usize> Lanes for Plain<N> {
    type Mask = [bool; N];
    const ALL: u32 = (1 << N) - 1;

    #[inline(always)]
    fn store(self) -> [f32; N] {
        self.0
    }
    lanewise! {
        add: |a, b| a + b;
        div: |a, b| a / b;
    }
    #[inline(always)]
    fn mul_add_approximate(self, by: Self, plus: Self) -> Self {
        self.mul(by).add(plus)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }
    #[inline(always)]
    fn power(self) -> Self {
        let exponent = f32::INFINITY.to_bits();
        Self(self.0.map(|x| f32::from_bits(x.to_bits() & exponent)))
    }
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|x| -x))
    }
    #[inline(always)]
    fn less(self, other: Self) -> [bool; N] {
        from_fn(|i| self.0[i] < other.0[i])
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> [bool; N] {
        from_fn(|i| self.0[i] <= other.0[i])
    }
    #[inline(always)]
    fn replace(self, mask: [bool; N], other: Self) -> Self {
        Self(from_fn(|i| if mask[i] { other.0[i] } else { self.0[i] }))
    }
    #[inline(always)]
    fn both(a: [bool; N], b: [bool; N]) -> [bool; N] {
        from_fn(|i| a[i] & b[i])
    }
    #[inline(always)]
    fn either(a: [bool; N], b: [bool; N]) -> [bool; N] {
        from_fn(|i| a[i] | b[i])
    }
    #[inline(always)]
    fn bits(mask: [bool; N]) -> u32 {
        (0..N).fold(0, |bits, i| bits | u32::from(mask[i]) << i)
    }
    #[inline(always)]
    fn mask(bits: u32) -> [bool; N] {
        from_fn(|i| bits >> i & 1 == 1)
    }
    #[inline(always)]
    fn least(self) -> f32 {
        self.0
            .iter()
            .fold(f32::INFINITY, |a, &b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn most(self) -> f32 {
        self.0
            .iter()
            .fold(f32::NEG_INFINITY, |a, &b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn put(words: &mut [u32; 16], mask: [bool; N], word: u32) {
        for (to, set) in words.iter_mut().zip(mask) {
            *to = if set { word } else { *to };
        }
    }
}

impl Eight for Plain<8> {
    #[inline(always)]
    fn coordinates(points: [&Point; 8]) -> [Self; 3] {
        from_fn(|axis| Self(points.map(|p| p[axis])))
    }
    #[inline(always)]
    fn permuted(self, lanes: &[u8; 8]) -> Self {
        Self(lanes.map(|lane| self.0[usize::from(lane) % 8]))
    }
}

impl Halves for Plain<16> {
    type Half = Plain<8>;

    #[inline(always)]
    fn turned(self, turn: bool) -> Self {
        let by = if turn { 8 } else { 0 };
        Self(from_fn(|i| self.0[i ^ by]))
    }
    #[inline(always)]
    fn low(self) -> Plain<8> {
        Plain(from_fn(|i| self.0[i]))
    }
    #[inline(always)]
    fn high(self) -> Plain<8> {
        Plain(from_fn(|i| self.0[i + 8]))
    }
    #[inline(always)]
    fn join(low: Plain<8>, high: Plain<8>) -> Self {
        Self(from_fn(|i| if i < 8 { low.0[i] } else { high.0[i - 8] }))
    }
}
