//! Every instruction set does what the plainest does.

use crate::simd::{Eight, Halves, Isa, Lanes, Level, Plain, Work};
use geom::Point;

/// Every operation over a list of awkward numbers, as bits.
struct Everything;

const NUMBERS: [f32; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    1e-45,
    -3e-39,
    f32::MAX,
    1.000_000_1,
    0.1,
    -7.25,
    1e-20,
    3e25,
    -1e-30,
];

impl Work for Everything {
    type Out = Vec<u32>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<u32> {
        let mut all = Vec::new();
        for shift in 0..16 {
            let other: [f32; 16] = std::array::from_fn(|i| NUMBERS[(i + shift) % 16]);
            let (a, b) = (I::Planes::load(&NUMBERS), I::Planes::load(&other));
            operations(a, b, &mut all);
            operations(a.low(), b.high(), &mut all);
            operations(a.turned(shift % 2 == 0).high(), b.low(), &mut all);
            let joined = I::Planes::join(a.high(), b.low()).store();
            all.extend(joined.map(|x| if x.is_nan() { 0 } else { x.to_bits() }));
            let whole: [f32; 16] = std::array::from_fn(|i| (i * 7 % 16) as f32 - shift as f32);
            let whole = I::Planes::load(&whole);
            let ends = [
                whole.least(),
                whole.most(),
                whole.low().least(),
                whole.high().most(),
            ];
            all.extend(ends.map(f32::to_bits));
        }
        let points: [Point; 8] =
            std::array::from_fn(|i| std::array::from_fn(|axis| (3 * i + axis) as f32));
        let coordinates = I::Eight::coordinates(std::array::from_fn(|i| &points[i]));
        for vector in coordinates {
            all.extend(vector.store().map(f32::to_bits));
            for first in 0..16 {
                let lanes = std::array::from_fn(|i| (first + 3 * i) as u8);
                all.extend(vector.permuted(&lanes).store().map(f32::to_bits));
            }
        }
        for lanes in 0..256_u32 {
            let packed = I::packed(&[10, 11, 12, 13, 14, 15, 16, 17], lanes);
            all.extend(&packed[..lanes.count_ones() as usize]);
        }
        all
    }
}

#[inline(always)]
fn operations<L: Lanes>(a: L, b: L, all: &mut Vec<u32>) {
    let one = L::splat(1.0);
    let results = [
        a.add(b),
        a.sub(b),
        a.mul(b),
        a.div(b),
        a.min(b),
        a.max(b),
        a.abs(),
        a.neg(),
        a.replace(a.less(b), one),
        a.replace(L::mask(0x5a3c), b),
    ];
    for r in results {
        let number = |x: &f32| if x.is_nan() { u32::MAX } else { x.to_bits() };
        all.extend(r.store().as_ref().iter().map(number));
    }
    let mut words = std::array::from_fn(|i| i as u32);
    L::put(&mut words, a.less(b), 99);
    L::put(&mut words, L::mask(0x0481), 88);
    all.extend(words);
    let (less, at_most) = (a.less(b), a.at_most(b));
    all.extend(
        [
            less,
            at_most,
            L::both(less, at_most),
            L::either(less, at_most),
        ]
        .map(L::bits),
    );
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let expected = Level::all()[0].run(Everything);
    assert!(expected.len() > 16 * 10 * 16);
    for level in Level::all() {
        assert_eq!(level.run(Everything), expected, "{level:?}");
    }
}

#[test]
fn lanes_and_bits_have_one_order() {
    let a = Plain::<8>::load(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let below = Plain::<8>::bits(a.less(Plain::splat(3.0)));
    assert_eq!(below, 0b111);
    let kept = Plain::splat(9.0)
        .replace(Plain::<8>::mask(below), a)
        .store();
    assert_eq!(kept, [0.0, 1.0, 2.0, 9.0, 9.0, 9.0, 9.0, 9.0]);
}
