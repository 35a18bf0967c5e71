//! Motion of a clip: the animated properties, the time span, and the interpolated values.

use super::accessor::floats;
use super::document::GltfFile;
use super::schema::{Clip, WholeNumber};
use super::transform::{Transform, unit};
use crate::Result;
use glam::DVec3;
use std::collections::BTreeMap;

/// Node property that a clip can animate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum NodeProperty {
    Translation,
    Rotation,
    Scale,
    Weights,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interpolation {
    Linear,
    Step,
    CubicSpline,
}

/// All animated properties of a clip. The default has no motion.
#[derive(Default)]
pub(super) struct ClipMotion {
    /// Tracks by node and property.
    tracks: BTreeMap<(usize, NodeProperty), Track>,
    /// Earliest and latest time of any key, in seconds. `None` if there is no key.
    span: Option<[f64; 2]>,
}

impl ClipMotion {
    pub(super) fn of(file: &GltfFile, clip: Option<&Clip>) -> Result<Self> {
        let mut motion = Self::default();
        if let Some(clip) = clip {
            for channel in 0..clip.channels.len() {
                motion.add(file, clip, channel)?;
            }
        }
        Ok(motion)
    }

    /// Returns the value of a node's property at `time`, or `None` if the clip does not set it.
    pub(super) fn at(&self, node: usize, property: NodeProperty, time: f64) -> Option<Vec<f64>> {
        let track = self.tracks.get(&(node, property))?;
        Some(track.at(time))
    }

    /// Returns the transform of a node at `time`, or `None` if the clip does not move the node. Properties that the
    /// clip does not set are taken from `rest`.
    pub(super) fn transform(&self, node: usize, time: f64, rest: Transform) -> Option<Transform> {
        let at = |property| self.at(node, property, time);
        let vector = |v: Vec<f64>| DVec3::from_slice(&v);
        let translation = at(NodeProperty::Translation).map(vector);
        let rotation = at(NodeProperty::Rotation).map(|v| unit(&v));
        let scale = at(NodeProperty::Scale).map(vector);
        let is_moved = translation.is_some() || rotation.is_some() || scale.is_some();
        is_moved.then(|| Transform {
            translation: translation.unwrap_or(rest.translation),
            rotation: rotation.unwrap_or(rest.rotation),
            scale: scale.unwrap_or(rest.scale),
        })
    }

    /// Returns the first and last time in seconds. Both are 0 if there is no key.
    pub(super) fn span(&self) -> [f64; 2] {
        self.span.unwrap_or_default()
    }

    /// Adds the track of a channel.
    fn add(&mut self, file: &GltfFile, clip: &Clip, index: usize) -> Result<()> {
        let channel = &clip.channels[index];
        // The specification requires readers to ignore a channel without a node.
        let Some(node) = channel.target.node else {
            return Ok(());
        };
        let wrong = |cause| file.wrong(("channel", index), cause);
        file.node(node)?;
        let property = property(&channel.target.path).map_err(wrong)?;
        let sampler = file.item("sampler", &clip.samplers, channel.sampler)?;
        let interpolation = interpolation(sampler.interpolation.as_deref()).map_err(wrong)?;
        let output = sampler.output;
        let times = times(file, sampler.input)?;
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            return Ok(());
        };
        let [start, end] = self.span.unwrap_or([first, last]);
        self.span = Some([start.min(first), end.max(last)]);
        let (size, values) = match property {
            NodeProperty::Translation | NodeProperty::Scale => (3, numbers::<3>(file, output)?),
            NodeProperty::Rotation => (4, numbers::<4>(file, output)?),
            NodeProperty::Weights => (targets(file, node)?, numbers::<1>(file, output)?),
        };
        let track = Track {
            times,
            values,
            size,
            is_rotation: property == NodeProperty::Rotation,
            interpolation,
        };
        let place = ("accessor", output.0);
        track.check().map_err(|cause| file.wrong(place, cause))?;
        self.tracks.insert((node.0, property), track);
        Ok(())
    }
}

fn property(path: &str) -> Result<NodeProperty, String> {
    match path {
        "translation" => Ok(NodeProperty::Translation),
        "rotation" => Ok(NodeProperty::Rotation),
        "scale" => Ok(NodeProperty::Scale),
        "weights" => Ok(NodeProperty::Weights),
        _ => Err(format!("unknown path {path:?}")),
    }
}

fn interpolation(name: Option<&str>) -> Result<Interpolation, String> {
    match name {
        None | Some("LINEAR") => Ok(Interpolation::Linear),
        Some("STEP") => Ok(Interpolation::Step),
        Some("CUBICSPLINE") => Ok(Interpolation::CubicSpline),
        Some(name) => Err(format!("unknown interpolation {name:?}")),
    }
}

fn numbers<const N: usize>(file: &GltfFile, accessor: WholeNumber) -> Result<Vec<f64>> {
    let elements = floats::<N>(file, accessor)?;
    Ok(elements.into_iter().flatten().map(f64::from).collect())
}

/// Returns the number of morph targets of a node.
fn targets(file: &GltfFile, node: WholeNumber) -> Result<usize> {
    let Some(mesh) = file.node(node)?.mesh else {
        return Ok(0);
    };
    let mesh = file.item("mesh", &file.document.meshes, mesh)?;
    let counts = mesh.primitives.iter().map(|p| p.targets.len());
    Ok(counts.max().unwrap_or(0))
}

/// Returns the times of a sampler, after checking that they are finite and non-decreasing.
fn times(file: &GltfFile, input: WholeNumber) -> Result<Vec<f64>> {
    let times = numbers::<1>(file, input)?;
    let wrong = |cause: &str| Err(file.wrong(("accessor", input.0), cause));
    if times.iter().any(|t| !t.is_finite()) {
        return wrong("a time is not a finite number");
    }
    if !times.is_sorted() {
        return wrong("the times of keys do not rise");
    }
    Ok(times)
}

/// Values of one animated property at non-decreasing times in seconds. There is at least one time.
struct Track {
    times: Vec<f64>,
    /// Concatenated values, one per time. Splines have three per time: in-tangent, value, out-tangent.
    values: Vec<f64>,
    /// Number of components per value.
    size: usize,
    /// Whether the values are quaternions.
    is_rotation: bool,
    interpolation: Interpolation,
}

impl Track {
    /// Checks that the number of values matches the number of times. The error does not contain the path.
    fn check(&self) -> Result<(), String> {
        let (size, found, times) = (self.size, self.values.len(), self.times.len());
        if size == 0 {
            return Err("weights are animated where there are no morph targets".to_owned());
        }
        if !found.is_multiple_of(size) {
            return Err(format!(
                "{found} weights do not make whole sets for {size} morph targets"
            ));
        }
        let (found, expected) = (found / size, times * self.rows_per_time());
        if found != expected {
            return Err(format!(
                "{expected} values are expected for {times} times, {found} are there"
            ));
        }
        Ok(())
    }

    /// Returns the number of rows of `values` per time. A row is one value or one tangent, of `size` components.
    fn rows_per_time(&self) -> usize {
        match self.interpolation {
            Interpolation::CubicSpline => 3,
            _ => 1,
        }
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.size..][..self.size]
    }

    fn value(&self, key: usize) -> &[f64] {
        let rows = self.rows_per_time();
        self.row(rows * key + rows / 2)
    }

    /// Returns the value at `time`. Before the first and after the last time, returns the value at that end.
    fn at(&self, time: f64) -> Vec<f64> {
        let next = self.times.partition_point(|&t| t <= time);
        if next == 0 || next == self.times.len() {
            return self.value(next.saturating_sub(1)).to_vec();
        }
        let last = next - 1;
        let step = self.times[next] - self.times[last];
        let weight = (time - self.times[last]) / step;
        let (from, to) = (self.value(last), self.value(next));
        match self.interpolation {
            Interpolation::Step => from.to_vec(),
            // Interpolates along the shorter arc between the quaternions.
            Interpolation::Linear if self.is_rotation => {
                unit(from).slerp(unit(to), weight).to_array().to_vec()
            }
            Interpolation::Linear => {
                let pairs = from.iter().zip(to);
                pairs.map(|(a, b)| a + (b - a) * weight).collect()
            }
            Interpolation::CubicSpline => {
                let (out, inward) = (self.row(3 * last + 2), self.row(3 * next));
                let [a, b, c, d] = hermite(weight, step);
                let value = |i: usize| a * from[i] + b * out[i] + c * to[i] + d * inward[i];
                (0..self.size).map(value).collect()
            }
        }
    }
}

/// Returns the weights of a value, its out-tangent, the next value and its in-tangent (glTF 2.0, appendix C).
fn hermite(t: f64, step: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        2.0 * t3 - 3.0 * t2 + 1.0,
        step * (t3 - 2.0 * t2 + t),
        -2.0 * t3 + 3.0 * t2,
        step * (t3 - t2),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolates_and_clamps_uneven_times() {
        let track = |interpolation| Track {
            times: vec![1.0, 2.0, 4.0],
            values: vec![0.0, 1.0, 3.0],
            size: 1,
            is_rotation: false,
            interpolation,
        };
        let linear = track(Interpolation::Linear);
        let found = [0.0, 3.0, 4.0, 9.0].map(|time| linear.at(time)[0]);
        assert_eq!(found, [0.0, 2.0, 3.0, 3.0]);
        assert_eq!(track(Interpolation::Step).at(3.999), [1.0]);
    }
}
