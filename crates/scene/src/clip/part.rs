//! What is drawn: a primitive of a mesh at a node, with its morph targets and its skin.

use super::accessor::{count, indices, vectors};
use super::document::File;
use super::instances;
use super::motion::Motion;
use super::rig::{Pose, Rig};
use super::skin::Skin;
use super::wrong;
use crate::colour::from_linear;
use crate::mesh::compact;
use crate::{FileLocation, Options, Rgb, SceneError, memory};
use geom::Point;
use glam::{DMat4, DVec3};
use gltf::mesh::Mode;
use gltf::{Node, Primitive, Semantic};
use std::collections::BTreeMap;

/// One primitive at one node.
#[derive(Clone)]
pub(super) struct Part {
    node: usize,
    /// Where it stands, seen from the node.
    place: DMat4,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) colour: Rgb,
    rest: Vec<DVec3>,
    /// Displacements of every vertex, for each morph target that has any.
    targets: Vec<(usize, Vec<DVec3>)>,
    /// Weights of the morph targets where no clip sets them.
    weights: Vec<f64>,
    skin: Option<Skin>,
}

/// All primitives of triangles in the scene, in the order of its nodes.
pub(super) fn all(
    file: &File,
    rig: &Rig,
    notes: &mut Vec<String>,
) -> Result<Vec<Part>, SceneError> {
    let nodes: Vec<_> = file.document.nodes().collect();
    let mut parts = Vec::new();
    let mut skipped = BTreeMap::new();
    for node in rig.visible(file).into_iter().map(|i| &nodes[i]) {
        let places = instances::places(file, node)?;
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            match primitive.mode() {
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => {
                    let part = Part::new(file, node, &primitive, notes)?;
                    let placed = |&place: &DMat4| Part {
                        place,
                        ..part.clone()
                    };
                    parts.extend(places.iter().map(placed));
                }
                mode => *skipped.entry(format!("{mode:?}")).or_insert(0) += 1,
            }
        }
    }
    notes.extend(
        skipped
            .iter()
            .map(|(mode, n)| format!("skipped {n} primitives of mode {mode}")),
    );
    Ok(parts)
}

/// Refuses meshes that memory does not hold: a small file may show one of them many times.
pub(super) fn check_memory(file: &File, rig: &Rig, options: &Options) -> Result<(), SceneError> {
    let nodes: Vec<_> = file.document.nodes().collect();
    let mut bytes = 0_u64;
    for node in rig.visible(file).into_iter().map(|i| &nodes[i]) {
        let copies = instances::count(file, node)? as u64;
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            let kept = kept(file, &primitive)?.saturating_mul(copies);
            bytes = bytes.saturating_add(kept);
        }
    }
    let what = "the meshes of its nodes".to_owned();
    memory::check(file.path.display(), what, bytes, options)
}

/// Bytes that what is kept of a primitive takes.
fn kept(file: &File, primitive: &Primitive<'_>) -> Result<u64, SceneError> {
    let count = |a: Option<gltf::Accessor<'_>>| a.map_or(Ok(0), |a| count(file, &a));
    let vertices = count(primitive.get(&Semantic::Positions))?;
    let mut points = vertices;
    for target in primitive.morph_targets() {
        points += count(target.positions())?;
    }
    let corners = match primitive.indices() {
        Some(accessor) => count(Some(accessor))?,
        None => vertices,
    };
    let bytes = points * size_of::<DVec3>() + corners * size_of::<u32>();
    Ok(bytes as u64)
}

impl Part {
    fn new(
        file: &File,
        node: &Node<'_>,
        primitive: &Primitive<'_>,
        notes: &mut Vec<String>,
    ) -> Result<Self, SceneError> {
        // The document was checked to have positions everywhere.
        let positions = primitive.get(&Semantic::Positions);
        let positions = positions.map_or(Ok(Vec::new()), |a| vectors::<3>(file, &a))?;
        let mut triangles = triangles(file, primitive, positions.len(), notes)?;
        let mut targets = Vec::new();
        for (number, target) in primitive.morph_targets().enumerate() {
            let Some(accessor) = target.positions() else {
                continue;
            };
            let moves = vectors::<3>(file, &accessor)?;
            check_count(file, accessor.index(), moves.len(), positions.len())?;
            targets.push((number, moves));
        }
        let mut skin = node
            .skin()
            .map(|skin| Skin::new(file, &skin, primitive, positions.len()))
            .transpose()?;
        let kept = compact(&mut triangles, positions.len());
        if let Some(skin) = &mut skin {
            skin.holds = kept
                .iter()
                .map(|&v| std::mem::take(&mut skin.holds[v as usize]))
                .collect();
        }
        let keep = |from: Vec<[f32; 3]>| {
            kept.iter()
                .map(|&v| DVec3::from_array(from[v as usize].map(f64::from)))
                .collect()
        };
        let weights = node
            .weights()
            .or_else(|| node.mesh()?.weights())
            .unwrap_or_default();
        let [r, g, b, _] = primitive
            .material()
            .pbr_metallic_roughness()
            .base_color_factor();
        Ok(Self {
            node: node.index(),
            place: DMat4::IDENTITY,
            triangles,
            colour: from_linear([r, g, b]),
            rest: keep(positions),
            targets: targets
                .into_iter()
                .map(|(number, moves)| (number, keep(moves)))
                .collect(),
            weights: weights.iter().map(|&w| f64::from(w)).collect(),
            skin,
        })
    }

    /// How many vertices it has.
    pub(super) fn vertices(&self) -> usize {
        self.rest.len()
    }

    /// Where its vertices stand.
    pub(super) fn positions(&self, pose: &Pose, motion: &Motion, time: f64) -> Vec<Point> {
        let mut points = self.rest.clone();
        let weights = motion.weights(self.node, time);
        let weights = weights.as_ref().unwrap_or(&self.weights);
        for (number, moves) in &self.targets {
            let weight = weights.get(*number).copied().unwrap_or(0.0);
            if weight != 0.0 {
                points
                    .iter_mut()
                    .zip(moves)
                    .for_each(|(p, m)| *p += weight * *m);
            }
        }
        let world = pose.world(self.node) * self.place;
        match &self.skin {
            Some(skin) => skin.bend(&mut points, pose, world),
            None => points
                .iter_mut()
                .for_each(|p| *p = world.transform_point3(*p)),
        }
        points.into_iter().map(|p| p.as_vec3().to_array()).collect()
    }
}

/// Refuses an accessor that has not one element a vertex.
pub(super) fn check_count(
    file: &File,
    accessor: usize,
    found: usize,
    vertices: usize,
) -> Result<(), SceneError> {
    if found == vertices {
        return Ok(());
    }
    let cause = format!("{found} elements for {vertices} vertices");
    Err(wrong(file, FileLocation::Item("accessor", accessor), cause))
}

/// Vertices of each triangle, in the order of the file.
fn triangles(
    file: &File,
    primitive: &Primitive<'_>,
    vertices: usize,
    notes: &mut Vec<String>,
) -> Result<Vec<[u32; 3]>, SceneError> {
    let accessor = primitive.indices();
    let list = match &accessor {
        Some(accessor) => indices(file, accessor)?,
        None => (0..vertices as u32).collect(),
    };
    if let Some((at, vertex)) = list
        .iter()
        .enumerate()
        .find(|(_, v)| **v as usize >= vertices)
    {
        let place = accessor.map_or(FileLocation::File, |a| {
            FileLocation::Item("accessor", a.index())
        });
        return Err(wrong(
            file,
            place,
            format!("index {at} names vertex {vertex}, but there are {vertices}"),
        ));
    }
    Ok(match primitive.mode() {
        Mode::TriangleStrip => list
            .windows(3)
            .enumerate()
            .map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[0], w[2], w[1]]
                }
            })
            .collect(),
        Mode::TriangleFan => list
            .iter()
            .skip(1)
            .zip(list.iter().skip(2))
            .map(|(&b, &c)| [list[0], b, c])
            .collect(),
        _ => {
            let (whole, rest) = list.as_chunks::<3>();
            if !rest.is_empty() {
                notes.push(format!(
                    "left out {} indices that make no whole triangle",
                    rest.len()
                ));
            }
            whole.to_vec()
        }
    })
}
