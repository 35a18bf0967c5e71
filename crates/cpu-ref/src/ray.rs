//! A ray in scaled units, its direction brought to the length that the tests expect.

use crate::scale::{Scale, exponent, flushed, ldexp, unit_direction};
use geom::{Point, Ray};

/// A ray as every test sees it: `o' + t' * d'` in scaled units, the largest `|d'_i|` in `[1, 2)`.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    /// Start, `o'`.
    pub origin: Point,
    /// Direction, `d'`.
    pub direction: Point,
    /// Hits lie strictly beyond, in scaled units.
    pub t_min: f32,
    /// Hits lie strictly before, in scaled units.
    pub t_max: f32,
    /// `t = t' * 2^this`.
    unscale: i32,
}

impl PreparedRay {
    /// `None` for a ray that cannot hit anything.
    #[inline]
    pub fn new(ray: &Ray, scale: Scale) -> Option<Self> {
        if !ray.is_valid() {
            return None;
        }
        let origin = scale.apply(ray.origin);
        if !origin.iter().all(|x| x.is_finite()) {
            return None;
        }
        let [x, y, z] = ray.direction.map(f32::abs);
        let e = exponent(x.max(y).max(z));
        let up = e - scale.k();
        Some(Self {
            origin,
            direction: unit_direction(ray.direction, e),
            t_min: flushed(ldexp(ray.t_min, up)),
            t_max: flushed(ldexp(ray.t_max, up)),
            unscale: -up,
        })
    }

    /// A distance in units of the given ray's direction. A zero is a positive one.
    #[inline]
    pub fn unscaled(&self, t: f32) -> f32 {
        let t = ldexp(t, self.unscale);
        if t == 0.0 { 0.0 } else { t }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geom::Animation;

    #[test]
    fn distances_come_back_in_the_units_they_went() {
        let huge = Animation::new(vec![vec![[1e30, 0.0, 0.0]]], vec![]).unwrap();
        let ray = Ray {
            t_min: 0.5,
            t_max: 7.0,
            ..Ray::new([1e30, 0.0, 0.0], [0.0, 1e12, 0.0])
        };
        let p = PreparedRay::new(&ray, Scale::of(&huge)).unwrap();
        assert_eq!((p.unscaled(p.t_min), p.unscaled(p.t_max)), (0.5, 7.0));
        assert_eq!(p.unscaled(-0.0).to_bits(), 0);
    }

    #[test]
    fn rays_that_mean_nothing_are_refused() {
        let tiny = Animation::new(vec![vec![[1e-30, 0.0, 0.0]]], vec![]).unwrap();
        let far = Ray::new([1e30, 0.0, 0.0], [1.0, 0.0, 0.0]);
        assert!(PreparedRay::new(&far, Scale::of(&tiny)).is_none());
        assert!(PreparedRay::new(&far, Scale::ONE).is_some());
        let still = Ray::new([0.0; 3], [0.0; 3]);
        assert!(PreparedRay::new(&still, Scale::ONE).is_none());
    }
}
