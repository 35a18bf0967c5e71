//! What is drawn: a primitive of a mesh at a node, with its morph targets and its skin.

use super::accessor::{count, floats, indices, listed};
use super::document::File;
use super::motion::Motion;
use super::rig::{self, Rig, vector};
use crate::mesh::{compact, from_linear};
use crate::stream::check_memory;
use crate::{Options, Result, Rgb};
use geom::Point;
use glam::{DMat4, DVec3, Mat4};
use gltf::mesh::Mode;
use gltf::{Node, Primitive, Semantic};
use std::collections::BTreeMap;

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
pub(super) fn all(file: &File, rig: &Rig, notes: &mut Vec<String>) -> Result<Vec<Part>> {
    let nodes: Vec<_> = file.document.nodes().collect();
    let mut parts = Vec::new();
    let mut skipped = BTreeMap::new();
    for node in rig.visible(file).into_iter().map(|i| &nodes[i]) {
        let places = rig::places(file, node)?;
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            match primitive.mode() {
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => {
                    let part = Part::new(file, node, &primitive, notes)?;
                    parts.extend(places.iter().map(|&place| Part {
                        place,
                        ..part.clone()
                    }));
                }
                mode => *skipped.entry(format!("{mode:?}")).or_insert(0) += 1,
            }
        }
    }
    let skipped = skipped.iter();
    notes.extend(skipped.map(|(mode, n)| format!("skipped {n} primitives of mode {mode}")));
    Ok(parts)
}

/// Refuses meshes that memory does not hold: a small file may show one of them many times.
pub(super) fn check_room(file: &File, rig: &Rig, options: &Options) -> Result<()> {
    let nodes: Vec<_> = file.document.nodes().collect();
    let mut bytes = 0_u64;
    for node in rig.visible(file).into_iter().map(|i| &nodes[i]) {
        let (copies, _) = rig::instances(file, node)?;
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            let kept = kept(file, &primitive)?.saturating_mul(copies as u64);
            bytes = bytes.saturating_add(kept);
        }
    }
    let what = "the meshes of its nodes".to_owned();
    check_memory(&file.path, what, bytes, options)
}

/// Bytes that what is kept of a primitive takes.
fn kept(file: &File, primitive: &Primitive<'_>) -> Result<u64> {
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
    ) -> Result<Self> {
        // The document was checked to have positions everywhere.
        let positions = listed(file, primitive.get(&Semantic::Positions))?;
        let mut triangles = triangles(file, primitive, positions.len(), notes)?;
        let mut moved = Vec::new();
        for (number, target) in primitive.morph_targets().enumerate() {
            let Some(accessor) = target.positions() else {
                continue;
            };
            let moves = floats::<3>(file, &accessor)?;
            check_count(file, accessor.index(), moves.len(), positions.len())?;
            moved.push((number, moves));
        }
        let skin = node.skin();
        let skin = skin.map(|skin| Skin::new(file, &skin, primitive, positions.len()));
        let mut skin = skin.transpose()?;
        let kept = compact(&mut triangles, positions.len());
        let used = || kept.iter().map(|&v| v as usize);
        if let Some(Skin { holds, .. }) = &mut skin {
            *holds = used().map(|v| std::mem::take(&mut holds[v])).collect();
        }
        let keep = |from: Vec<[f32; 3]>| used().map(|v| vector(from[v])).collect();
        let targets = moved.into_iter().map(|(n, moves)| (n, keep(moves)));
        let targets = targets.collect();
        let weights = node.weights().or_else(|| node.mesh()?.weights());
        let weights = weights.unwrap_or_default();
        let material = primitive.material().pbr_metallic_roughness();
        let [r, g, b, _] = material.base_color_factor();
        Ok(Self {
            node: node.index(),
            place: DMat4::IDENTITY,
            triangles,
            colour: from_linear([r, g, b]),
            rest: keep(positions),
            targets,
            weights: weights.iter().map(|&w| f64::from(w)).collect(),
            skin,
        })
    }

    pub(super) fn vertices(&self) -> usize {
        self.rest.len()
    }

    pub(super) fn positions(&self, pose: &[DMat4], motion: &Motion, time: f64) -> Vec<Point> {
        let mut points = self.rest.clone();
        let weights = motion.weights(self.node, time);
        let weights = weights.as_ref().unwrap_or(&self.weights);
        for (number, moves) in &self.targets {
            let weight = weights.get(*number).copied().unwrap_or(0.0);
            if weight != 0.0 {
                let each = points.iter_mut().zip(moves);
                each.for_each(|(p, m)| *p += weight * *m);
            }
        }
        let world = pose[self.node] * self.place;
        match &self.skin {
            Some(skin) => skin.bend(&mut points, pose, world),
            None => points
                .iter_mut()
                .for_each(|p| *p = world.transform_point3(*p)),
        }
        points.into_iter().map(|p| p.as_vec3().to_array()).collect()
    }
}

fn check_count(file: &File, accessor: usize, found: usize, vertices: usize) -> Result<()> {
    if found == vertices {
        return Ok(());
    }
    let cause = format!("{found} elements for {vertices} vertices");
    Err(file.wrong(("accessor", accessor), cause))
}

/// Vertices of each triangle, in the order of the file.
fn triangles(
    file: &File,
    primitive: &Primitive<'_>,
    vertices: usize,
    notes: &mut Vec<String>,
) -> Result<Vec<[u32; 3]>> {
    let accessor = primitive.indices();
    let list = match &accessor {
        Some(accessor) => indices(file, accessor)?,
        None => (0..vertices as u32).collect(),
    };
    if let Some(at) = list.iter().position(|&v| v as usize >= vertices) {
        let place = ("accessor", accessor.map_or(0, |a| a.index()));
        let vertex = list[at];
        let cause = format!("index {at} names vertex {vertex}, but there are {vertices}");
        return Err(file.wrong(place, cause));
    }
    Ok(match primitive.mode() {
        Mode::TriangleStrip => {
            let turned = |(i, w): (usize, &[u32])| [w[0], w[1 + i % 2], w[2 - i % 2]];
            list.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => {
            let rim = list.iter().skip(1).zip(list.iter().skip(2));
            rim.map(|(&b, &c)| [list[0], b, c]).collect()
        }
        _ => {
            let (whole, rest) = list.as_chunks::<3>();
            if !rest.is_empty() {
                let left = rest.len();
                let note = format!("left out {left} indices that make no whole triangle");
                notes.push(note);
            }
            whole.to_vec()
        }
    })
}

/// A skin as one primitive uses it.
#[derive(Clone)]
struct Skin {
    /// (Node, inverse bind matrix) of each joint.
    joints: Vec<(usize, DMat4)>,
    /// (Joint, weight) of each vertex, weights with sum 1; none for a vertex that follows its node.
    holds: Vec<Vec<(usize, f64)>>,
}

impl Skin {
    fn new(
        file: &File,
        skin: &gltf::Skin<'_>,
        primitive: &Primitive<'_>,
        vertices: usize,
    ) -> Result<Self> {
        let nodes: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
        let binds = match skin.inverse_bind_matrices() {
            Some(accessor) => {
                let binds = floats::<16>(file, &accessor)?;
                if binds.len() < nodes.len() {
                    let (found, joints) = (binds.len(), nodes.len());
                    let cause = format!("{found} inverse bind matrices for {joints} joints");
                    return Err(file.wrong(("skin", skin.index()), cause));
                }
                let binds = binds.iter().map(Mat4::from_cols_array);
                binds.map(|m| m.as_dmat4()).collect()
            }
            None => vec![DMat4::IDENTITY; nodes.len()],
        };
        let joints: Vec<_> = nodes.into_iter().zip(binds).collect();
        let mut holds = vec![Vec::new(); vertices];
        for set in 0.. {
            let numbers = primitive.get(&Semantic::Joints(set));
            let weights = primitive.get(&Semantic::Weights(set));
            let Some((numbers, weights)) = numbers.zip(weights) else {
                break;
            };
            add_holds(file, &mut holds, joints.len(), (&numbers, &weights))?;
        }
        holds.iter_mut().for_each(normalise);
        Ok(Self { joints, holds })
    }

    /// Each vertex goes where its joints take it; the node itself has no say (glTF 2.0, 3.7.3.3).
    fn bend(&self, points: &mut [DVec3], pose: &[DMat4], world: DMat4) {
        let joints = self.joints.iter().map(|&(node, bind)| pose[node] * bind);
        let joints: Vec<_> = joints.collect();
        for (p, holds) in points.iter_mut().zip(&self.holds) {
            *p = match holds.as_slice() {
                [] => world.transform_point3(*p),
                holds => {
                    let share = |&(joint, weight): &(usize, f64)| {
                        weight * joints[joint].transform_point3(*p)
                    };
                    holds.iter().map(share).sum()
                }
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
) -> Result<()> {
    let place = ("accessor", numbers.index());
    let (found, weight) = (floats::<4>(file, numbers)?, floats::<4>(file, weights)?);
    check_count(file, numbers.index(), found.len(), holds.len())?;
    check_count(file, weights.index(), weight.len(), holds.len())?;
    for (vertex, (found, weight)) in found.into_iter().zip(weight).enumerate() {
        for (joint, weight) in found.into_iter().zip(weight).filter(|(_, w)| *w != 0.0) {
            let joint = joint as usize;
            if joint >= joints {
                let cause =
                    format!("vertex {vertex} hangs on joint {joint}, but the skin has {joints}");
                return Err(file.wrong(place, cause));
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
