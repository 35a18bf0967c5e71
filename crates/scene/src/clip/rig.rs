//! Node hierarchy: node transforms over time, and the instances of a mesh at a node (`EXT_mesh_gpu_instancing`).

use super::accessor::{count, listed};
use super::document::GltfFile;
use super::motion::ClipMotion;
use super::schema::{GltfNode, Whole};
use super::transform::{Transform, unit, vector};
use crate::Result;
use glam::{DMat4, DQuat, DVec3};

/// All nodes of a file.
pub(super) struct Rig {
    nodes: Vec<Joint>,
    /// Node indices in depth-first order: parents before children, siblings in file order.
    order: Vec<usize>,
}

struct Joint {
    parent: Option<usize>,
    /// Transform without animation.
    rest: Rest,
}

enum Rest {
    Matrix(DMat4),
    Transform(Transform),
}

impl Rest {
    fn of(node: &GltfNode) -> Self {
        if let Some(matrix) = &node.matrix {
            return Self::Matrix(DMat4::from_cols_array(matrix));
        }
        let vector = |v: Option<[f64; 3]>, default| v.map_or(default, DVec3::from_array);
        Self::Transform(Transform {
            translation: vector(node.translation, DVec3::ZERO),
            rotation: node.rotation.map_or(DQuat::IDENTITY, |q| unit(&q)),
            scale: vector(node.scale, DVec3::ONE),
        })
    }
}

impl Rig {
    /// Builds the hierarchy. Fails if a node has two parents or if parents form a cycle.
    pub(super) fn new(file: &GltfFile) -> Result<Self> {
        let nodes = &file.document.nodes;
        let mut parents = vec![None; nodes.len()];
        for (parent, node) in nodes.iter().enumerate() {
            for &child in &node.children {
                file.node(child)?;
                if parents[child.0].replace(parent).is_some() {
                    let place = ("node", child.0);
                    return Err(file.wrong(place, "the node has two parents"));
                }
            }
        }
        let roots = (0..nodes.len()).filter(|&i| parents[i].is_none());
        let order = descend(file, roots.map(Whole).collect());
        if order.len() < nodes.len() {
            let mut reached = order;
            reached.sort_unstable();
            let lost = (0..).zip(&reached).take_while(|(i, r)| i == *r).count();
            // The ancestors of a node without a root lead to a cycle. After this many steps, the node is in the cycle.
            let cyclic = (0..nodes.len()).fold(lost, |node, _| parents[node].unwrap_or(node));
            return Err(file.wrong(("node", cyclic), "the node is its own ancestor"));
        }
        let joints = parents.into_iter().zip(nodes);
        let joints = joints.map(|(parent, node)| Joint {
            parent,
            rest: Rest::of(node),
        });
        Ok(Self {
            nodes: joints.collect(),
            order,
        })
    }

    /// Returns the nodes of the default scene, else of the first scene. Without scenes, returns all nodes.
    pub(super) fn visible(&self, file: &GltfFile) -> Result<Vec<usize>> {
        let document = &file.document;
        if document.scenes.is_empty() && document.scene.is_none() {
            return Ok(self.order.clone());
        }
        let scene = document.scene.unwrap_or(Whole(0));
        let scene = file.item("scene", &document.scenes, scene)?;
        for &root in &scene.nodes {
            file.node(root)?;
        }
        Ok(descend(file, scene.nodes.clone()))
    }

    /// Returns the transform from each node to world space at `time`.
    pub(super) fn pose(&self, motion: &ClipMotion, time: f64) -> Vec<DMat4> {
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

    fn own(&self, node: usize, motion: &ClipMotion, time: f64) -> DMat4 {
        let rest = match &self.nodes[node].rest {
            Rest::Matrix(matrix) if !motion.moves(node) => return *matrix,
            Rest::Matrix(matrix) => Transform::of_matrix(matrix),
            Rest::Transform(transform) => *transform,
        };
        motion.transform(node, time, rest).matrix()
    }
}

/// Returns `roots` and all their descendants in depth-first order, each once and after its parent.
fn descend(file: &GltfFile, roots: Vec<Whole>) -> Vec<usize> {
    let nodes = &file.document.nodes;
    let mut seen = vec![false; nodes.len()];
    let mut waiting = roots;
    waiting.reverse();
    let mut order = Vec::new();
    while let Some(Whole(i)) = waiting.pop() {
        if !std::mem::replace(&mut seen[i], true) {
            order.push(i);
            waiting.extend(nodes[i].children.iter().rev());
        }
    }
    order
}

/// Accessors of the translations, rotations and scales of mesh instances at a node. All have the same length.
struct Instances {
    accessors: [Option<Whole>; 3],
    /// Number of instances.
    count: usize,
}

impl Instances {
    fn of(file: &GltfFile, node: usize) -> Result<Self> {
        let instancing = file.document.nodes[node].extensions.instancing.as_ref();
        let accessor = |name| instancing.and_then(|i| i.attributes.get(name).copied());
        let accessors = ["TRANSLATION", "ROTATION", "SCALE"].map(accessor);
        let counts = accessors.iter().flatten().map(|&a| count(file, a));
        let counts = counts.collect::<Result<Vec<_>>>()?;
        let first = counts.first().copied().unwrap_or(1);
        if counts.iter().any(|&count| count != first) {
            let cause = "EXT_mesh_gpu_instancing: its attributes differ in their counts";
            return Err(file.wrong(("node", node), cause));
        }
        Ok(Self {
            accessors,
            count: first,
        })
    }
}

/// Returns the number of instances of a node's mesh.
pub(super) fn copies(file: &GltfFile, node: usize) -> Result<usize> {
    Ok(Instances::of(file, node)?.count)
}

/// Returns the transform of each instance relative to the node.
pub(super) fn places(file: &GltfFile, node: usize) -> Result<Vec<DMat4>> {
    let Instances { accessors, count } = Instances::of(file, node)?;
    let [translations, rotations, scales] = accessors;
    let translations = listed::<3>(file, translations)?;
    let rotations = listed::<4>(file, rotations)?;
    let scales = listed::<3>(file, scales)?;
    let place = |i: usize| {
        let rotation = rotations.get(i);
        let transform = Transform {
            translation: translations.get(i).map_or(DVec3::ZERO, |&v| vector(v)),
            rotation: rotation.map_or(DQuat::IDENTITY, |q| unit(&q.map(f64::from))),
            scale: scales.get(i).map_or(DVec3::ONE, |&v| vector(v)),
        };
        transform.matrix()
    };
    Ok((0..count).map(place).collect())
}
