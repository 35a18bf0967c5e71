//! A clip: what it moves, for how long, and each value over time (a sampler of the clip).

use super::accessor::floats;
use super::document::File;
use super::rig::{Parts, unit, vectors};
use crate::SceneError;
use glam::{DQuat, DVec3};
use gltf::animation::{Channel, Interpolation, Property};
use std::collections::BTreeMap;

/// All that a clip moves; the default moves nothing.
#[derive(Default)]
pub(super) struct Motion {
    nodes: BTreeMap<usize, Tracks>,
    /// Least and greatest time of any key; nothing if there is none.
    span: Option<[f64; 2]>,
}

/// What moves at one node.
#[derive(Default)]
pub(super) struct Tracks {
    translation: Option<Track<DVec3>>,
    rotation: Option<Track<DQuat>>,
    scale: Option<Track<DVec3>>,
    weights: Option<Track<Vec<f64>>>,
}

impl Tracks {
    /// A node's parts, of which a clip sets some.
    pub(super) fn at(&self, time: f64, (translation, rotation, scale): Parts) -> Parts {
        let turned = self.rotation.as_ref().map(|t| unit(t.at(time).to_array()));
        (
            self.translation
                .as_ref()
                .map_or(translation, |t| t.at(time)),
            turned.unwrap_or(rotation),
            self.scale.as_ref().map_or(scale, |t| t.at(time)),
        )
    }
}

impl Motion {
    /// Reads all channels of a clip.
    pub(super) fn of(file: &File, clip: &gltf::Animation<'_>) -> Result<Self, SceneError> {
        let mut motion = Self::default();
        for channel in clip.channels() {
            motion.add(file, &channel)?;
        }
        Ok(motion)
    }

    /// What moves at a node.
    pub(super) fn node(&self, node: usize) -> Option<&Tracks> {
        self.nodes.get(&node)
    }

    /// Weights of the morph targets at a node, if the clip sets them.
    pub(super) fn weights(&self, node: usize, time: f64) -> Option<Vec<f64>> {
        Some(self.nodes.get(&node)?.weights.as_ref()?.at(time))
    }

    /// First and last time, in seconds.
    pub(super) fn span(&self) -> [f64; 2] {
        self.span.unwrap_or_default()
    }

    fn add(&mut self, file: &File, channel: &Channel<'_>) -> Result<(), SceneError> {
        let sampler = channel.sampler();
        let (output, how) = (sampler.output(), sampler.interpolation());
        let place = ("accessor", output.index());
        let times = times(file, &sampler.input())?;
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            return Ok(());
        };
        let [start, end] = self.span.unwrap_or([first, last]);
        self.span = Some([start.min(first), end.max(last)]);
        let node = channel.target().node();
        let tracks = self.nodes.entry(node.index()).or_default();
        let bad = |cause| file.wrong(place, cause);
        let vectors = |accessor| floats::<3>(file, accessor).map(|v| vectors(&v));
        match channel.target().property() {
            Property::Translation => {
                let values = vectors(&output)?;
                tracks.translation = Some(Track::new(times, values, how).map_err(bad)?);
            }
            Property::Scale => {
                let values = vectors(&output)?;
                tracks.scale = Some(Track::new(times, values, how).map_err(bad)?);
            }
            Property::Rotation => {
                let values = floats::<4>(file, &output)?.into_iter();
                let values = values.map(|q| DQuat::from_array(q.map(f64::from)));
                let track = Track::new(times, values.collect(), how);
                tracks.rotation = Some(track.map_err(bad)?);
            }
            Property::MorphTargetWeights => {
                let targets = targets(&node);
                let values = floats::<1>(file, &output)?;
                tracks.weights =
                    Some(weights(times, values.as_flattened(), targets, how).map_err(bad)?);
            }
        }
        Ok(())
    }
}

/// How many morph targets a node's mesh has.
fn targets(node: &gltf::Node<'_>) -> usize {
    let mesh = node.mesh();
    mesh.and_then(|m| m.primitives().map(|p| p.morph_targets().count()).max())
        .unwrap_or(0)
}

/// Finite times that never fall.
fn times(file: &File, input: &gltf::Accessor<'_>) -> Result<Vec<f64>, SceneError> {
    let times = floats::<1>(file, input)?.into_iter();
    let times: Vec<f64> = times.map(|[t]| f64::from(t)).collect();
    let wrong = |cause: &str| Err(file.wrong(("accessor", input.index()), cause));
    if times.iter().any(|t| !t.is_finite()) {
        return wrong("a time is not a finite number");
    }
    if !times.is_sorted() {
        return wrong("the times of keys do not rise");
    }
    Ok(times)
}

/// `targets` numbers make one value of a track.
fn weights(
    times: Vec<f64>,
    values: &[f32],
    targets: usize,
    how: Interpolation,
) -> Result<Track<Vec<f64>>, String> {
    if targets == 0 {
        return Err("weights are animated where there are no morph targets".to_owned());
    }
    if !values.len().is_multiple_of(targets) {
        return Err(format!(
            "{} weights do not make whole sets for {targets} morph targets",
            values.len()
        ));
    }
    let sets = values
        .chunks(targets)
        .map(|set| set.iter().map(|&w| f64::from(w)).collect());
    Track::new(times, sets.collect(), how)
}

/// A value that can be blended.
trait Value: Clone {
    /// From `self` at 0 to `other` at 1.
    fn blend(&self, other: &Self, weight: f64) -> Self;
    /// The cubic Hermite spline from `self` with tangent `out` to `to` with tangent `inward`, by its four basis values.
    fn spline(&self, out: &Self, to: &Self, inward: &Self, basis: [f64; 4]) -> Self;
}

/// Values at rising times, in seconds.
struct Track<T> {
    times: Vec<f64>,
    /// One a time; three for splines: inward tangent, value, outward tangent.
    values: Vec<T>,
    interpolation: Interpolation,
}

impl<T: Value> Track<T> {
    /// Nothing is checked but the counts, of which there is one time at least. The message says what is wrong with them.
    fn new(times: Vec<f64>, values: Vec<T>, interpolation: Interpolation) -> Result<Self, String> {
        let each = match interpolation {
            Interpolation::CubicSpline => 3,
            _ => 1,
        };
        let (found, times_found) = (values.len(), times.len());
        let expected = each * times_found;
        if found != expected {
            return Err(format!(
                "{expected} values are expected for {times_found} times, {found} are there"
            ));
        }
        Ok(Self {
            times,
            values,
            interpolation,
        })
    }

    /// The value at `time`: that of the nearest end before the first time and after the last.
    fn at(&self, time: f64) -> T {
        let next = self.times.partition_point(|&t| t <= time);
        if next == 0 || next == self.times.len() {
            return self.value(next.saturating_sub(1)).clone();
        }
        let last = next - 1;
        let step = self.times[next] - self.times[last];
        let weight = (time - self.times[last]) / step;
        match self.interpolation {
            Interpolation::Step => self.value(last).clone(),
            Interpolation::Linear => self.value(last).blend(self.value(next), weight),
            Interpolation::CubicSpline => {
                let (out, inward) = (&self.values[3 * last + 2], &self.values[3 * next]);
                self.value(last)
                    .spline(out, self.value(next), inward, hermite(weight, step))
            }
        }
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

impl Value for DVec3 {
    fn blend(&self, other: &Self, weight: f64) -> Self {
        *self + (*other - *self) * weight
    }

    fn spline(&self, out: &Self, to: &Self, inward: &Self, [a, b, c, d]: [f64; 4]) -> Self {
        a * *self + b * *out + c * *to + d * *inward
    }
}

impl Value for DQuat {
    /// Along the shorter arc.
    fn blend(&self, other: &Self, weight: f64) -> Self {
        unit(self.to_array()).slerp(unit(other.to_array()), weight)
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

    #[test]
    fn ends_hold_and_steps_wait() {
        let values = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let track = |how| Track::new(vec![1.0, 2.0, 4.0], values.clone(), how).unwrap();
        let linear = track(Interpolation::Linear);
        assert_eq!(linear.at(0.0), DVec3::ZERO);
        assert_eq!(linear.at(3.0), DVec3::new(0.5, 0.5, 0.0));
        assert_eq!(linear.at(4.0), DVec3::Y);
        assert_eq!(linear.at(9.0), DVec3::Y);
        assert_eq!(track(Interpolation::Step).at(3.999), DVec3::X);
        assert!(Track::new(vec![1.0], values, Interpolation::Linear).is_err());
    }

    #[test]
    fn rotations_take_the_shorter_arc() {
        let quarter = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2);
        let track = Track::new(
            vec![0.0, 1.0],
            vec![DQuat::IDENTITY, -quarter],
            Interpolation::Linear,
        );
        let half = track.unwrap().at(0.5);
        assert!(
            (half * DVec3::X - DVec3::new(0.5_f64.sqrt(), 0.0, -0.5_f64.sqrt())).length() < 1e-12
        );
    }
}
