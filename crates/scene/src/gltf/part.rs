//! Drawn primitives with their nodes, morph targets and skins.

use super::accessor::{floats, indices};
use super::document::GltfFile;
use super::motion::{ClipMotion, NodeProperty};
use super::rig::{Rig, instance_transforms};
use super::schema::{GltfMaterial, GltfPrimitive, WholeNumber};
use super::transform::vector;
use crate::mesh::{append, from_linear, renumber_used_vertices};
use crate::rounding::Position;
use crate::{Result, Rgb};
use glam::{DMat4, DVec3, Mat4};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

/// Names of the modes 0 to 3, which have no triangles.
const OTHER_MODES: [&str; 4] = ["Points", "Lines", "LineLoop", "LineStrip"];
const TRIANGLES: usize = 4;
const STRIP: usize = 5;
const FAN: usize = 6;

/// Triangle primitives of the scene, in node order.
#[derive(Default)]
pub(super) struct Drawn {
    pub(super) parts: Vec<ClipPart>,
    /// Remarks on primitives that are drawn.
    pub(super) notes: Vec<String>,
    /// Number of primitives that are not drawn, by reason.
    skipped: BTreeMap<String, usize>,
}

impl Drawn {
    pub(super) fn of(file: &GltfFile, rig: &Rig) -> Result<Self> {
        let mut drawn = Self::default();
        let mut shared = BTreeMap::new();
        for node in rig.visible(file)? {
            let own = &file.document.nodes[node];
            let Some(number) = own.mesh else { continue };
            let mesh = file.item("mesh", &file.document.meshes, number)?;
            let weights = own.weights.as_ref().or(mesh.weights.as_ref());
            for (i, source) in mesh.primitives.iter().enumerate() {
                let mode = source.mode.map_or(TRIANGLES, |mode| mode.0);
                if mode > FAN {
                    return Err(file.wrong(("mesh", number.0), format!("unknown mode {mode}")));
                }
                let other = OTHER_MODES.get(mode);
                let positions = source.positions().filter(|_| other.is_none());
                let Some(positions) = positions else {
                    let reason = other.map(|name| format!("of mode {name}"));
                    let reason = reason.unwrap_or_else(|| "without positions".to_owned());
                    *drawn.skipped.entry(reason).or_insert(0) += 1;
                    continue;
                };
                let reader = PrimitiveReader {
                    file,
                    source,
                    mode,
                    positions,
                    skin: own.skin,
                };
                let key = (number.0, i, own.skin.map(|skin| skin.0));
                let primitive = match shared.entry(key) {
                    Entry::Occupied(known) => Arc::clone(known.get()),
                    Entry::Vacant(new) => {
                        Arc::clone(new.insert(Arc::new(reader.read(&mut drawn.notes)?)))
                    }
                };
                let part = ClipPart {
                    node,
                    instance_transforms: instance_transforms(file, node)?,
                    weights: weights.cloned().unwrap_or_default(),
                    primitive,
                };
                let added = append(&mut drawn.parts, part);
                added.map_err(|e| file.wrong(("node", node), e))?;
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
}

/// Primitive of a file, and the skin of a node that draws it.
struct PrimitiveReader<'a> {
    file: &'a GltfFile,
    source: &'a GltfPrimitive,
    mode: usize,
    /// Accessor of the positions.
    positions: WholeNumber,
    skin: Option<WholeNumber>,
}

impl PrimitiveReader<'_> {
    fn read(&self, notes: &mut Vec<String>) -> Result<Primitive> {
        let file = self.file;
        let mut rest = floats(file, self.positions)?;
        let mut triangles = self.triangles(rest.len(), notes)?;
        let mut targets = Vec::new();
        for (number, target) in self.source.displacements().enumerate() {
            let Some(accessor) = target else {
                continue;
            };
            let moves = floats::<3>(file, accessor)?;
            check_count(file, accessor, moves.len(), rest.len())?;
            targets.push((number, moves));
        }
        let skin = self.skin;
        let skin = skin.map(|skin| VertexSkin::new(file, skin, self.source, rest.len()));
        let mut skin = skin.transpose()?.unwrap_or_default();
        let kept = renumber_used_vertices(&mut triangles, rest.len());
        keep(&mut rest, &kept);
        targets.iter_mut().for_each(|(_, moves)| keep(moves, &kept));
        keep(&mut skin.influences, &kept);
        Ok(Primitive {
            triangles,
            colour: from_linear(self.colour()),
            rest,
            targets,
            skin,
        })
    }

    fn colour(&self) -> [f32; 3] {
        let materials = &self.file.document.materials;
        let material = self.source.material.and_then(|m| materials.get(m.0));
        material.map_or([1.0; 3], GltfMaterial::base_colour)
    }

    /// Returns the vertices of each triangle, in file order.
    fn triangles(&self, vertices: usize, notes: &mut Vec<String>) -> Result<Vec<[u32; 3]>> {
        let accessor = self.source.indices;
        let list = match accessor {
            Some(accessor) => indices(self.file, accessor)?,
            None => (0..vertices as u32).collect(),
        };
        if let Some(at) = list.iter().position(|&v| v as usize >= vertices) {
            let place = ("accessor", accessor.map_or(0, |a| a.0));
            let vertex = list[at];
            let cause = format!(
                "element {at} has vertex index {vertex}, but the vertex count is {vertices}"
            );
            return Err(self.file.wrong(place, cause));
        }
        Ok(match self.mode {
            STRIP => {
                let turned = |(i, w): (usize, &[u32])| [w[0], w[1 + i % 2], w[2 - i % 2]];
                list.windows(3).enumerate().map(turned).collect()
            }
            FAN => {
                let rim = list.iter().skip(1).zip(list.iter().skip(2));
                rim.map(|(&b, &c)| [list[0], b, c]).collect()
            }
            _ => {
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

/// Removes all elements except those at the indices `kept`, which are in ascending order.
fn keep<T>(list: &mut Vec<T>, kept: &[u32]) {
    for (to, &from) in kept.iter().enumerate().take(list.len()) {
        list.swap(to, from as usize);
    }
    list.truncate(kept.len());
}

fn check_count(
    file: &GltfFile,
    accessor: WholeNumber,
    found: usize,
    vertices: usize,
) -> Result<()> {
    if found == vertices {
        return Ok(());
    }
    let cause = format!("{found} elements for {vertices} vertices");
    Err(file.wrong(("accessor", accessor.0), cause))
}

/// Drawn primitive of a node.
pub(super) struct ClipPart {
    node: usize,
    /// Transform of each instance relative to the node.
    instance_transforms: Vec<DMat4>,
    /// Weights of the morph targets, used if the clip does not animate them.
    weights: Vec<f64>,
    primitive: Arc<Primitive>,
}

/// Contents of a primitive, shared by all nodes with the same mesh and skin.
struct Primitive {
    triangles: Vec<[u32; 3]>,
    colour: Rgb,
    /// Positions of the vertices without animation, relative to the mesh.
    rest: Vec<[f32; 3]>,
    /// Index of each morph target with displacements, and its displacement of each vertex.
    targets: Vec<(usize, Vec<[f32; 3]>)>,
    skin: VertexSkin,
}

impl ClipPart {
    /// Returns the number of vertices of all instances.
    pub(super) fn vertices(&self) -> usize {
        let each = self.primitive.rest.len();
        self.instance_transforms.len().saturating_mul(each)
    }

    /// Returns the number of triangles of all instances.
    pub(super) fn triangle_count(&self) -> usize {
        let each = self.primitive.triangles.len();
        self.instance_transforms.len().saturating_mul(each)
    }

    /// Returns the triangles and the number of vertices of each instance.
    pub(super) fn meshes(&self) -> impl Iterator<Item = (&[[u32; 3]], usize)> {
        let Primitive {
            triangles, rest, ..
        } = &*self.primitive;
        let mesh = (triangles.as_slice(), rest.len());
        std::iter::repeat_n(mesh, self.instance_transforms.len())
    }

    /// Returns the colours of the triangles of all instances.
    pub(super) fn colours(&self) -> impl Iterator<Item = Rgb> {
        std::iter::repeat_n(self.primitive.colour, self.triangle_count())
    }

    /// Adds the positions of all instances in world space.
    pub(super) fn add_positions(
        &self,
        pose: &[DMat4],
        motion: &ClipMotion,
        time: f64,
        to: &mut Vec<Position>,
    ) {
        let Primitive {
            rest,
            targets,
            skin,
            ..
        } = &*self.primitive;
        let mut points: Vec<DVec3> = rest.iter().copied().map(vector).collect();
        let weights = motion.at(self.node, NodeProperty::Weights, time);
        let weights = weights.as_ref().unwrap_or(&self.weights);
        for (number, moves) in targets {
            let weight = weights.get(*number).copied().unwrap_or(0.0);
            if weight != 0.0 {
                let each = points.iter_mut().zip(moves);
                each.for_each(|(p, m)| *p += weight * vector(*m));
            }
        }
        let joints = skin.joints.iter();
        let joints: Vec<_> = joints.map(|j| pose[j.node] * j.inverse_bind).collect();
        for transform in &self.instance_transforms {
            let world = pose[self.node] * *transform;
            to.extend(points.iter().enumerate().map(|(vertex, p)| {
                let share = |i: &Influence| i.weight * joints[i.joint].transform_point3(*p);
                // The transform of the node applies only to vertices without influences (glTF 2.0, 3.7.3.3).
                let bent = match skin.influences.get(vertex) {
                    Some(influences) if !influences.is_empty() => {
                        influences.iter().map(share).sum()
                    }
                    _ => world.transform_point3(*p),
                };
                bent.to_array()
            }));
        }
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

/// Skin with its weights for one primitive. Empty for a primitive without a skin.
#[derive(Default)]
struct VertexSkin {
    joints: Vec<SkinJoint>,
    /// Influences on each vertex. Their weights add up to 1. A vertex without influences follows its node.
    influences: Vec<Vec<Influence>>,
}

impl VertexSkin {
    fn new(
        file: &GltfFile,
        number: WholeNumber,
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
    fn add_influences(
        &mut self,
        file: &GltfFile,
        joints: WholeNumber,
        weights: WholeNumber,
    ) -> Result<()> {
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
}

/// Scales the weights so that their sum is 1. Files often store them with few bits, so that their sum is inexact.
fn normalise(influences: &mut Vec<Influence>) {
    let sum: f64 = influences.iter().map(|i| i.weight).sum();
    if sum == 0.0 {
        influences.clear();
    }
    influences.iter_mut().for_each(|i| i.weight /= sum);
}
