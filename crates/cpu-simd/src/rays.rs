//! Rays, prepared for traversal of the wide tree in groups of one ray per lane.

use crate::simd::{Lanes, Plain, PlaneVector, each};
use crate::tiles::Tiles;
use crate::units::{flushed, scaled};
use cpu_ref::scale::{MIN_NONZERO_COMPONENT, PreparedRay, Scale};
use cpu_ref::{
    MAX_FINITE_PRODUCT_DISTANCE, MAX_PADDING_DISTANCE, MIN_DIRECTION, MIN_PADDING_DISTANCE, PAD,
};
use geom::{Aabb, Camera, Ray};

/// Number of rays of the widest packet.
pub(crate) const MOST_RAYS: usize = 16;

/// Padding of the boxes of inner nodes: `24 * 2^-24` of the root box's distance `D` (see [`PAD`]), and `4 * 2^-24` of
/// `|o'|`, the ray's origin in scaled units. It covers the roundings of `plane * r - o' * r` (`docs/design/hits.md`,
/// "Inner boxes").
const INNER: [f32; 2] = [24.0 / 16_777_216.0, 4.0 / 16_777_216.0];

/// Least and greatest `2^e`, where `e` is the exponent of a direction's largest component. `cpu-ref` traces other rays.
const USUAL: [f32; 2] = [1.0 / TWO_TO_60, TWO_TO_60];
const TWO_TO_60: f32 = (1_u64 << 60) as f32;

/// One ray per lane of `L`, prepared with the same results as [`PreparedRay`] and the box test of `cpu-ref`. Axes are
/// in the order x, y, z.
pub(crate) struct PreparedRays<L: Lanes> {
    /// Lanes that hold a prepared ray. Other lanes hold invalid rays, or rays that `cpu-ref` must trace because their
    /// direction, their distance or the scene's scale is outside the limits of the vector code (`USUAL`,
    /// `MAX_FINITE_PRODUCT_DISTANCE`, `Scale::usual_inverse`).
    pub(crate) ready: u32,
    pub(crate) origin: [L::Array; 3],
    pub(crate) direction: [L::Array; 3],
    /// Reciprocal of the direction, `r`, with the direction's sign.
    pub(crate) inverse: [L::Array; 3],
    /// Padding `q` of the root box, which is at least the padding of any box.
    pub(crate) pad: [L::Array; 3],
    /// Terms that are added to `plane * r` in tests of inner boxes, for near and for far planes: `-o' * r`, minus or
    /// plus the padding.
    pub(crate) starts: [[L::Array; 2]; 3],
    /// `d[kx] / d[kz]`, `d[ky] / d[kz]`, `1 / d[kz]`.
    pub(crate) shear: [L::Array; 3],
    /// Main axis `kz`: the axis of the direction's largest component.
    main: [u32; MOST_RAYS],
    pub(crate) limits: [L::Array; 2],
    /// Factor from prepared distances to units of the caller's ray.
    pub(crate) back: L::Array,
}

/// Rays as passed by the caller, one per lane.
pub(crate) struct InputRays<L> {
    pub(crate) origin: [L; 3],
    pub(crate) direction: [L; 3],
    /// `t_min` and `t_max`.
    pub(crate) limits: [L; 2],
}

impl<L: Lanes> InputRays<L> {
    /// Loads neighbouring rays of a list. Lanes beyond the end of the list get rays that hit nothing.
    #[inline(always)]
    pub(crate) fn listed(rays: &[Ray]) -> Self {
        let zeros = L::splat(0.0).store();
        let (mut origin, mut direction, mut limits) = ([zeros; 3], [zeros; 3], [zeros; 2]);
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

    /// Returns the ray in one lane.
    #[cold]
    pub(crate) fn ray(&self, lane: usize) -> Ray {
        self.rays()[lane]
    }

    /// Returns the rays of all lanes.
    #[inline(always)]
    pub(crate) fn rays(&self) -> [Ray; MOST_RAYS] {
        let origin = each!(i => self.origin[i].store());
        let direction = each!(i => self.direction[i].store());
        let [t_min, t_max] = [self.limits[0].store(), self.limits[1].store()];
        let mut rays = [Ray::VOID; MOST_RAYS];
        let lanes = L::ALL.count_ones() as usize;
        for (lane, ray) in rays.iter_mut().enumerate().take(lanes) {
            for axis in 0..3 {
                ray.origin[axis] = origin[axis].as_ref()[lane];
                ray.direction[axis] = direction[axis].as_ref()[lane];
            }
            (ray.t_min, ray.t_max) = (t_min.as_ref()[lane], t_max.as_ref()[lane]);
        }
        rays
    }

    /// Applies [`Scale::apply`] to all origins.
    #[inline(always)]
    pub(crate) fn scaled_origin(&self, scale: Scale) -> [L; 3] {
        each!(i => scaled(scale, self.origin[i]))
    }

    /// Returns the lanes whose limits are in order, and whose origin and direction have a finite sum of magnitudes.
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

/// `2^e` and `2^-e`, where `e` is the exponent of each lane's largest component, and the lanes with `2^e` within
/// `USUAL`.
struct Powers<L> {
    up: L,
    down: L,
    usual: u32,
}

#[inline(always)]
fn powers<L: Lanes>([x, y, z]: &[L; 3]) -> Powers<L> {
    let [least, most] = USUAL.map(L::splat);
    let up = x.abs().max(y.abs()).max(z.abs()).power();
    let usual = L::both(least.at_most(up), up.at_most(most));
    Powers {
        up,
        down: L::splat(1.0).div(up),
        usual: L::bits(usual),
    }
}

impl<L: Lanes> PreparedRays<L> {
    /// Prepares the rays in all lanes of `L`. `root` is the tree's root box.
    #[inline(always)]
    pub(crate) fn new(given: &InputRays<L>, scale: Scale, root: &Aabb) -> Self {
        let Powers { up, down, usual } = powers(&given.direction);
        let origin = given.scaled_origin(scale);
        let direction = each!(i => {
            let d = given.direction[i].mul(down);
            d.replace(d.abs().less(L::splat(MIN_NONZERO_COMPONENT)), L::splat(0.0))
        });
        let farthest = farthest(&origin, root);
        let has_finite_products = L::bits(farthest.less(L::splat(MAX_FINITE_PRODUCT_DISTANCE)));
        let up = up.mul(L::splat(scale.factor()));
        let [t_min, t_max] = given.limits;
        let unscaled = scale.usual_inverse();
        let scaled = InputRays {
            origin,
            direction,
            limits: [flushed(t_min.mul(up)), flushed(t_max.mul(up))],
        };
        let mut group = Self::prepared(&scaled, farthest);
        let ready = given.sound() & usual & has_finite_products;
        group.ready = if unscaled.is_some() { ready } else { 0 };
        group.back = down.mul(L::splat(unscaled.unwrap_or(1.0))).store();
        group
    }

    /// Prepares rays in scaled units for tests with boxes and triangles. Distances keep the units of `rays`.
    #[inline(always)]
    fn prepared(rays: &InputRays<L>, farthest: L) -> Self {
        let (origin, d) = (&rays.origin, &rays.direction);
        let padding = L::splat(PAD).mul(farthest);
        let inverse = each!(i => L::splat(1.0).div(d[i].abs().max(L::splat(MIN_DIRECTION))));
        let negative = each!(i => d[i].less(L::splat(0.0)));
        let signed = each!(i => inverse[i].replace(negative[i], inverse[i].neg()));
        // At extreme moments, `starts` is unused. At others, it overflows only if the origin is so far away that
        // `plane - origin` rounds to `-origin` for every plane. Then `(plane - origin) * inverse` of the box test is
        // the same product and overflows too.
        let starts = each!(i => {
            let from = origin[i].mul(signed[i]).neg();
            let wide = L::splat(INNER[0]).mul(farthest).add(L::splat(INNER[1]).mul(origin[i].abs()));
            let wide = inverse[i].mul(wide);
            [from.sub(wide).store(), from.add(wide).store()]
        });
        let Shears { main, shear } = shears(d, &signed);
        Self {
            ready: L::ALL,
            origin: each!(i => origin[i].store()),
            direction: each!(i => d[i].store()),
            inverse: each!(i => signed[i].store()),
            pad: each!(i => inverse[i].mul(padding).store()),
            starts,
            shear: each!(i => shear[i].store()),
            main,
            limits: [rays.limits[0].store(), rays.limits[1].store()],
            back: L::splat(1.0).store(),
        }
    }

    /// Returns the main axis if it is the same in all lanes and all lanes are ready.
    #[inline(always)]
    pub(crate) fn main_of_all(&self) -> Option<usize> {
        let main = self.main[0];
        let lanes = &self.main[..L::ALL.count_ones() as usize];
        let same = lanes
            .iter()
            .fold(self.ready == L::ALL, |same, &kz| same & (kz == main));
        same.then_some(main as usize)
    }
}

impl PreparedRays<Plain<1>> {
    /// Prepares one ray, which need not be within the limits of [`PreparedRays::ready`]. Distances keep the units of
    /// `ray`.
    #[inline]
    pub(crate) fn alone(ray: &PreparedRay, root: &Aabb) -> Self {
        let rays = InputRays {
            origin: ray.origin.map(Plain::splat),
            direction: ray.direction.map(Plain::splat),
            limits: [ray.t_min, ray.t_max].map(Plain::splat),
        };
        let farthest = farthest(&rays.origin, root);
        Self::prepared(&rays, farthest.min(Plain::splat(MAX_PADDING_DISTANCE)))
    }
}

/// The ray in one lane of a group. Reads from the group, because a copy would occupy registers during the traversal.
pub(crate) struct OneRay<'a, L: Lanes> {
    pub(crate) group: &'a PreparedRays<L>,
    pub(crate) lane: usize,
}

impl<L: Lanes> OneRay<'_, L> {
    #[inline(always)]
    pub(crate) fn at(&self, lanes: &L::Array) -> f32 {
        lanes.as_ref()[self.lane]
    }

    /// Returns `kz`.
    #[inline(always)]
    pub(crate) fn main(&self) -> usize {
        self.group.main[self.lane] as usize
    }

    #[inline(always)]
    pub(crate) fn t_max(&self) -> f32 {
        self.at(&self.group.limits[1])
    }

    /// Converts a distance to units of the caller's ray. A zero result is `+0`.
    #[inline(always)]
    pub(crate) fn unscaled(&self, t: f32) -> f32 {
        let t = t * self.at(&self.group.back);
        if t == 0.0 { 0.0 } else { t }
    }
}

/// Computes the distance `D` of the root box for each lane. See [`PAD`].
#[inline(always)]
fn farthest<L: Lanes>(origin: &[L; 3], root: &Aabb) -> L {
    let mut farthest = L::splat(MIN_PADDING_DISTANCE);
    for (axis, &o) in origin.iter().enumerate() {
        for plane in [root.min[axis], root.max[axis]] {
            farthest = farthest.max(L::splat(plane).sub(o).abs());
        }
    }
    farthest
}

/// The main axis `kz` of each lane, and the shear that aligns the ray with this axis.
struct Shears<L> {
    main: [u32; MOST_RAYS],
    shear: [L; 3],
}

/// Returns the axis of the largest component of `d`, the first of equals, and the shear. The third number of the shear
/// is taken from `r`, the signed reciprocals.
#[inline(always)]
fn shears<L: Lanes>(d: &[L; 3], r: &[L; 3]) -> Shears<L> {
    let [x, y, z] = each!(i => d[i].abs());
    let along_x = L::both(y.at_most(x), z.at_most(x));
    let along_y = z.at_most(y);
    let mut main = [2; MOST_RAYS];
    L::put(&mut main, along_y, 1);
    L::put(&mut main, along_x, 0);
    let of = each!(i => d[i].replace(along_y, d[(i + 2) % 3]).replace(along_x, d[(i + 1) % 3]));
    let inverse = r[2].replace(along_y, r[1]).replace(along_x, r[0]);
    Shears {
        main,
        shear: [of[0].div(of[2]), of[1].div(of[2]), inverse],
    }
}

/// Columns of a cell of pixels. The number of rows follows from the number of lanes.
pub(crate) const COLUMNS: usize = 4;

/// A few columns and rows of a picture. Lanes are assigned to pixels row by row. Lanes beyond the edge of the picture
/// repeat the last row or column.
pub(crate) struct Cell {
    /// Lanes within the picture.
    pub(crate) active: u32,
    /// Upper left pixel.
    corner: [usize; 2],
    /// The last pixel of the cell within the picture.
    last: [usize; 2],
}

impl Cell {
    /// Creates the cell with its upper left entry at `at` of `tiles`.
    #[inline(always)]
    pub(crate) fn new(tiles: &Tiles<'_>, at: [usize; 2], rows: usize) -> Self {
        let (index, width) = (tiles.index(at[0], at[1]), tiles.width);
        let corner = [index % width, index / width];
        let columns = COLUMNS.min(tiles.columns() - at[0]);
        let rows = rows.min(tiles.height() - at[1]);
        let row = (1 << columns) - 1;
        let mut active = 0;
        for y in 0..rows {
            active |= row << (y * COLUMNS);
        }
        Self {
            active,
            corner,
            last: [corner[0] + columns - 1, corner[1] + rows - 1],
        }
    }

    #[inline(always)]
    fn pixel(&self, lane: usize) -> [usize; 2] {
        let (x, y) = (lane % COLUMNS, lane / COLUMNS);
        [
            (self.corner[0] + x).min(self.last[0]),
            (self.corner[1] + y).min(self.last[1]),
        ]
    }

    /// Returns the camera's rays, equal to those of [`Camera::ray`].
    #[inline(always)]
    pub(crate) fn rays<L: Lanes>(&self, camera: &Camera) -> InputRays<L> {
        InputRays {
            origin: each!(i => L::splat(camera.eye[i])),
            direction: self.directions(camera),
            limits: [L::splat(0.0), L::splat(f32::INFINITY)],
        }
    }

    #[inline(always)]
    fn directions<L: Lanes>(&self, camera: &Camera) -> [L; 3] {
        let (mut x, mut y) = (L::splat(0.0).store(), L::splat(0.0).store());
        for lane in 0..L::ALL.count_ones() as usize {
            let pixel = self.pixel(lane);
            x.as_mut()[lane] = pixel[0] as f32 + 0.5;
            y.as_mut()[lane] = pixel[1] as f32 + 0.5;
        }
        let (x, y) = (L::load(&x), L::load(&y));
        each!(i => {
            L::splat(camera.corner[i])
                .add(x.mul(L::splat(camera.across[i])))
                .add(y.mul(L::splat(camera.down[i])))
        })
    }
}
