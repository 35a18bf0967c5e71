//! A few numbers at once: one interface, and the widths that this machine has.
//!
//! Code written against [`Isa`] is compiled once for each instruction set; [`Level::run`]
//! enters the one that the machine was found to have. Every operation is a single IEEE one,
//! lane by lane, so all sets give the same bits. Whatever runs inside must be
//! `#[inline(always)]`, or else it is compiled without the instructions.

mod plain;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use plain::Plain;

use bvh_layout::Link;
use geom::Point;

/// An expression for each of three axes or corners. Closures are compiled on their own, and so without the
/// instructions; expressions are part of the function that they stand in.
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

/// A vector of single-precision numbers, as far as planes of boxes need it.
///
/// Where a number is not one, `min` and `max` return their second operand.
pub(crate) trait Vector: Copy {
    /// The same numbers in memory.
    type Array: Copy + AsRef<[f32]> + AsMut<[f32]>;

    fn splat(x: f32) -> Self;
    fn load(from: &Self::Array) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
}

/// A vector with all that can be done to it.
pub(crate) trait Lanes: Vector {
    /// One truth value a lane.
    type Mask: Copy;
    /// Bits of a mask that is set in every lane.
    const ALL: u32;

    fn store(self) -> Self::Array;
    fn add(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// `self * by + plus`, rounded once or twice, as the machine likes: only where either will do.
    fn about(self, by: Self, plus: Self) -> Self;
    fn abs(self) -> Self;
    /// `2^e` by the exponent `e` of a positive number. Zero for zero, infinity for what is not finite.
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
    /// Bit `i` is lane `i`.
    fn bits(mask: Self::Mask) -> u32;
    /// The reverse of [`Lanes::bits`].
    fn mask(bits: u32) -> Self::Mask;
    /// The least number of all lanes, which must be numbers.
    fn least(self) -> f32;
    /// The greatest number of all lanes, which must be numbers.
    fn most(self) -> f32;
    /// Writes `word` to the places of the lanes that are set.
    fn put(words: &mut [u32; 16], mask: Self::Mask, word: u32);
}

/// Eight numbers: one of each child of a node, or of each triangle of a block.
pub(crate) trait Eight: Lanes<Array = [f32; 8]> {
    /// The coordinates of these points, axis by axis.
    fn coordinates(points: [&Point; 8]) -> [Self; 3];
    /// The greater by their bits as signed integers (Embree's `maxi`), which takes a fourth of the time: where both are
    /// negative it may be the lesser, and is never more than [`Vector::max`].
    #[inline(always)]
    fn maxi(self, other: Self) -> Self {
        self.max(other)
    }
    /// Likewise the lesser, never less than [`Vector::min`].
    #[inline(always)]
    fn mini(self, other: Self) -> Self {
        self.min(other)
    }
    /// In each lane the number of the lane that `lanes` names there, modulo eight.
    fn permuted(self, lanes: &[u8; 8]) -> Self;
}

/// Sixteen numbers as two halves of eight.
pub(crate) trait Halves: Vector<Array = [f32; 16]> {
    type Half: Eight;

    /// Both halves, exchanged if `turn`.
    fn turned(self, turn: bool) -> Self;
    fn low(self) -> Self::Half;
    fn high(self) -> Self::Half;
    fn join(low: Self::Half, high: Self::Half) -> Self;
}

/// The vectors that an instruction set is best at.
pub(crate) trait Isa: Sized + 'static {
    /// As many lanes as a node has children and a block triangles.
    type Eight: Eight;
    /// Lower and upper planes of eight boxes.
    type Planes: Halves<Half = Self::Eight>;
    /// One number of each ray of a packet.
    type Packet: Lanes;

    /// Does `part` in a function of its own.
    fn outlined<P: Outlined<Self>>(part: P) -> P::Out;

    /// Those of `lanes` before anything else, in their order. What comes after them means nothing.
    ///
    /// Without a branch for each: which lanes they are is hard to foresee.
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

/// Asks for the cache lines of what will soon be read, those that its first bytes lie in if it is not aligned to them.
/// Does nothing where that cannot be asked.
#[inline(always)]
pub(crate) fn prefetch<T>(of: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    for line in 0..size_of::<T>().div_ceil(64) {
        let first = of.as_ptr().wrapping_add(index).cast::<i8>();
        #[expect(unsafe_code, reason = "an instruction that the machine has")]
        // SAFETY: whatever the address, a prefetch reads nothing that the program could see.
        unsafe {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(line * 64));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (of, index);
}

/// Something to be done with vectors.
pub(crate) trait Work {
    /// What comes of it.
    type Out;

    /// Does it. Must be `#[inline(always)]`, like all that it calls.
    fn run<I: Isa>(self) -> Self::Out;
}

/// A part of some work that is done at several places, and compiled once for each set.
pub(crate) trait Outlined<I: Isa> {
    /// What comes of it.
    type Out;

    /// Does it. Must be `#[inline(always)]`, like all that it calls.
    fn run(self) -> Self::Out;
}

impl<I: Isa, W: Work> Outlined<I> for W {
    type Out = W::Out;

    #[inline(always)]
    fn run(self) -> W::Out {
        Work::run::<I>(self)
    }
}

/// No instructions but those that every machine of this kind has.
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

/// An instruction set that this machine was found to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level(Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Level {
    /// All that this machine has, the best last.
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

    /// The best that this machine has.
    pub(crate) fn best() -> Self {
        Self::all().pop().unwrap_or(Self(Set::Portable))
    }

    /// Does `work` with this set's instructions.
    #[inline]
    pub(crate) fn run<W: Work>(self, work: W) -> W::Out {
        match self.0 {
            Set::Portable => Portable::outlined(work),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => x86::Avx2::outlined(work),
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => x86::Avx512::outlined(work),
        }
    }
}
