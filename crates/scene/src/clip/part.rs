//! Drawn primitives with their nodes, morph targets and skins.

use super::accessor::{count, floats, indices};
use super::document::GltfFile;
use super::motion::ClipMotion;
use super::rig::{self, Rig};
use super::schema::{GltfMaterial, GltfMesh, GltfNode, GltfPrimitive, Whole};
use super::transform::vector;
use crate::mesh::{compact, from_linear};
use crate::paging::check_memory;
use crate::rounding::Position;
use crate::{Result, Rgb, SceneOptions};
use glam::{DMat4, DVec3, Mat4};
use std::collections::BTreeMap;

/// Topology of a primitive.
#[derive(Clone, Copy)]
enum Mode {
    Triangles,
    Strip,
    Fan,
    /// Topology without triangles, by name.
    Other(&'static str),
}

impl Mode {
    fn of(primitive: &GltfPrimitive) -> Option<Self> {
        Some(match primitive.mode.map_or(4, |mode| mode.0) {
            0 => Self::Other("Points"),
            1 => Self::Other("Lines"),
            2 => Self::Other("LineLoop"),
            3 => Self::Other("LineStrip"),
            4 => Self::Triangles,
            5 => Self::Strip,
            6 => Self::Fan,
            _ => return None,
        })
    }
}

/// Triangle primitives of the scene, in node order.
pub(super) struct Drawn<'a> {
    items: Vec<Item<'a>>,
    /// Number of primitives that are not drawn, by reason.
    skipped: BTreeMap<String, usize>,
}

/// Primitive of a node's mesh.
#[derive(Clone, Copy)]
struct Item<'a> {
    index: usize,
    node: &'a GltfNode,
    mesh: &'a GltfMesh,
    primitive: &'a GltfPrimitive,
    /// Accessor of the positions.
    positions: Whole,
    mode: Mode,
}

impl<'a> Drawn<'a> {
    pub(super) fn of(file: &'a GltfFile, rig: &Rig) -> Result<Self> {
        let mut drawn = Self {
            items: Vec::new(),
            skipped: BTreeMap::new(),
        };
        for index in rig.visible(file)? {
            let node = &file.document.nodes[index];
            let Some(number) = node.mesh else { continue };
            let mesh = file.item("mesh", &file.document.meshes, number)?;
            for primitive in &mesh.primitives {
                let mode = Mode::of(primitive).ok_or_else(|| {
                    let mode = primitive.mode.map_or(0, |mode| mode.0);
                    file.wrong(("mesh", number.0), format!("unknown mode {mode}"))
                })?;
                let reason = match (mode, primitive.positions()) {
                    (Mode::Other(name), _) => format!("of mode {name}"),
                    (_, None) => "without positions".to_owned(),
                    (_, Some(positions)) => {
                        drawn.items.push(Item {
                            index,
                            node,
                            mesh,
                            primitive,
                            positions,
                            mode,
                        });
                        continue;
                    }
                };
                *drawn.skipped.entry(reason).or_insert(0) += 1;
            }
        }
        Ok(drawn)
    }

    /// Returns remarks on primitives that are not drawn.
    pub(super) fn skipped(&self) -> Vec<String> {
        let skipped = self.skipped.iter();
        let remark = |(reason, n)| format!("skipped {n} primitives {reason}");
        skipped.map(remark).collect()
    }

    /// Refuses meshes that exceed the memory limit. A small file can exceed it, because many nodes may share a mesh.
    pub(super) fn check_memory(&self, file: &GltfFile, options: &SceneOptions) -> Result<()> {
        let mut bytes = 0_u64;
        for item in &self.items {
            let copies = rig::copies(file, item.index)? as u64;
            bytes = bytes.saturating_add(item.bytes(file)?.saturating_mul(copies));
        }
        let what = "the meshes of its nodes".to_owned();
        check_memory(&file.path, what, bytes, options)
    }

    pub(super) fn parts(&self, file: &GltfFile, notes: &mut Vec<String>) -> Result<Vec<ClipPart>> {
        let mut parts = Vec::new();
        for item in &self.items {
            let part = item.part(file, notes)?;
            let copy = |place| ClipPart {
                place,
                ..part.clone()
            };
            parts.extend(rig::places(file, item.index)?.into_iter().map(copy));
        }
        Ok(parts)
    }
}

impl Item<'_> {
    /// Returns the bytes that one instance needs.
    fn bytes(&self, file: &GltfFile) -> Result<u64> {
        let vertices = count(file, self.positions)?;
        let mut points = vertices;
        for target in self.primitive.displacements().flatten() {
            points += count(file, target)?;
        }
        let corners = match self.primitive.indices {
            Some(accessor) => count(file, accessor)?,
            None => vertices,
        };
        let bytes = points * size_of::<DVec3>() + corners * size_of::<u32>();
        Ok(bytes as u64)
    }

    fn part(&self, file: &GltfFile, notes: &mut Vec<String>) -> Result<ClipPart> {
        let positions = floats(file, self.positions)?;
        let mut triangles = self.triangles(file, positions.len(), notes)?;
        let mut moved = Vec::new();
        for (number, target) in self.primitive.displacements().enumerate() {
            let Some(accessor) = target else {
                continue;
            };
            let moves = floats::<3>(file, accessor)?;
            check_count(file, accessor, moves.len(), positions.len())?;
            moved.push((number, moves));
        }
        let skin = self.node.skin;
        let skin = skin.map(|skin| VertexSkin::new(file, skin, self.primitive, positions.len()));
        let mut skin = skin.transpose()?;
        let kept = compact(&mut triangles, positions.len());
        let used = || kept.iter().map(|&v| v as usize);
        if let Some(VertexSkin { influences, .. }) = &mut skin {
            *influences = used().map(|v| std::mem::take(&mut influences[v])).collect();
        }
        let keep = |from: Vec<[f32; 3]>| used().map(|v| vector(from[v])).collect();
        let targets = moved.into_iter().map(|(n, moves)| (n, keep(moves)));
        let targets = targets.collect();
        let weights = self.node.weights.as_ref().or(self.mesh.weights.as_ref());
        Ok(ClipPart {
            node: self.index,
            place: DMat4::IDENTITY,
            triangles,
            colour: from_linear(self.colour(file)),
            rest: keep(positions),
            targets,
            weights: weights.cloned().unwrap_or_default(),
            skin,
        })
    }

    fn colour(&self, file: &GltfFile) -> [f32; 3] {
        let materials = &file.document.materials;
        let material = self.primitive.material.and_then(|m| materials.get(m.0));
        material.map_or([1.0; 3], GltfMaterial::base_colour)
    }

    /// Returns the vertices of each triangle, in file order.
    fn triangles(
        &self,
        file: &GltfFile,
        vertices: usize,
        notes: &mut Vec<String>,
    ) -> Result<Vec<[u32; 3]>> {
        let accessor = self.primitive.indices;
        let list = match accessor {
            Some(accessor) => indices(file, accessor)?,
            None => (0..vertices as u32).collect(),
        };
        if let Some(at) = list.iter().position(|&v| v as usize >= vertices) {
            let place = ("accessor", accessor.map_or(0, |a| a.0));
            let vertex = list[at];
            let cause = format!("index {at} names vertex {vertex}, but there are {vertices}");
            return Err(file.wrong(place, cause));
        }
        Ok(match self.mode {
            Mode::Strip => {
                let turned = |(i, w): (usize, &[u32])| [w[0], w[1 + i % 2], w[2 - i % 2]];
                list.windows(3).enumerate().map(turned).collect()
            }
            Mode::Fan => {
                let rim = list.iter().skip(1).zip(list.iter().skip(2));
                rim.map(|(&b, &c)| [list[0], b, c]).collect()
            }
            Mode::Triangles | Mode::Other(_) => {
                let (whole, rest) = list.as_chunks::<3>();
                if !rest.is_empty() {
                    let left = rest.len();
                    let note = format!("skipped {left} indices after the last whole triangle");
                    notes.push(note);
                }
                whole.to_vec()
            }
        })
    }
}

fn check_count(file: &GltfFile, accessor: Whole, found: usize, vertices: usize) -> Result<()> {
    if found == vertices {
        return Ok(());
    }
    let cause = format!("{found} elements for {vertices} vertices");
    Err(file.wrong(("accessor", accessor.0), cause))
}

/// Drawn primitive with everything that determines its positions.
#[derive(Clone)]
pub(super) struct ClipPart {
    node: usize,
    /// Transform relative to the node.
    place: DMat4,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) colour: Rgb,
    /// Positions of the vertices without animation, relative to the mesh.
    rest: Vec<DVec3>,
    /// Index of each morph target with displacements, and its displacement of each vertex.
    targets: Vec<(usize, Vec<DVec3>)>,
    /// Weights of the morph targets, used if the clip does not animate them.
    weights: Vec<f64>,
    skin: Option<VertexSkin>,
}

impl ClipPart {
    pub(super) fn vertices(&self) -> usize {
        self.rest.len()
    }

    /// Returns the positions in world space.
    pub(super) fn positions(
        &self,
        pose: &[DMat4],
        motion: &ClipMotion,
        time: f64,
    ) -> Vec<Position> {
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
        points.into_iter().map(|p| p.to_array()).collect()
    }
}

/// Joint of a skin.
#[derive(Clone, Copy)]
struct SkinJoint {
    node: usize,
    inverse_bind: DMat4,
}

/// Influence of a joint on a vertex.
#[derive(Clone, Copy)]
struct Influence {
    /// Index of the joint in its skin.
    joint: usize,
    weight: f64,
}

/// Skin with its weights for one primitive.
#[derive(Clone)]
struct VertexSkin {
    joints: Vec<SkinJoint>,
    /// Influences on each vertex. Their weights add up to 1. A vertex without influences follows its node.
    influences: Vec<Vec<Influence>>,
}

impl VertexSkin {
    fn new(
        file: &GltfFile,
        number: Whole,
        primitive: &GltfPrimitive,
        vertices: usize,
    ) -> Result<Self> {
        let skin = file.item("skin", &file.document.skins, number)?;
        let mut joints = Vec::with_capacity(skin.joints.len());
        for &joint in &skin.joints {
            file.node(joint)?;
            joints.push(SkinJoint {
                node: joint.0,
                inverse_bind: DMat4::IDENTITY,
            });
        }
        if let Some(accessor) = skin.inverse_bind_matrices {
            let binds = floats::<16>(file, accessor)?;
            if binds.len() < joints.len() {
                let (found, joints) = (binds.len(), joints.len());
                let cause = format!("{found} inverse bind matrices for {joints} joints");
                return Err(file.wrong(("skin", number.0), cause));
            }
            for (joint, bind) in joints.iter_mut().zip(&binds) {
                joint.inverse_bind = Mat4::from_cols_array(bind).as_dmat4();
            }
        }
        let mut skin = Self {
            joints,
            influences: vec![Vec::new(); vertices],
        };
        for set in 0.. {
            let attribute = |name| primitive.attributes.get(&format!("{name}_{set}"));
            let Some((&joints, &weights)) = attribute("JOINTS").zip(attribute("WEIGHTS")) else {
                break;
            };
            skin.add_influences(file, joints, weights)?;
        }
        skin.influences.iter_mut().for_each(normalise);
        Ok(skin)
    }

    /// Adds one set of four influences per vertex. A joint index with weight 0 may be invalid.
    fn add_influences(&mut self, file: &GltfFile, joints: Whole, weights: Whole) -> Result<()> {
        let vertices = self.influences.len();
        let (joint_rows, weight_rows) = (floats::<4>(file, joints)?, floats::<4>(file, weights)?);
        check_count(file, joints, joint_rows.len(), vertices)?;
        check_count(file, weights, weight_rows.len(), vertices)?;
        let rows = joint_rows.into_iter().zip(weight_rows);
        for (vertex, (row, weights)) in rows.enumerate() {
            for (joint, weight) in row.into_iter().zip(weights).filter(|(_, w)| *w != 0.0) {
                let (joint, count) = (joint as usize, self.joints.len());
                if joint >= count {
                    let cause =
                        format!("vertex {vertex} uses joint {joint}, but the skin has {count}");
                    return Err(file.wrong(("accessor", joints.0), cause));
                }
                let weight = f64::from(weight);
                self.influences[vertex].push(Influence { joint, weight });
            }
        }
        Ok(())
    }

    /// Transforms each vertex by its joints. The node's own transform `world` applies only to vertices without
    /// influences (glTF 2.0, 3.7.3.3).
    fn bend(&self, points: &mut [DVec3], pose: &[DMat4], world: DMat4) {
        let joints = self.joints.iter();
        let joints: Vec<_> = joints.map(|j| pose[j.node] * j.inverse_bind).collect();
        for (p, influences) in points.iter_mut().zip(&self.influences) {
            let share = |i: &Influence| i.weight * joints[i.joint].transform_point3(*p);
            *p = if influences.is_empty() {
                world.transform_point3(*p)
            } else {
                influences.iter().map(share).sum()
            };
        }
    }
}

/// Scales the weights so that their sum is 1. Files often store them with few bits, so that their sum is inexact.
fn normalise(influences: &mut Vec<Influence>) {
    let sum: f64 = influences.iter().map(|i| i.weight).sum();
    if sum == 0.0 {
        influences.clear();
    }
    influences.iter_mut().for_each(|i| i.weight /= sum);
}
