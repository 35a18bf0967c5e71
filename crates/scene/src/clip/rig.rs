//! The tree of nodes: where each stands at a time, and the copies of a mesh at one node (`EXT_mesh_gpu_instancing`).

use super::accessor::listed;
use super::document::File;
use super::motion::Motion;
use crate::Result;
use glam::{DMat4, DQuat, DVec3, Mat4};
use gltf::scene::Transform;
use gltf::{Accessor, Node};

/// All nodes of a file, parents before children.
pub(super) struct Rig {
    nodes: Vec<Joint>,
    /// Nodes, each after its parent, children in the file's order.
    order: Vec<usize>,
}

struct Joint {
    parent: Option<usize>,
    /// Where no clip moves it.
    rest: Transform,
}

/// Translation, rotation and scale.
pub(super) type Parts = (DVec3, DQuat, DVec3);

impl Rig {
    /// Sorts the nodes; they must make up trees.
    pub(super) fn new(file: &File) -> Result<Self> {
        let joint = |node: Node<'_>| Joint {
            parent: None,
            rest: node.transform(),
        };
        let mut nodes: Vec<_> = file.document.nodes().map(joint).collect();
        for node in file.document.nodes() {
            for child in node.children() {
                let parent = nodes[child.index()].parent.replace(node.index());
                if parent.is_some() {
                    let place = ("node", child.index());
                    return Err(file.wrong(place, "the node has two parents"));
                }
            }
        }
        let roots = (0..nodes.len())
            .filter(|&i| nodes[i].parent.is_none())
            .collect();
        let order = descend(file, roots);
        if order.len() < nodes.len() {
            let mut reached = order;
            reached.sort_unstable();
            let lost = (0..).zip(&reached).take_while(|(i, r)| i == *r).count();
            return Err(file.wrong(("node", lost), "the node is its own ancestor"));
        }
        Ok(Self { nodes, order })
    }

    /// The nodes of the default scene, or of the first, or of all, each after its parent.
    pub(super) fn visible(&self, file: &File) -> Vec<usize> {
        let default = file.document.default_scene();
        match default.or_else(|| file.document.scenes().next()) {
            Some(scene) => descend(file, scene.nodes().map(|n| n.index()).collect()),
            None => self.order.clone(),
        }
    }

    /// From each node's frame to the world's, at `time`.
    pub(super) fn pose(&self, motion: &Motion, time: f64) -> Vec<DMat4> {
        let mut world = vec![DMat4::IDENTITY; self.nodes.len()];
        for &i in &self.order {
            let own = self.own(i, motion, time);
            world[i] = match self.nodes[i].parent {
                Some(parent) => world[parent] * own,
                None => own,
            };
        }
        world
    }

    fn own(&self, node: usize, motion: &Motion, time: f64) -> DMat4 {
        let parts = match &self.nodes[node].rest {
            Transform::Matrix { matrix } => {
                let matrix = Mat4::from_cols_array_2d(matrix).as_dmat4();
                if !motion.moves(node) {
                    return matrix;
                }
                let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
                (translation, rotation, scale)
            }
            &Transform::Decomposed {
                translation,
                rotation,
                scale,
            } => {
                let rotation = unit(&rotation.map(f64::from));
                (vector(translation), rotation, vector(scale))
            }
        };
        let (translation, rotation, scale) = motion.parts(node, time, parts);
        DMat4::from_scale_rotation_translation(scale, rotation, translation)
    }
}

pub(super) fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// The rotation a quaternion (x, y, z, w) stands for; none if it is zero.
pub(super) fn unit(quaternion: &[f64]) -> DQuat {
    let q = DQuat::from_slice(quaternion);
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

const NAME: &str = "EXT_mesh_gpu_instancing";

/// How many copies of its mesh a node shows; and accessors of their translations, rotations and scales, of one length.
pub(super) fn instances<'a>(
    file: &'a File,
    node: &Node<'_>,
) -> Result<(usize, [Option<Accessor<'a>>; 3])> {
    let wrong = |cause| file.wrong(("node", node.index()), cause);
    let all = node.extension_value(NAME).and_then(|e| e.get("attributes"));
    let accessor = |name: &str| {
        let Some(value) = all.and_then(|all| all.get(name)) else {
            return Ok(None);
        };
        let index = value.as_u64().and_then(|i| usize::try_from(i).ok());
        let found = index.and_then(|i| file.document.accessors().nth(i));
        let cause = format!("{NAME}: {name} names no accessor: {value}");
        found.ok_or_else(|| wrong(cause)).map(Some)
    };
    let found = [
        accessor("TRANSLATION")?,
        accessor("ROTATION")?,
        accessor("SCALE")?,
    ];
    let mut counts = found.iter().flatten().map(Accessor::count);
    let count = counts.next().unwrap_or(1);
    if counts.any(|c| c != count) {
        let cause = format!("{NAME}: its attributes differ in their counts");
        return Err(wrong(cause));
    }
    Ok((count, found))
}

/// Where each copy stands, seen from the node.
pub(super) fn places(file: &File, node: &Node<'_>) -> Result<Vec<DMat4>> {
    let (count, [translations, rotations, scales]) = instances(file, node)?;
    let translations = listed::<3>(file, translations)?;
    let rotations = listed::<4>(file, rotations)?;
    let scales = listed::<3>(file, scales)?;
    let place = |i: usize| {
        let rotation = rotations.get(i);
        let rotation = rotation.map_or(DQuat::IDENTITY, |q| unit(&q.map(f64::from)));
        let scale = scales.get(i).map_or(DVec3::ONE, |&v| vector(v));
        let translation = translations.get(i).map_or(DVec3::ZERO, |&v| vector(v));
        DMat4::from_scale_rotation_translation(scale, rotation, translation)
    };
    Ok((0..count).map(place).collect())
}
