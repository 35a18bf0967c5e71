//! Tests that every instruction set gives the same results as the portable one.

use crate::simd::{Eight, Halves, InstructionSet, Isa, Lanes, PlaneVector, VectorWork};
use bvh_layout::Link;
use geom::Point;

/// Results of operations on a list of special numbers, as bits. Omits those that may differ between instruction sets.
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

impl VectorWork for Everything {
    type Out = Vec<u32>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<u32> {
        let mut all = Vec::new();
        for shift in 0..16 {
            let other = std::array::from_fn(|i| NUMBERS[(i + shift) % 16]);
            all.extend(operations::<I::Packet>(&NUMBERS, &other));
            all.extend(operations::<I::Eight>(&NUMBERS, &other));
            let (a, b) = (I::Planes::load(&NUMBERS), I::Planes::load(&other));
            let turned = a.turned(shift % 2 == 0);
            let joined = I::Planes::join(a.high(), b.low());
            for planes in [a.sub(b), a.mul(b), a.min(b), a.max(b), turned, joined] {
                all.extend(numbers(planes.low()));
                all.extend(numbers(planes.high()));
            }
            let whole = std::array::from_fn(|i| (i * 7 % 16) as f32 - shift as f32);
            all.extend(ends::<I::Packet>(&whole).map(f32::to_bits));
            all.extend(ends::<I::Eight>(&whole).map(f32::to_bits));
        }
        let points: [Point; 8] =
            std::array::from_fn(|i| std::array::from_fn(|axis| (3 * i + axis) as f32));
        for vector in I::Eight::coordinates(std::array::from_fn(|i| &points[i])) {
            all.extend(numbers(vector));
            for first in 0..16 {
                let lanes = std::array::from_fn(|i| (first + 3 * i) as u8);
                all.extend(numbers(vector.permuted(&lanes)));
            }
        }
        let links = std::array::from_fn(|i| Link::node(10 + i));
        for lanes in 0..256_u32 {
            let packed = I::packed(&links, lanes);
            let packed = packed.iter().take(lanes.count_ones() as usize);
            all.extend(packed.map(|link| link.index() as u32));
        }
        all
    }
}

#[inline(always)]
fn numbers<L: Lanes>(of: L) -> Vec<u32> {
    let number = |x: &f32| if x.is_nan() { u32::MAX } else { x.to_bits() };
    of.store().as_ref().iter().map(number).collect()
}

/// Loads as many of sixteen numbers as there are lanes, starting at `first`.
#[inline(always)]
fn load<L: Lanes>(numbers: &[f32; 16], first: usize) -> L {
    let mut lanes = L::splat(0.0).store();
    let count = lanes.as_ref().len();
    lanes
        .as_mut()
        .copy_from_slice(&numbers[first..first + count]);
    L::load(&lanes)
}

/// Returns the results of the lane-wise operations on the lists `a` and `b`: all results of the first operation, then
/// those of the next.
#[inline(always)]
fn operations<L: Lanes>(a: &[f32; 16], b: &[f32; 16]) -> Vec<u32> {
    let lanes = L::ALL.count_ones() as usize;
    let mut all = vec![Vec::new(); 16];
    for first in (0..16).step_by(lanes) {
        let (a, b, one) = (load::<L>(a, first), load::<L>(b, first), L::splat(1.0));
        let (less, at_most) = (a.less(b), a.at_most(b));
        let results = [
            a.add(b),
            a.sub(b),
            a.mul(b),
            a.div(b),
            a.min(b),
            a.max(b),
            a.abs(),
            a.power(),
            a.neg(),
            a.replace(less, one),
            a.replace(L::mask(0x5a3c >> first), b),
        ];
        let masks = [
            less,
            at_most,
            L::both(less, at_most),
            L::either(less, at_most),
        ];
        let mut words = std::array::from_fn(|i| (first + i) as u32);
        L::put(&mut words, less, 99);
        L::put(&mut words, L::mask(0x0481 >> first), 88);
        let bits = |mask| {
            (0..lanes)
                .map(move |lane| L::bits(mask) >> lane & 1)
                .collect()
        };
        let found = results
            .into_iter()
            .map(numbers)
            .chain(masks.into_iter().map(bits));
        for (all, found) in all.iter_mut().zip(found.chain([words[..lanes].to_vec()])) {
            all.extend(found);
        }
    }
    all.concat()
}

/// Returns the least and the greatest of sixteen numbers.
#[inline(always)]
fn ends<L: Lanes>(numbers: &[f32; 16]) -> [f32; 2] {
    let mut ends = [f32::INFINITY, f32::NEG_INFINITY];
    for first in (0..16).step_by(L::ALL.count_ones() as usize) {
        let some = load::<L>(numbers, first);
        ends = [ends[0].min(some.least()), ends[1].max(some.most())];
    }
    ends
}

#[test]
fn instruction_sets_give_identical_bits() {
    let expected = InstructionSet::all()[0].run(Everything);
    assert!(expected.len() > 16 * 10 * 16);
    for instruction_set in InstructionSet::all() {
        assert_eq!(
            instruction_set.run(Everything),
            expected,
            "{instruction_set:?}"
        );
    }
}
