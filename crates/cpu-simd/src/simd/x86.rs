//! Vectors in AVX2 and AVX-512 registers.
//!
//! Outside this module, only [`super::InstructionSet::run`] names `Avx2` and `Avx512`. Generic code receives them only
//! from there. A [`super::InstructionSet`] exists only for an instruction set that was detected on this machine. So
//! code that holds a vector of a set may use the instructions of that set.

#![expect(
    unsafe_code,
    reason = "vector instructions that the machine was found to have"
)]

use super::{Eight, Halves, Isa, Lanes, Outlined, PlaneVector};
use bvh_layout::Link;
use geom::Point;
use std::arch::is_x86_feature_detected as has;
use std::arch::x86_64::*;

/// 256-bit registers.
pub(super) struct Avx2;
/// 512-bit registers, and mask registers also for shorter vectors.
pub(super) struct Avx512;

impl Isa for Avx2 {
    type Eight = Ymm;
    type Planes = YmmPair;
    type Packet = Ymm;

    #[inline(always)]
    fn outlined<P: Outlined<Self>>(part: P) -> P::Out {
        #[inline(never)]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn inside<P: Outlined<Avx2>>(part: P) -> P::Out {
            part.run()
        }
        // SAFETY: generic code receives this set only from `InstructionSet::run`. The set's `InstructionSet` exists
        // only if `has_avx2` returned `true`.
        unsafe { inside(part) }
    }
}

impl Isa for Avx512 {
    type Eight = MaskedYmm;
    type Planes = Zmm;
    type Packet = Zmm;

    #[inline(always)]
    fn outlined<P: Outlined<Self>>(part: P) -> P::Out {
        #[inline(never)]
        #[target_feature(
            enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,lzcnt,popcnt"
        )]
        fn inside<P: Outlined<Avx512>>(part: P) -> P::Out {
            part.run()
        }
        // SAFETY: generic code receives this set only from `InstructionSet::run`. The set's `InstructionSet` exists
        // only if `has_avx512` returned `true`.
        unsafe { inside(part) }
    }

    #[inline(always)]
    fn packed(of: &[Link; 8], lanes: u32) -> [Link; 8] {
        let mut to = *of;
        // SAFETY: `Link` is a transparent `u32`, so source and destination are eight 32-bit numbers. The instructions
        // are available wherever this set is used.
        unsafe {
            let words = _mm256_loadu_si256(of.as_ptr().cast());
            let packed = _mm256_maskz_compress_epi32(lanes as u8, words);
            _mm256_storeu_si256(to.as_mut_ptr().cast(), packed);
        }
        to
    }
}

pub(super) fn has_avx2() -> bool {
    has!("avx2") && has!("fma") && has!("bmi1") && has!("bmi2") && has!("lzcnt") && has!("popcnt")
}

pub(super) fn has_avx512() -> bool {
    has_avx2() && has!("avx512f") && has!("avx512vl") && has!("avx512dq") && has!("avx512bw")
}

/// Defines lane operations from expressions with intrinsics.
macro_rules! operation {
    ($( $name:ident ( $($arguments:tt)* ) -> $result:ty = $body:expr; )*) => { $(
        #[inline(always)]
        fn $name($($arguments)*) -> $result {
            #[allow(unused_unsafe, reason = "some need no instruction of the set")]
            // SAFETY: the set's vectors exist only within `Isa::outlined` of the set. Arrays are as long as the
            // vectors, and loads and stores are unaligned.
            unsafe { $body }
        }
    )* };
}

/// Defines a vector type by its register, its length, its masks and its instructions.
macro_rules! vector {
    ($(#[$doc:meta])* $name:ident = $register:ty, $count:literal, $mask:ty;
     $load:ident $store:ident $splat:ident $add:ident $sub:ident $mul:ident $div:ident $fma:ident $min:ident $max:ident
     $and:ident $xor:ident; $($rest:tt)*) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(crate) struct $name($register);

        impl PlaneVector for $name {
            type Array = [f32; $count];
            operation! {
                splat(x: f32) -> Self = Self($splat(x));
                load(from: &[f32; $count]) -> Self = Self($load(from.as_ptr()));
                sub(self, b: Self) -> Self = Self($sub(self.0, b.0));
                mul(self, b: Self) -> Self = Self($mul(self.0, b.0));
                min(self, b: Self) -> Self = Self($min(self.0, b.0));
                max(self, b: Self) -> Self = Self($max(self.0, b.0));
            }
        }

        impl Lanes for $name {
            type Mask = $mask;
            const ALL: u32 = (1 << $count) - 1;
            operation! {
                add(self, b: Self) -> Self = Self($add(self.0, b.0));
                div(self, b: Self) -> Self = Self($div(self.0, b.0));
                mul_add_approximate(self, by: Self, plus: Self) -> Self = Self($fma(self.0, by.0, plus.0));
                abs(self) -> Self = Self($and(self.0, $splat(f32::from_bits(0x7fff_ffff))));
                power(self) -> Self = Self($and(self.0, $splat(f32::INFINITY)));
                neg(self) -> Self = Self($xor(self.0, $splat(-0.0)));
                store(self) -> [f32; $count] = {
                    let mut to = [0.0; $count];
                    $store(to.as_mut_ptr(), self.0);
                    to
                };
            }
            operation! { $($rest)* }
        }
    };
}

/// Returns the least of eight numbers.
#[inline]
#[target_feature(enable = "avx2")]
fn least(x: __m256) -> f32 {
    let x = _mm_min_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps::<1>(x));
    let x = _mm_min_ps(x, _mm_movehl_ps(x, x));
    _mm_cvtss_f32(_mm_min_ss(x, _mm_movehdup_ps(x)))
}

/// Transposes eight points. Loads whole points into registers. If scalar stores wrote the coordinates to an array
/// first, a vector load of that array would stall.
#[inline]
#[target_feature(enable = "avx2")]
fn coordinates(points: [&Point; 8]) -> [__m256; 3] {
    let three = _mm_setr_epi32(-1, -1, -1, 0);
    // Loads point `$i` into the lower half and point `$i + 4` into the upper half.
    macro_rules! two {
        ($i:literal) => {{
            // SAFETY: the mask limits each load to three numbers, and a point has three.
            let [low, high] = unsafe {
                [
                    _mm_maskload_ps(points[$i].as_ptr(), three),
                    _mm_maskload_ps(points[$i + 4].as_ptr(), three),
                ]
            };
            _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high)
        }};
    }
    let [a, b, c, d] = [two!(0), two!(1), two!(2), two!(3)];
    let (xy_ab, xy_cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
    let (z_ab, z_cd) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
    [
        _mm256_shuffle_ps::<0x44>(xy_ab, xy_cd),
        _mm256_shuffle_ps::<0xee>(xy_ab, xy_cd),
        _mm256_shuffle_ps::<0x44>(z_ab, z_cd),
    ]
}

#[inline]
#[target_feature(enable = "avx2")]
fn permuted(x: __m256, lanes: &[u8; 8]) -> __m256 {
    // SAFETY: the load reads eight bytes, and `lanes` has eight.
    let lanes = unsafe { _mm_loadl_epi64(lanes.as_ptr().cast()) };
    _mm256_permutevar8x32_ps(x, _mm256_cvtepu8_epi32(lanes))
}

#[inline]
#[target_feature(enable = "avx2")]
fn maxi(a: __m256, b: __m256) -> __m256 {
    let (a, b) = (_mm256_castps_si256(a), _mm256_castps_si256(b));
    _mm256_castsi256_ps(_mm256_max_epi32(a, b))
}

#[inline]
#[target_feature(enable = "avx2")]
fn mini(a: __m256, b: __m256) -> __m256 {
    let (a, b) = (_mm256_castps_si256(a), _mm256_castps_si256(b));
    _mm256_castsi256_ps(_mm256_min_epi32(a, b))
}

/// Implements the operations that both types of eight numbers share.
macro_rules! eight {
    ($name:ident) => {
        impl Eight for $name {
            operation! {
                coordinates(points: [&Point; 8]) -> [Self; 3] = {
                    let [x, y, z] = coordinates(points);
                    [Self(x), Self(y), Self(z)]
                };
                maxi(self, b: Self) -> Self = Self(maxi(self.0, b.0));
                mini(self, b: Self) -> Self = Self(mini(self.0, b.0));
                permuted(self, lanes: &[u8; 8]) -> Self = Self(permuted(self.0, lanes));
            }
        }
    };
}
eight!(Ymm);
eight!(MaskedYmm);

vector! {
    /// Eight numbers with vectors as masks.
    Ymm = __m256, 8, __m256;
    _mm256_loadu_ps _mm256_storeu_ps _mm256_set1_ps _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps
    _mm256_fmadd_ps _mm256_min_ps _mm256_max_ps _mm256_and_ps _mm256_xor_ps;
    less(self, b: Self) -> __m256 = _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, b.0);
    at_most(self, b: Self) -> __m256 = _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, b.0);
    replace(self, mask: __m256, b: Self) -> Self = Self(_mm256_blendv_ps(self.0, b.0, mask));
    both(a: __m256, b: __m256) -> __m256 = _mm256_and_ps(a, b);
    either(a: __m256, b: __m256) -> __m256 = _mm256_or_ps(a, b);
    bits(mask: __m256) -> u32 = _mm256_movemask_ps(mask) as u32;
    mask(bits: u32) -> __m256 = {
        let each = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), each);
        _mm256_castsi256_ps(_mm256_cmpeq_epi32(set, each))
    };
    least(self) -> f32 = least(self.0);
    most(self) -> f32 = -least(_mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)));
    put(words: &mut [u32; 16], mask: __m256, word: u32) -> () = {
        let (word, mask) = (_mm256_set1_epi32(word as i32), _mm256_castps_si256(mask));
        _mm256_maskstore_epi32(words.as_mut_ptr().cast(), mask, word);
    };
}

vector! {
    /// Eight numbers with bits as masks.
    MaskedYmm = __m256, 8, __mmask8;
    _mm256_loadu_ps _mm256_storeu_ps _mm256_set1_ps _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps
    _mm256_fmadd_ps _mm256_min_ps _mm256_max_ps _mm256_and_ps _mm256_xor_ps;
    less(self, b: Self) -> __mmask8 = _mm256_cmp_ps_mask::<_CMP_LT_OQ>(self.0, b.0);
    at_most(self, b: Self) -> __mmask8 = _mm256_cmp_ps_mask::<_CMP_LE_OQ>(self.0, b.0);
    replace(self, mask: __mmask8, b: Self) -> Self = Self(_mm256_mask_blend_ps(mask, self.0, b.0));
    both(a: __mmask8, b: __mmask8) -> __mmask8 = a & b;
    either(a: __mmask8, b: __mmask8) -> __mmask8 = a | b;
    bits(mask: __mmask8) -> u32 = u32::from(mask);
    mask(bits: u32) -> __mmask8 = bits as u8;
    least(self) -> f32 = least(self.0);
    most(self) -> f32 = -least(_mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)));
    put(words: &mut [u32; 16], mask: __mmask8, word: u32) -> () =
        _mm256_mask_storeu_epi32(words.as_mut_ptr().cast(), mask, _mm256_set1_epi32(word as i32));
}

vector! {
    /// Sixteen numbers with bits as masks.
    Zmm = __m512, 16, __mmask16;
    _mm512_loadu_ps _mm512_storeu_ps _mm512_set1_ps _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps
    _mm512_fmadd_ps _mm512_min_ps _mm512_max_ps _mm512_and_ps _mm512_xor_ps;
    less(self, b: Self) -> __mmask16 = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, b.0);
    at_most(self, b: Self) -> __mmask16 = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, b.0);
    replace(self, mask: __mmask16, b: Self) -> Self = Self(_mm512_mask_blend_ps(mask, self.0, b.0));
    both(a: __mmask16, b: __mmask16) -> __mmask16 = a & b;
    either(a: __mmask16, b: __mmask16) -> __mmask16 = a | b;
    bits(mask: __mmask16) -> u32 = u32::from(mask);
    mask(bits: u32) -> __mmask16 = bits as u16;
    least(self) -> f32 = _mm512_reduce_min_ps(self.0);
    most(self) -> f32 = _mm512_reduce_max_ps(self.0);
    put(words: &mut [u32; 16], mask: __mmask16, word: u32) -> () =
        _mm512_mask_storeu_epi32(words.as_mut_ptr().cast(), mask, _mm512_set1_epi32(word as i32));
}

impl Halves for Zmm {
    type Half = MaskedYmm;
    operation! {
        turned(self, turn: bool) -> Self = {
            let half = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
            let by = _mm512_set1_epi32(if turn { 8 } else { 0 });
            Self(_mm512_permutexvar_ps(_mm512_xor_si512(half, by), self.0))
        };
        low(self) -> MaskedYmm = MaskedYmm(_mm512_castps512_ps256(self.0));
        high(self) -> MaskedYmm = MaskedYmm(_mm512_extractf32x8_ps::<1>(self.0));
        join(low: MaskedYmm, high: MaskedYmm) -> Self =
            Self(_mm512_insertf32x8::<1>(_mm512_castps256_ps512(low.0), high.0));
    }
}

/// Sixteen numbers in two registers.
#[derive(Clone, Copy)]
pub(crate) struct YmmPair(Ymm, Ymm);

/// Defines operations that apply to both registers.
macro_rules! twice {
    ($( $name:ident; )*) => { $(
        #[inline(always)]
        fn $name(self, other: Self) -> Self {
            Self(self.0.$name(other.0), self.1.$name(other.1))
        }
    )* };
}

impl PlaneVector for YmmPair {
    type Array = [f32; 16];

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self(Ymm::splat(x), Ymm::splat(x))
    }
    #[inline(always)]
    fn load(from: &[f32; 16]) -> Self {
        let (parts, _) = from.as_chunks::<8>();
        Self(Ymm::load(&parts[0]), Ymm::load(&parts[1]))
    }
    twice! { sub; mul; min; max; }
}

impl Halves for YmmPair {
    type Half = Ymm;

    #[inline(always)]
    fn turned(self, turn: bool) -> Self {
        let mask = Ymm::mask(if turn { 255 } else { 0 });
        Self(self.0.replace(mask, self.1), self.1.replace(mask, self.0))
    }
    #[inline(always)]
    fn low(self) -> Ymm {
        self.0
    }
    #[inline(always)]
    fn high(self) -> Ymm {
        self.1
    }
    #[inline(always)]
    fn join(low: Ymm, high: Ymm) -> Self {
        Self(low, high)
    }
}
