//! Vector operations: one interface, and its implementations for the instruction sets of this machine.
//!
//! Code that is generic over [`Isa`] is compiled once for each instruction set. [`InstructionSet::run`] calls the
//! version for one set. All sets give the same bits, with three exceptions: [`Lanes::mul_add_approximate`],
//! [`Eight::maxi`] and [`Eight::mini`]. Generic functions must be `#[inline(always)]`, or they are compiled without the
//! set's instructions.

mod plain;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use plain::Plain;

use bvh_layout::Link;
use geom::Point;

/// Evaluates an expression for each of three axes or corners. This is a macro because a closure would be a separate
/// function, which is compiled without the set's instructions.
macro_rules! each {
    ($i:ident => $value:expr) => {
        [each!($i 0 $value), each!($i 1 $value), each!($i 2 $value)]
    };
    ($i:ident $number:literal $value:expr) => {{
        let $i = $number;
        $value
    }};
}
pub(crate) use each;

/// The lanes that are set in a mask, in ascending order. `N` is a power of two that exceeds every lane, so that arrays
/// of length `N` are accessed without a bounds check.
pub(crate) struct SetLanes<const N: usize>(pub(crate) u32);

impl<const N: usize> Iterator for SetLanes<N> {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize % N;
        self.0 &= self.0 - 1;
        Some(lane)
    }
}

/// A vector of single-precision numbers, with the operations that box planes need.
///
/// If an operand is NaN, `min` and `max` return their second operand.
pub(crate) trait PlaneVector: Copy {
    /// Array with the same numbers.
    type Array: Copy + AsRef<[f32]> + AsMut<[f32]>;

    fn splat(x: f32) -> Self;
    fn load(from: &Self::Array) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
}

/// A vector with all operations.
pub(crate) trait Lanes: PlaneVector {
    /// One truth value per lane.
    type Mask: Copy;
    /// Mask bits with every lane set.
    const ALL: u32;

    fn store(self) -> Self::Array;
    fn add(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// `self * by + plus`, rounded once or twice depending on the machine. No hit may depend on the result.
    fn mul_add_approximate(self, by: Self, plus: Self) -> Self;
    fn abs(self) -> Self;
    /// `2^e`, where `e` is the exponent of a positive normal number. Zero for zero and subnormal numbers, infinity for
    /// infinity and NaN.
    fn power(self) -> Self;
    fn neg(self) -> Self;
    /// `self < other`.
    fn less(self, other: Self) -> Self::Mask;
    /// `self <= other`.
    fn at_most(self, other: Self) -> Self::Mask;
    /// `other` where `mask` is set, else `self`.
    fn replace(self, mask: Self::Mask, other: Self) -> Self;
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Returns the mask with lane `i` as bit `i`.
    fn bits(mask: Self::Mask) -> u32;
    /// The inverse of [`Lanes::bits`].
    fn mask(bits: u32) -> Self::Mask;
    /// Returns the least number of all lanes. No lane may be NaN.
    fn least(self) -> f32;
    /// Returns the greatest number of all lanes. No lane may be NaN.
    fn most(self) -> f32;
    /// Writes `word` to the entries of the lanes that are set.
    fn put(words: &mut [u32; 16], mask: Self::Mask, word: u32);
}

/// Eight numbers: one for each child of a node or each triangle of a block.
pub(crate) trait Eight: Lanes<Array = [f32; 8]> {
    /// Returns the coordinates of `points`, axis by axis.
    fn coordinates(points: [&Point; 8]) -> [Self; 3];
    /// Returns a lower bound of [`PlaneVector::max`], which differs only if both operands are negative. With AVX2 and
    /// AVX-512, this is the operand whose bits are greater as a signed integer (Embree's `maxi`), in a quarter of the
    /// time. If an operand is NaN, returns either operand.
    #[inline(always)]
    fn maxi(self, other: Self) -> Self {
        self.max(other)
    }
    /// Returns an upper bound of [`PlaneVector::min`], which differs only if both operands are negative. With AVX2 and
    /// AVX-512, this is the operand whose bits are less as a signed integer. If an operand is NaN, returns either
    /// operand.
    #[inline(always)]
    fn mini(self, other: Self) -> Self {
        self.min(other)
    }
    /// Returns a vector whose lane `i` is lane `lanes[i]` of this one, modulo eight.
    fn permuted(self, lanes: &[u8; 8]) -> Self;
}

/// Sixteen numbers as two halves of eight.
pub(crate) trait Halves: PlaneVector<Array = [f32; 16]> {
    type Half: Eight;

    /// Exchanges the halves if `turn` is true.
    fn turned(self, turn: bool) -> Self;
    fn low(self) -> Self::Half;
    fn high(self) -> Self::Half;
    fn join(low: Self::Half, high: Self::Half) -> Self;
}

/// The vector types of an instruction set.
pub(crate) trait Isa: Sized + 'static {
    /// Vector with one lane for each child of a node or each triangle of a block.
    type Eight: Eight;
    /// Lower and upper planes of eight boxes.
    type Planes: Halves<Half = Self::Eight>;
    /// One number for each ray of a packet.
    type Packet: Lanes;

    /// Runs `part` in a separate function.
    fn outlined<P: Outlined<Self>>(part: P) -> P::Out;

    /// Moves the links of `lanes` to the front, in order. The remaining entries are unspecified.
    ///
    /// Avoids a branch per lane, because such branches are hard to predict.
    #[inline(always)]
    fn packed(of: &[Link; 8], lanes: u32) -> [Link; 8] {
        let (mut to, mut count) = (*of, 0);
        for (lane, &link) in of.iter().enumerate() {
            to[count % 8] = link;
            count += (lanes >> lane & 1) as usize;
        }
        to
    }
}

/// Prefetches the cache lines of an entry that will soon be read. If the entry is not aligned to cache lines, its last
/// line may not be prefetched. Does nothing on architectures other than x86-64.
#[inline(always)]
pub(crate) fn prefetch<T>(of: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    for line in 0..size_of::<T>().div_ceil(64) {
        let first = of.as_ptr().wrapping_add(index).cast::<i8>();
        #[expect(unsafe_code, reason = "an instruction that the machine has")]
        // SAFETY: a prefetch of any address has no effect that the program can observe.
        unsafe {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(line * 64));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (of, index);
}

/// A task that uses vectors.
pub(crate) trait VectorWork {
    /// The result.
    type Out;

    /// Runs the task. Must be `#[inline(always)]`, as must every function that it calls.
    fn run<I: Isa>(self) -> Self::Out;
}

/// A part of a task that has several call sites and is compiled once for each instruction set.
pub(crate) trait Outlined<I: Isa> {
    /// The result.
    type Out;

    /// Runs the part. Must be `#[inline(always)]`, as must every function that it calls.
    fn run(self) -> Self::Out;
}

impl<I: Isa, W: VectorWork> Outlined<I> for W {
    type Out = W::Out;

    #[inline(always)]
    fn run(self) -> W::Out {
        VectorWork::run::<I>(self)
    }
}

/// The baseline instruction set of this architecture.
struct Portable;

impl Isa for Portable {
    type Eight = Plain<8>;
    type Planes = Plain<16>;
    type Packet = Plain<8>;

    #[inline(never)]
    fn outlined<P: Outlined<Self>>(part: P) -> P::Out {
        part.run()
    }
}

/// An instruction set that was detected on this machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstructionSet(Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl InstructionSet {
    /// Returns all instruction sets of this machine, the best last.
    #[must_use]
    pub fn all() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        let vectors = [
            x86::has_avx2().then_some(Set::Avx2),
            x86::has_avx512().then_some(Set::Avx512),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let vectors: [Option<Set>; 0] = [];
        let all = std::iter::once(Set::Portable).chain(vectors.into_iter().flatten());
        all.map(Self).collect()
    }

    /// Returns the best instruction set of this machine.
    pub(crate) fn best() -> Self {
        Self::all().pop().unwrap_or(Self(Set::Portable))
    }

    /// Runs `work` with this instruction set.
    #[inline]
    pub(crate) fn run<W: VectorWork>(self, work: W) -> W::Out {
        match self.0 {
            Set::Portable => Portable::outlined(work),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => x86::Avx2::outlined(work),
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => x86::Avx512::outlined(work),
        }
    }
}
