//! One value over time: a sampler of the clip.

use gltf::animation::Interpolation;

/// A value that can be blended.
pub(super) trait Value: Clone {
    /// From `self` at 0 to `other` at 1.
    fn blend(&self, other: &Self, weight: f64) -> Self;
    /// The cubic Hermite spline from `self` with tangent `out` to `to` with tangent `inward`, by its four basis values.
    fn spline(&self, out: &Self, to: &Self, inward: &Self, basis: [f64; 4]) -> Self;
}

/// Values at rising times, in seconds.
pub(super) struct Track<T> {
    times: Vec<f64>,
    /// One a time; three for splines: inward tangent, value, outward tangent.
    values: Vec<T>,
    interpolation: Interpolation,
}

impl<T: Value> Track<T> {
    /// Nothing is checked but the counts. The message says what is wrong with them.
    pub(super) fn new(
        times: Vec<f64>,
        values: Vec<T>,
        interpolation: Interpolation,
    ) -> Result<Self, String> {
        let each = if interpolation == Interpolation::CubicSpline {
            3
        } else {
            1
        };
        let (found, expected) = (values.len(), each * times.len());
        if found != expected {
            return Err(format!(
                "{expected} values are expected for {} times, {found} are there",
                times.len()
            ));
        }
        Ok(Self {
            times,
            values,
            interpolation,
        })
    }

    /// The value at `time`: that of the nearest end before the first time and after the last.
    pub(super) fn at(&self, time: f64) -> Option<T> {
        let next = self.times.partition_point(|&t| t <= time);
        if next == 0 || next == self.times.len() {
            let nearest = next.min(self.times.len().checked_sub(1)?);
            return Some(self.value(nearest.min(self.times.len() - 1)).clone());
        }
        let last = next - 1;
        let step = self.times[next] - self.times[last];
        let weight = (time - self.times[last]) / step;
        Some(match self.interpolation {
            Interpolation::Step => self.value(last).clone(),
            Interpolation::Linear => self.value(last).blend(self.value(next), weight),
            Interpolation::CubicSpline => {
                let (out, inward) = (&self.values[3 * last + 2], &self.values[3 * next]);
                self.value(last)
                    .spline(out, self.value(next), inward, hermite(weight, step))
            }
        })
    }

    fn value(&self, key: usize) -> &T {
        match self.interpolation {
            Interpolation::CubicSpline => &self.values[3 * key + 1],
            _ => &self.values[key],
        }
    }
}

/// Weights of value, outward tangent, next value and its inward tangent (glTF 2.0, appendix C).
fn hermite(t: f64, step: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        2.0 * t3 - 3.0 * t2 + 1.0,
        step * (t3 - 2.0 * t2 + t),
        -2.0 * t3 + 3.0 * t2,
        step * (t3 - t2),
    ]
}

impl Value for glam::DVec3 {
    fn blend(&self, other: &Self, weight: f64) -> Self {
        *self + (*other - *self) * weight
    }

    fn spline(&self, out: &Self, to: &Self, inward: &Self, [a, b, c, d]: [f64; 4]) -> Self {
        a * *self + b * *out + c * *to + d * *inward
    }
}

impl Value for glam::DQuat {
    /// Along the shorter arc.
    fn blend(&self, other: &Self, weight: f64) -> Self {
        super::rig::unit(self.to_array()).slerp(super::rig::unit(other.to_array()), weight)
    }

    fn spline(&self, out: &Self, to: &Self, inward: &Self, [a, b, c, d]: [f64; 4]) -> Self {
        *self * a + *out * b + *to * c + *inward * d
    }
}

impl Value for Vec<f64> {
    fn blend(&self, other: &Self, weight: f64) -> Self {
        self.iter()
            .zip(other)
            .map(|(a, b)| a + (b - a) * weight)
            .collect()
    }

    fn spline(&self, out: &Self, to: &Self, inward: &Self, [a, b, c, d]: [f64; 4]) -> Self {
        let tangents = out.iter().zip(inward);
        let ends = self.iter().zip(to);
        ends.zip(tangents)
            .map(|((p, q), (m, n))| a * p + b * m + c * q + d * n)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};

    #[test]
    fn ends_hold_and_steps_wait() {
        let values = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let track = |how| Track::new(vec![1.0, 2.0, 4.0], values.clone(), how).unwrap();
        let linear = track(Interpolation::Linear);
        assert_eq!(linear.at(0.0), Some(DVec3::ZERO));
        assert_eq!(linear.at(3.0), Some(DVec3::new(0.5, 0.5, 0.0)));
        assert_eq!(linear.at(4.0), Some(DVec3::Y));
        assert_eq!(linear.at(9.0), Some(DVec3::Y));
        assert_eq!(track(Interpolation::Step).at(3.999), Some(DVec3::X));
        assert!(Track::new(vec![1.0], values, Interpolation::Linear).is_err());
    }

    #[test]
    fn a_spline_leaves_and_arrives_along_its_tangents() {
        // x = t^2 over 0..2 has slopes 0 and 4.
        let x = |v: f64| DVec3::X * v;
        let values = vec![x(0.0), x(0.0), x(0.0), x(4.0), x(4.0), x(0.0)];
        let track = Track::new(vec![0.0, 2.0], values, Interpolation::CubicSpline).unwrap();
        for t in [0.0, 0.5, 1.0, 1.7, 2.0] {
            assert!((track.at(t).unwrap().x - t * t).abs() < 1e-12);
        }
    }

    #[test]
    fn rotations_take_the_shorter_arc() {
        let quarter = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2);
        let track = Track::new(
            vec![0.0, 1.0],
            vec![DQuat::IDENTITY, -quarter],
            Interpolation::Linear,
        );
        let half = track.unwrap().at(0.5).unwrap();
        assert!(
            (half * DVec3::X - DVec3::new(0.5_f64.sqrt(), 0.0, -0.5_f64.sqrt())).length() < 1e-12
        );
    }
}
