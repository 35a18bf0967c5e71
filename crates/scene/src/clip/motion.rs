//! A clip: what it moves, and for how long.

use super::accessor::{scalars, vectors};
use super::document::File;
use super::rig::unit;
use super::track::{Track, Value};
use super::wrong;
use crate::{FileLocation, SceneError};
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

/// A node's transform as far as a clip sets it.
#[derive(Default)]
pub(super) struct Moved {
    pub(super) translation: Option<DVec3>,
    pub(super) rotation: Option<DQuat>,
    pub(super) scale: Option<DVec3>,
}

impl Tracks {
    pub(super) fn at(&self, time: f64) -> Moved {
        Moved {
            translation: self.translation.as_ref().and_then(|t| t.at(time)),
            rotation: self
                .rotation
                .as_ref()
                .and_then(|t| t.at(time))
                .map(|q| unit(q.to_array())),
            scale: self.scale.as_ref().and_then(|t| t.at(time)),
        }
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
        self.nodes.get(&node)?.weights.as_ref()?.at(time)
    }

    /// First and last time, in seconds.
    pub(super) fn span(&self) -> [f64; 2] {
        self.span.unwrap_or_default()
    }

    fn add(&mut self, file: &File, channel: &Channel<'_>) -> Result<(), SceneError> {
        let sampler = channel.sampler();
        let (output, how) = (sampler.output(), sampler.interpolation());
        let place = FileLocation::Item("accessor", output.index());
        let times = times(file, &sampler.input())?;
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            return Ok(());
        };
        let [start, end] = self.span.unwrap_or([first, last]);
        self.span = Some([start.min(first), end.max(last)]);
        let node = channel.target().node();
        let tracks = self.nodes.entry(node.index()).or_default();
        let bad = |cause| wrong(file, place, cause);
        let vector = |v: Vec<[f32; 3]>| {
            v.into_iter()
                .map(|v| DVec3::from_array(v.map(f64::from)))
                .collect()
        };
        match channel.target().property() {
            Property::Translation => {
                let values = vector(vectors(file, &output)?);
                tracks.translation = Some(Track::new(times, values, how).map_err(bad)?);
            }
            Property::Scale => {
                let values = vector(vectors(file, &output)?);
                tracks.scale = Some(Track::new(times, values, how).map_err(bad)?);
            }
            Property::Rotation => {
                let values = vectors::<4>(file, &output)?;
                let values = values
                    .into_iter()
                    .map(|q| DQuat::from_array(q.map(f64::from)))
                    .collect();
                tracks.rotation = Some(Track::new(times, values, how).map_err(bad)?);
            }
            Property::MorphTargetWeights => {
                let targets = targets(&node);
                let values = scalars(file, &output)?;
                tracks.weights = Some(weights(times, &values, targets, how).map_err(bad)?);
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
    let times: Vec<f64> = scalars(file, input)?.into_iter().map(f64::from).collect();
    let place = || FileLocation::Item("accessor", input.index());
    if times.iter().any(|t| !t.is_finite()) {
        return Err(wrong(file, place(), "a time is not a finite number"));
    }
    if times.is_sorted() {
        Ok(times)
    } else {
        Err(wrong(file, place(), "the times of keys do not rise"))
    }
}

/// `targets` numbers make one value of a track.
fn weights(
    times: Vec<f64>,
    values: &[f32],
    targets: usize,
    how: Interpolation,
) -> Result<Track<Vec<f64>>, String>
where
    Vec<f64>: Value,
{
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
