//! Skins: vertices that hang on joints.

use super::accessor::{matrices, vectors};
use super::document::File;
use super::part::check_count;
use super::rig::Pose;
use super::wrong;
use crate::{FileLocation, SceneError};
use glam::{DMat4, DVec3, Mat4};
use gltf::{Primitive, Semantic};

/// A skin as one primitive uses it.
#[derive(Clone)]
pub(super) struct Skin {
    /// (Node, inverse bind matrix) of each joint.
    joints: Vec<(usize, DMat4)>,
    /// (Joint, weight) of each vertex, weights with sum 1; none for a vertex that follows its node.
    pub(super) holds: Vec<Vec<(usize, f64)>>,
}

impl Skin {
    /// Reads the joints of a skin and what each vertex of `primitive` hangs on.
    pub(super) fn new(
        file: &File,
        skin: &gltf::Skin<'_>,
        primitive: &Primitive<'_>,
        vertices: usize,
    ) -> Result<Self, SceneError> {
        let nodes: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
        let binds = match skin.inverse_bind_matrices() {
            Some(accessor) => {
                let binds = matrices(file, &accessor)?;
                if binds.len() < nodes.len() {
                    let cause = format!(
                        "{} inverse bind matrices for {} joints",
                        binds.len(),
                        nodes.len()
                    );
                    return Err(wrong(file, FileLocation::Item("skin", skin.index()), cause));
                }
                binds
                    .iter()
                    .map(|m| Mat4::from_cols_array_2d(m).as_dmat4())
                    .collect()
            }
            None => vec![DMat4::IDENTITY; nodes.len()],
        };
        let joints: Vec<_> = nodes.into_iter().zip(binds).collect();
        let mut holds = vec![Vec::new(); vertices];
        for set in 0.. {
            let (numbers, weights) = (
                primitive.get(&Semantic::Joints(set)),
                primitive.get(&Semantic::Weights(set)),
            );
            let (Some(numbers), Some(weights)) = (numbers, weights) else {
                break;
            };
            add_holds(file, &mut holds, joints.len(), (&numbers, &weights))?;
        }
        holds.iter_mut().for_each(normalise);
        Ok(Self { joints, holds })
    }

    /// Each vertex goes where its joints take it; the node itself has no say (glTF 2.0, 3.7.3.3).
    pub(super) fn bend(&self, points: &mut [DVec3], pose: &Pose, world: DMat4) {
        let joints: Vec<DMat4> = self
            .joints
            .iter()
            .map(|&(node, bind)| pose.world(node) * bind)
            .collect();
        for (p, holds) in points.iter_mut().zip(&self.holds) {
            *p = match holds.as_slice() {
                [] => world.transform_point3(*p),
                holds => holds
                    .iter()
                    .map(|&(joint, weight)| weight * joints[joint].transform_point3(*p))
                    .sum(),
            };
        }
    }
}

/// Adds the four joints a vertex of one set. A weight of zero may name any joint.
fn add_holds(
    file: &File,
    holds: &mut [Vec<(usize, f64)>],
    joints: usize,
    (numbers, weights): (&gltf::Accessor<'_>, &gltf::Accessor<'_>),
) -> Result<(), SceneError> {
    let place = FileLocation::Item("accessor", numbers.index());
    let (found, weight) = (vectors::<4>(file, numbers)?, vectors::<4>(file, weights)?);
    check_count(file, numbers.index(), found.len(), holds.len())?;
    check_count(file, weights.index(), weight.len(), holds.len())?;
    for (vertex, (found, weight)) in found.into_iter().zip(weight).enumerate() {
        for (joint, weight) in found.into_iter().zip(weight).filter(|(_, w)| *w != 0.0) {
            let joint = joint as usize;
            if joint >= joints {
                return Err(wrong(
                    file,
                    place,
                    format!("vertex {vertex} hangs on joint {joint}, but the skin has {joints}"),
                ));
            }
            holds[vertex].push((joint, f64::from(weight)));
        }
    }
    Ok(())
}

/// Weights are often stored in a few bits: their sum is made 1.
fn normalise(holds: &mut Vec<(usize, f64)>) {
    let sum: f64 = holds.iter().map(|h| h.1).sum();
    if sum == 0.0 {
        holds.clear();
    }
    holds.iter_mut().for_each(|h| h.1 /= sum);
}
