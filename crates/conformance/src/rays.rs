//! Rays of every sort, some aimed with care.

use crate::places::Placement;
use geom::{Animation, Point, Ray};

/// What a ray was made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// From a point aimed at from elsewhere, in any direction.
    StartsOnTarget,
    /// From a vertex along an edge.
    AlongEdge,
    /// Along an axis; the other components are zeros of either sign.
    AlongAxis,
    /// One component of the direction is a zero of either sign.
    ZeroComponent,
    /// Components of the direction are of very different size.
    Lopsided,
    /// Hits near one end of the interval count, others not.
    Interval,
    /// The interval ends at the target itself.
    EndsOnTarget,
    /// The interval begins behind the origin.
    Behind,
    /// From somewhere to the target.
    Aimed,
    /// The same from very far away.
    FromAfar,
    /// The direction is very short.
    Short,
    /// The direction is very long.
    Long,
    /// The direction is subnormal.
    Subnormal,
    /// Can hit nothing: [`Ray::is_valid`] says so.
    Void,
    /// Given by hand.
    Given,
}

/// Those that are aimed.
const AIMED: [Family; 13] = [
    Family::StartsOnTarget,
    Family::AlongEdge,
    Family::AlongAxis,
    Family::ZeroComponent,
    Family::Lopsided,
    Family::Interval,
    Family::EndsOnTarget,
    Family::Behind,
    Family::Aimed,
    Family::FromAfar,
    Family::Short,
    Family::Long,
    Family::Subnormal,
];

/// Sorts of target, and rays of each family at each of them.
const TARGETS: usize = 5;
const EACH: usize = 2;
/// Rays that are aimed.
pub(crate) const COUNT: usize = AIMED.len() * TARGETS * EACH;

/// Rays with what each is for. `units` and `picks` are [`COUNT`] choices each.
pub(crate) fn rays(
    animation: &Animation,
    place: Placement,
    units: &[Point],
    picks: &[u32],
) -> Vec<(Family, Ray)> {
    let mut rays = Vec::new();
    for (n, (&unit, &pick)) in units.iter().zip(picks).enumerate() {
        let family = AIMED[n % AIMED.len()];
        let [at, next] = target(animation, place, n / AIMED.len(), pick, unit);
        let aim = Aim {
            from: place.at(unit, 3.0),
            at,
            next,
            scale: place.scale,
            unit,
            pick,
        };
        rays.push((family, aim.ray(family)));
    }
    rays.extend(void_rays(place).map(|ray| (Family::Void, ray)));
    rays
}

/// A point to aim at, and another to which an edge leads from there: a vertex,
/// a point on an edge, a point in a triangle, or just a point.
fn target(animation: &Animation, place: Placement, n: usize, pick: u32, unit: Point) -> [Point; 2] {
    let anywhere = || [place.at(unit, 1.0), place.at([0.0; 3], 1.0)];
    let count = animation.triangle_count() as u32;
    if count == 0 || n % TARGETS == 4 {
        return anywhere();
    }
    let [a, b, c] = animation.corners(animation.pose(1.0), pick % count);
    let [s, t] = [0.5 * (1.0 + unit[0]), 0.5 * (1.0 + unit[1])];
    let p: Point = match n % TARGETS {
        0 => a,
        1 => std::array::from_fn(|i| a[i] + s * (b[i] - a[i])),
        _ => std::array::from_fn(|i| a[i] + 0.5 * s * (b[i] - a[i]) + 0.5 * t * (c[i] - a[i])),
    };
    if p.iter().chain(&b).all(|x| x.is_finite()) {
        [p, b]
    } else {
        anywhere()
    }
}

/// What an aimed ray is made of.
struct Aim {
    from: Point,
    at: Point,
    next: Point,
    scale: f32,
    unit: Point,
    pick: u32,
}

impl Aim {
    fn ray(&self, family: Family) -> Ray {
        let (from, at) = (self.from, self.at);
        let to: Point = std::array::from_fn(|i| at[i] - from[i]);
        // In units of the scene; the scale is a divisor, since its inverse may overflow.
        let by = |f: f32| to.map(|x| x / self.scale * f);
        let aimed = Ray::new(from, to);
        match family {
            Family::StartsOnTarget => Ray::new(at, self.unit.map(|x| x * self.scale)),
            Family::AlongEdge => Ray::new(at, std::array::from_fn(|i| self.next[i] - at[i])),
            Family::AlongAxis => self.along_axis(),
            Family::ZeroComponent => Ray::new(from, self.with_zero(to)),
            Family::Lopsided => Ray::new(from, self.lopsided(to)),
            Family::Interval if self.pick & 1 == 0 => Ray {
                t_min: 0.5,
                t_max: 1.5,
                ..aimed
            },
            Family::Interval => Ray {
                t_min: 1.0,
                ..aimed
            },
            Family::EndsOnTarget => Ray {
                t_max: 1.0,
                ..aimed
            },
            Family::Behind => Ray {
                t_min: if self.pick & 1 == 0 {
                    -2.0
                } else {
                    f32::NEG_INFINITY
                },
                ..Ray::new(from, to.map(|x| -x))
            },
            Family::FromAfar => {
                let origin: Point = std::array::from_fn(|i| at[i] - 1e4 * to[i]);
                Ray::new(origin, to)
            }
            Family::Short => Ray::new(from, by(1e-30)),
            Family::Long => Ray::new(from, by(1e30)),
            Family::Subnormal => Ray::new(from, by(3e-41)),
            Family::Aimed | Family::Void | Family::Given => aimed,
        }
    }

    fn zero(&self) -> f32 {
        if self.pick & 2 == 0 { 0.0 } else { -0.0 }
    }

    fn along_axis(&self) -> Ray {
        let axis = self.pick as usize / 4 % 3;
        let step = [self.scale, -self.scale, 1.0, -1e-3][self.pick as usize / 16 % 4];
        let (mut origin, mut direction) = (self.at, [self.zero(); 3]);
        origin[axis] = self.from[axis] - step.signum() * 4.0 * self.scale;
        direction[axis] = step;
        Ray::new(origin, direction)
    }

    fn with_zero(&self, mut to: Point) -> Point {
        to[self.pick as usize / 4 % 3] = self.zero();
        to
    }

    fn lopsided(&self, mut to: Point) -> Point {
        let axis = self.pick as usize / 4 % 3;
        to[axis] *= 1e-25;
        to[(axis + 1) % 3] *= [1.0, 1e-12, 1e-38, 1e-6][self.pick as usize / 16 % 4];
        to
    }
}

/// Rays that can hit nothing.
fn void_rays(place: Placement) -> [Ray; 8] {
    let o = place.at([0.0, 0.0, 3.0], 1.0);
    let d = [0.0, 0.0, -1.0];
    let within = |t_min, t_max| Ray {
        t_min,
        t_max,
        ..Ray::new(o, d)
    };
    [
        Ray::new(o, [0.0, -0.0, 0.0]),
        Ray::new(o, [f32::NAN, 0.0, 1.0]),
        Ray::new(o, [0.0, 0.0, f32::NEG_INFINITY]),
        Ray::new([f32::INFINITY, 0.0, 0.0], d),
        Ray::new([0.0, f32::NAN, 0.0], d),
        within(2.0, 2.0),
        within(f32::NAN, f32::INFINITY),
        within(0.0, f32::NAN),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn void_rays_are_not_valid_and_aimed_ones_of_a_plain_scene_are() {
        let place = Placement {
            scale: 1.0,
            offset: 10.0,
        };
        assert!(void_rays(place).iter().all(|r| !r.is_valid()));
        let corners = vec![[9.0; 3], [10.0, 9.0, 9.0], [9.0, 10.0, 9.5]];
        let one = Animation::new(vec![corners.clone(), corners], vec![[0, 1, 2]]).unwrap();
        let units = vec![[0.3, -0.7, 0.9]; COUNT];
        let picks: Vec<u32> = (0..COUNT as u32).map(|i| i * 7).collect();
        let made = rays(&one, place, &units, &picks);
        for family in AIMED {
            let valid = |(f, r): &(Family, Ray)| *f == family && r.is_valid();
            assert!(made.iter().any(valid), "{family:?}");
        }
    }
}
