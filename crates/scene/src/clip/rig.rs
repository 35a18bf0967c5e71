//! The tree of nodes: where each stands at a time.

use super::document::File;
use super::motion::Motion;
use super::wrong;
use crate::{FileLocation, SceneError};
use glam::{DMat4, DQuat, DVec3, Mat4};
use gltf::scene::Transform;

/// All nodes of a file, parents before children.
pub(super) struct Rig {
    nodes: Vec<Joint>,
    /// Nodes, each after its parent, children in the file's order.
    order: Vec<usize>,
}

struct Joint {
    parent: Option<usize>,
    rest: Rest,
}

/// A node's own transform where no clip moves it.
enum Rest {
    Matrix(DMat4),
    Parts(DVec3, DQuat, DVec3),
}

/// From each node's frame to the world's.
pub(super) struct Pose(Vec<DMat4>);

impl Pose {
    pub(super) fn world(&self, node: usize) -> DMat4 {
        self.0[node]
    }
}

impl Rig {
    /// Sorts the nodes; they must make up trees.
    pub(super) fn new(file: &File) -> Result<Self, SceneError> {
        let mut nodes: Vec<_> = file
            .document
            .nodes()
            .map(|node| Joint {
                parent: None,
                rest: rest(node.transform()),
            })
            .collect();
        for node in file.document.nodes() {
            for child in node.children() {
                let parent = nodes[child.index()].parent.replace(node.index());
                if parent.is_some() {
                    return Err(wrong(
                        file,
                        FileLocation::Item("node", child.index()),
                        "the node has two parents",
                    ));
                }
            }
        }
        let roots = (0..nodes.len())
            .filter(|&i| nodes[i].parent.is_none())
            .collect();
        let order = descend(file, roots);
        if order.len() < nodes.len() {
            let mut reached = vec![false; nodes.len()];
            order.iter().for_each(|&i| reached[i] = true);
            let lost = reached.iter().position(|r| !r).unwrap_or_default();
            return Err(wrong(
                file,
                FileLocation::Item("node", lost),
                "the node is its own ancestor",
            ));
        }
        Ok(Self { nodes, order })
    }

    /// The nodes of the default scene, or of the first, or of all, each after its parent.
    pub(super) fn visible(&self, file: &File) -> Vec<usize> {
        match file
            .document
            .default_scene()
            .or_else(|| file.document.scenes().next())
        {
            Some(scene) => descend(file, scene.nodes().map(|n| n.index()).collect()),
            None => self.order.clone(),
        }
    }

    /// Where every node stands at `time`.
    pub(super) fn pose(&self, motion: &Motion, time: f64) -> Pose {
        let mut world = vec![DMat4::IDENTITY; self.nodes.len()];
        for &i in &self.order {
            let own = self.own(i, motion, time);
            world[i] = match self.nodes[i].parent {
                Some(parent) => world[parent] * own,
                None => own,
            };
        }
        Pose(world)
    }

    fn own(&self, node: usize, motion: &Motion, time: f64) -> DMat4 {
        let tracks = motion.node(node);
        let (translation, rotation, scale) = match (&self.nodes[node].rest, tracks) {
            (Rest::Matrix(matrix), None) => return *matrix,
            (Rest::Matrix(matrix), Some(_)) => {
                let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
                (translation, rotation, scale)
            }
            (Rest::Parts(t, r, s), _) => (*t, *r, *s),
        };
        let at = |rest: DVec3, track: Option<DVec3>| track.unwrap_or(rest);
        let moved = tracks.map(|t| t.at(time)).unwrap_or_default();
        DMat4::from_scale_rotation_translation(
            at(scale, moved.scale),
            moved.rotation.unwrap_or(rotation),
            at(translation, moved.translation),
        )
    }
}

fn rest(transform: Transform) -> Rest {
    match transform {
        Transform::Matrix { matrix } => Rest::Matrix(Mat4::from_cols_array_2d(&matrix).as_dmat4()),
        Transform::Decomposed {
            translation,
            rotation,
            scale,
        } => {
            let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
            Rest::Parts(
                vector(translation),
                unit(rotation.map(f64::from)),
                vector(scale),
            )
        }
    }
}

/// The rotation a quaternion (x, y, z, w) stands for; none if it is zero.
pub(super) fn unit(quaternion: [f64; 4]) -> DQuat {
    let q = DQuat::from_array(quaternion);
    if q.length_squared() == 0.0 {
        DQuat::IDENTITY
    } else {
        q.normalize()
    }
}

/// `roots` and all below them, each after its parent; stops where a node comes twice.
fn descend(file: &File, roots: Vec<usize>) -> Vec<usize> {
    let nodes: Vec<_> = file.document.nodes().collect();
    let mut seen = vec![false; nodes.len()];
    let mut waiting: Vec<usize> = roots.into_iter().rev().collect();
    let mut order = Vec::new();
    while let Some(i) = waiting.pop() {
        if !std::mem::replace(&mut seen[i], true) {
            order.push(i);
            let children: Vec<_> = nodes[i].children().map(|c| c.index()).collect();
            waiting.extend(children.into_iter().rev());
        }
    }
    order
}
