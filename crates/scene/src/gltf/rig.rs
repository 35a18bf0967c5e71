//! Node hierarchy: node transforms over time, and the instances of a mesh at a node (`EXT_mesh_gpu_instancing`).

use super::accessor::floats;
use super::document::GltfFile;
use super::motion::ClipMotion;
use super::schema::{GltfNode, WholeNumber};
use super::transform::{Transform, unit, vector};
use crate::Result;
use glam::{DMat4, DQuat, DVec3};

/// All nodes of a file.
pub(super) struct Rig {
    nodes: Vec<RigNode>,
    /// Node indices in depth-first order: parents before children, siblings in file order.
    order: Vec<usize>,
}

struct RigNode {
    parent: Option<usize>,
    /// Transform without animation.
    matrix: DMat4,
    /// The same transform, decomposed.
    transform: Transform,
}

impl RigNode {
    fn new(parent: Option<usize>, node: &GltfNode) -> Self {
        let vector = |v: Option<[f64; 3]>, default| v.map_or(default, DVec3::from_array);
        let parts = Transform {
            translation: vector(node.translation, DVec3::ZERO),
            rotation: node.rotation.map_or(DQuat::IDENTITY, |q| unit(&q)),
            scale: vector(node.scale, DVec3::ONE),
        };
        let matrix = node.matrix.map(|matrix| DMat4::from_cols_array(&matrix));
        Self {
            parent,
            matrix: matrix.unwrap_or_else(|| parts.matrix()),
            transform: matrix.map_or(parts, |matrix| Transform::of_matrix(&matrix)),
        }
    }
}

impl Rig {
    /// Builds the hierarchy. Fails if a child does not exist, a node has two parents, or parents form a cycle.
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
        let order = descend(file, roots.map(WholeNumber).collect());
        if order.len() < nodes.len() {
            let mut reached = order;
            reached.sort_unstable();
            let lost = (0..).zip(&reached).take_while(|(i, r)| i == *r).count();
            // From a node that no root reaches, following parents ends in a cycle. After `nodes.len()` steps, `node` is
            // in this cycle.
            let cyclic = (0..nodes.len()).fold(lost, |node, _| parents[node].unwrap_or(node));
            return Err(file.wrong(("node", cyclic), "the node is its own ancestor"));
        }
        let nodes = parents.into_iter().zip(nodes);
        let nodes = nodes.map(|(parent, node)| RigNode::new(parent, node));
        Ok(Self {
            nodes: nodes.collect(),
            order,
        })
    }

    /// Returns the nodes of the default scene, else of the first scene. Without scenes, returns all nodes.
    pub(super) fn visible(&self, file: &GltfFile) -> Result<Vec<usize>> {
        let document = &file.document;
        if document.scenes.is_empty() && document.scene.is_none() {
            return Ok(self.order.clone());
        }
        let scene = document.scene.unwrap_or(WholeNumber(0));
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
            let node = &self.nodes[i];
            let moved = motion.transform(i, time, node.transform);
            let local = moved.map_or(node.matrix, |transform| transform.matrix());
            world[i] = match node.parent {
                Some(parent) => world[parent] * local,
                None => local,
            };
        }
        world
    }
}

/// Returns `roots` and all their descendants in depth-first order, each once. If no root has a parent, each node comes
/// after its parent.
fn descend(file: &GltfFile, roots: Vec<WholeNumber>) -> Vec<usize> {
    let nodes = &file.document.nodes;
    let mut seen = vec![false; nodes.len()];
    let mut waiting = roots;
    waiting.reverse();
    let mut order = Vec::new();
    while let Some(WholeNumber(i)) = waiting.pop() {
        if !std::mem::replace(&mut seen[i], true) {
            order.push(i);
            waiting.extend(nodes[i].children.iter().rev());
        }
    }
    order
}

/// Returns an attribute of the mesh instances at a node, or `None` if it is absent.
fn attribute<const N: usize>(
    file: &GltfFile,
    node: usize,
    name: &str,
) -> Result<Option<Vec<[f32; N]>>> {
    let instancing = file.document.nodes[node].extensions.instancing.as_ref();
    let accessor = instancing.and_then(|i| i.attributes.get(name));
    accessor.map(|&accessor| floats(file, accessor)).transpose()
}

/// Returns the transform of each mesh instance at a node, relative to the node.
pub(super) fn instance_transforms(file: &GltfFile, node: usize) -> Result<Vec<DMat4>> {
    let translations = attribute::<3>(file, node, "TRANSLATION")?;
    let rotations = attribute::<4>(file, node, "ROTATION")?;
    let scales = attribute::<3>(file, node, "SCALE")?;
    let counts = [
        translations.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
    ];
    let count = counts.iter().flatten().next().copied().unwrap_or(1);
    let wrong =
        |cause: &str| file.wrong(("node", node), format!("EXT_mesh_gpu_instancing: {cause}"));
    if counts.iter().flatten().any(|&other| other != count) {
        return Err(wrong("its attributes differ in their counts"));
    }
    let transform = |i: usize| {
        let parts = Transform {
            translation: translations
                .as_ref()
                .map_or(DVec3::ZERO, |all| vector(all[i])),
            rotation: rotations
                .as_ref()
                .map_or(DQuat::IDENTITY, |all| unit(&all[i].map(f64::from))),
            scale: scales.as_ref().map_or(DVec3::ONE, |all| vector(all[i])),
        };
        parts.matrix()
    };
    let mut transforms = Vec::new();
    host::reserve(&mut transforms, count).map_err(|e| wrong(&e.to_string()))?;
    transforms.extend((0..count).map(transform));
    Ok(transforms)
}
