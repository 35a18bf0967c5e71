//! Rays that go through the wide tree each on its own, prepared alone or as many at once as fit in a vector.

use crate::leaf::{flushed, scaled};
use crate::packet::{farthest, main_axes};
use crate::simd::{Lanes, Plain, each};
use crate::together::MOST_RAYS;
use cpu_ref::intersect::main_axis;
use cpu_ref::ray::PreparedRay;
use cpu_ref::scale::{LEAST_COMPONENT, Scale};
use cpu_ref::slab::{CALM, PAD, Reach, SMALLEST};
use geom::{Aabb, Ray};

/// `24` and `4` times `2^-24`: what boxes of inner nodes are widened by, in units of `D` and of `|o'|`, where they are
/// tested with `plane * r - o' * r` (`docs/design/hits.md`, "Inner boxes").
const INNER: [f32; 2] = [24.0 / 16_777_216.0, 4.0 / 16_777_216.0];

/// Biased exponents of directions that are prepared here; the rest is left to [`PreparedRay`].
const USUAL: std::ops::RangeInclusive<u32> = 127 - 60..=127 + 60;

/// As many rays as `L` has lanes, prepared just as [`PreparedRay`] and [`Reach`] do. Axes in their own order.
pub(crate) struct Group<L: Lanes> {
    /// Lanes that hold a prepared ray. The others hold one that misses, or is unusual.
    pub(crate) ready: u32,
    pub(crate) origin: [L::Array; 3],
    /// `r`, with the direction's sign.
    pub(crate) inverse: [L::Array; 3],
    /// `q`.
    pub(crate) pad: [L::Array; 3],
    /// What is added to the products of `r` with a box's near and far plane of an inner node.
    starts: [[L::Array; 2]; 3],
    /// `d[kx] / d[kz]`, `d[ky] / d[kz]`, `1 / d[kz]`.
    pub(crate) shear: [L::Array; 3],
    /// `kz`.
    main: [u8; MOST_RAYS],
    pub(crate) limits: [L::Array; 2],
    /// Brings distances to the units of the given ray.
    pub(crate) back: L::Array,
}

/// Rays lane by lane, as they were given.
pub(crate) struct Given<L> {
    pub(crate) origin: [L; 3],
    pub(crate) direction: [L; 3],
    /// `t_min` and `t_max`.
    pub(crate) limits: [L; 2],
}

impl<L: Lanes> Given<L> {
    /// Neighbours in a list; lanes beyond its end hold rays that cannot hit anything.
    #[inline(always)]
    pub(crate) fn listed(rays: &[Ray]) -> Self {
        let spare = L::splat(0.0).store();
        let (mut origin, mut direction, mut limits) = ([spare; 3], [spare; 3], [spare; 2]);
        let lanes = L::ALL.count_ones() as usize;
        for (lane, ray) in rays.iter().enumerate().take(lanes) {
            for axis in 0..3 {
                origin[axis].as_mut()[lane] = ray.origin[axis];
                direction[axis].as_mut()[lane] = ray.direction[axis];
            }
            limits[0].as_mut()[lane] = ray.t_min;
            limits[1].as_mut()[lane] = ray.t_max;
        }
        Self {
            origin: each!(i => L::load(&origin[i])),
            direction: each!(i => L::load(&direction[i])),
            limits: [L::load(&limits[0]), L::load(&limits[1])],
        }
    }

    /// The ray in one lane.
    #[cold]
    pub(crate) fn ray(&self, lane: usize) -> Ray {
        let at = |x: L| x.store().as_ref()[lane];
        Ray {
            origin: self.origin.map(at),
            t_min: at(self.limits[0]),
            direction: self.direction.map(at),
            t_max: at(self.limits[1]),
        }
    }

    /// [`Scale::apply`] of all starts.
    #[inline(always)]
    pub(crate) fn scaled_origin(&self, scale: Scale) -> [L; 3] {
        each!(i => scaled(scale, self.origin[i]))
    }

    /// Lanes whose numbers are finite, but for the limits, and in order.
    #[inline(always)]
    fn sound(&self) -> u32 {
        let mut size = L::splat(0.0);
        for axis in 0..3 {
            size = size
                .add(self.origin[axis].abs())
                .add(self.direction[axis].abs());
        }
        let finite = size.less(L::splat(f32::INFINITY));
        L::bits(L::both(finite, self.limits[0].less(self.limits[1])))
    }
}

/// Powers of two by the exponent `e` of each lane's longest component.
struct Powers<L> {
    /// `2^e`.
    up: L,
    /// `2^-e`.
    down: L,
    /// Lanes whose exponent is usual.
    usual: u32,
}

impl<L: Lanes> Powers<L> {
    #[inline(always)]
    fn of([x, y, z]: &[L; 3]) -> Self {
        let mut up = x.abs().max(y.abs()).max(z.abs()).store();
        let (mut down, mut usual) = (up, 0);
        let both = up.as_mut().iter_mut().zip(down.as_mut());
        for (lane, (up, down)) in both.enumerate() {
            let biased = up.to_bits() >> 23;
            usual |= u32::from(USUAL.contains(&biased)) << lane;
            *up = f32::from_bits(biased << 23);
            *down = f32::from_bits(254_u32.wrapping_sub(biased) << 23);
        }
        Self {
            up: L::load(&up),
            down: L::load(&down),
            usual,
        }
    }
}

impl<L: Lanes> Group<L> {
    /// Rays over the first lanes of `L`; those beyond are left alone. The tree's whole box is `root`.
    #[inline(always)]
    pub(crate) fn new(given: &Given<L>, scale: Scale, root: &Aabb) -> Self {
        let powers = Powers::of(&given.direction);
        let origin = given.scaled_origin(scale);
        let d = each!(i => {
            let d = given.direction[i].mul(powers.down);
            d.replace(d.abs().less(L::splat(LEAST_COMPONENT)), L::splat(0.0))
        });
        let farthest = farthest(&origin, root);
        let calm = L::bits(farthest.less(L::splat(CALM)));
        let padding = L::splat(PAD).mul(farthest);
        let inverse = each!(i => L::splat(1.0).div(d[i].abs().max(L::splat(SMALLEST))));
        let pad = each!(i => inverse[i].mul(padding));
        let negative = each!(i => d[i].less(L::splat(0.0)));
        let signed = each!(i => inverse[i].replace(negative[i], inverse[i].neg()));
        let starts = each!(i => {
            let from = origin[i].mul(signed[i]).neg();
            let wide = L::splat(INNER[0]).mul(farthest).add(L::splat(INNER[1]).mul(origin[i].abs()));
            let wide = inverse[i].mul(wide);
            [from.sub(wide).store(), from.add(wide).store()]
        });
        let up = powers.up.mul(L::splat(scale.factor()));
        let limits = given.limits;
        let (main, shear) = turned(&d);
        let unscaled = scale.usual_inverse();
        let back = powers.down.mul(L::splat(unscaled.unwrap_or(1.0)));
        let ready = given.sound() & powers.usual & calm;
        Self {
            ready: if unscaled.is_some() { ready } else { 0 },
            origin: each!(i => origin[i].store()),
            inverse: each!(i => signed[i].store()),
            pad: each!(i => pad[i].store()),
            starts,
            shear: each!(i => shear[i].store()),
            main,
            limits: [
                flushed(limits[0].mul(up)).store(),
                flushed(limits[1].mul(up)).store(),
            ],
            back: back.store(),
        }
    }

    /// `kz`, where all lanes hold a prepared ray and have the same.
    #[inline(always)]
    pub(crate) fn main_of_all(&self) -> Option<usize> {
        let main = self.main[0];
        let lanes = &self.main[..L::ALL.count_ones() as usize];
        let same = self.ready == L::ALL && lanes.iter().all(|&kz| kz == main);
        same.then_some(usize::from(main))
    }
}

impl Group<Plain<1>> {
    /// One ray, whatever it is like. Distances stay in its own units.
    #[inline]
    pub(crate) fn alone(ray: &PreparedRay, root: &Aabb) -> Self {
        let reach = Reach::new(ray, root);
        let (origin, d) = (ray.origin, ray.direction);
        let kz = main_axis(d);
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        let inverse = each!(i => reach.inverse[i].copysign(d[i]));
        // Infinite only where the box test's products are: a start so far away is its own distance to any plane.
        let starts = each!(i => {
            let from = -(origin[i] * inverse[i]);
            let wide = INNER[0] * reach.farthest + INNER[1] * origin[i].abs();
            let wide = reach.inverse[i] * wide;
            [[from - wide], [from + wide]]
        });
        Self {
            ready: 1,
            origin: origin.map(|x| [x]),
            inverse: inverse.map(|x| [x]),
            pad: reach.pad.map(|x| [x]),
            starts,
            shear: [[d[kx] / d[kz]], [d[ky] / d[kz]], [1.0 / d[kz]]],
            main: [kz as u8; MOST_RAYS],
            limits: [[ray.t_min], [ray.t_max]],
            back: [1.0],
        }
    }
}

/// The ray in one lane of a group, read where it lies: a copy would keep all of it in registers during the traversal.
pub(crate) struct OneRay<'a, L: Lanes> {
    pub(crate) group: &'a Group<L>,
    pub(crate) lane: usize,
}

impl<L: Lanes> OneRay<'_, L> {
    #[inline(always)]
    pub(crate) fn origin(&self, axis: usize) -> f32 {
        self.group.origin[axis].as_ref()[self.lane]
    }
    #[inline(always)]
    pub(crate) fn inverse(&self, axis: usize) -> f32 {
        self.group.inverse[axis].as_ref()[self.lane]
    }
    #[inline(always)]
    pub(crate) fn pad(&self, axis: usize) -> f32 {
        self.group.pad[axis].as_ref()[self.lane]
    }
    #[inline(always)]
    pub(crate) fn starts(&self, axis: usize) -> [f32; 2] {
        let [near, far] = &self.group.starts[axis];
        [near.as_ref()[self.lane], far.as_ref()[self.lane]]
    }
    #[inline(always)]
    pub(crate) fn main(&self) -> usize {
        usize::from(self.group.main[self.lane])
    }
    #[inline(always)]
    pub(crate) fn shear(&self, i: usize) -> f32 {
        self.group.shear[i].as_ref()[self.lane]
    }
    #[inline(always)]
    pub(crate) fn t_min(&self) -> f32 {
        self.group.limits[0].as_ref()[self.lane]
    }
    #[inline(always)]
    pub(crate) fn t_max(&self) -> f32 {
        self.group.limits[1].as_ref()[self.lane]
    }

    /// A distance in units of the given ray's direction. A zero is a positive one.
    #[inline(always)]
    pub(crate) fn unscaled(&self, t: f32) -> f32 {
        let t = t * self.group.back.as_ref()[self.lane];
        if t == 0.0 { 0.0 } else { t }
    }
}

/// `kz` and the shear of each lane.
#[inline(always)]
fn turned<L: Lanes>(d: &[L; 3]) -> ([u8; MOST_RAYS], [L; 3]) {
    let [is_x, is_y] = main_axes(d);
    let (along_x, along_y) = (L::mask(is_x), L::mask(is_y));
    let of = each!(i => d[(i + 3) % 3].replace(along_x, d[(i + 1) % 3]).replace(along_y, d[(i + 2) % 3]));
    let mut main = [0; MOST_RAYS];
    for (lane, main) in main.iter_mut().enumerate() {
        let is_z = !(is_x | is_y) >> lane & 1;
        *main = (2 * is_z + (is_y >> lane & 1)) as u8;
    }
    let shear = [of[0].div(of[2]), of[1].div(of[2]), L::splat(1.0).div(of[2])];
    (main, shear)
}
