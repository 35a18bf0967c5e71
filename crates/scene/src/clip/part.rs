//! Drawn primitives with their nodes, morph targets and skins.

use super::accessor::{count, floats, indices};
use super::document::File;
use super::motion::Motion;
use super::rig::{self, Rig, vector};
use super::schema::{Material, Mesh, Node, Primitive, Whole};
use crate::mesh::{compact, from_linear};
use crate::rounding::Position;
use crate::stream::check_memory;
use crate::{Options, Result, Rgb};
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
    fn of(primitive: &Primitive) -> Option<Self> {
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
    node: &'a Node,
    mesh: &'a Mesh,
    primitive: &'a Primitive,
    /// Accessor of the positions.
    positions: Whole,
    mode: Mode,
}

impl<'a> Drawn<'a> {
    pub(super) fn of(file: &'a File, rig: &Rig) -> Result<Self> {
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

    /// Refuses meshes that exceed the memory limit. A small file may show one mesh many times.
    pub(super) fn check_room(&self, file: &File, options: &Options) -> Result<()> {
        let mut bytes = 0_u64;
        for item in &self.items {
            let copies = rig::copies(file, item.index)? as u64;
            bytes = bytes.saturating_add(item.bytes(file)?.saturating_mul(copies));
        }
        let what = "the meshes of its nodes".to_owned();
        check_memory(&file.path, what, bytes, options)
    }

    pub(super) fn parts(&self, file: &File, notes: &mut Vec<String>) -> Result<Vec<Part>> {
        let mut parts = Vec::new();
        for item in &self.items {
            let part = item.part(file, notes)?;
            let copy = |place| Part {
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
    fn bytes(&self, file: &File) -> Result<u64> {
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

    fn part(&self, file: &File, notes: &mut Vec<String>) -> Result<Part> {
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
        let skin = skin.map(|skin| Skin::new(file, skin, self.primitive, positions.len()));
        let mut skin = skin.transpose()?;
        let kept = compact(&mut triangles, positions.len());
        let used = || kept.iter().map(|&v| v as usize);
        if let Some(Skin { holds, .. }) = &mut skin {
            *holds = used().map(|v| std::mem::take(&mut holds[v])).collect();
        }
        let keep = |from: Vec<[f32; 3]>| used().map(|v| vector(from[v])).collect();
        let targets = moved.into_iter().map(|(n, moves)| (n, keep(moves)));
        let targets = targets.collect();
        let weights = self.node.weights.as_ref().or(self.mesh.weights.as_ref());
        Ok(Part {
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

    fn colour(&self, file: &File) -> [f32; 3] {
        let materials = &file.document.materials;
        let material = self.primitive.material.and_then(|m| materials.get(m.0));
        material.map_or([1.0; 3], Material::base_colour)
    }

    /// Returns the vertices of each triangle, in file order.
    fn triangles(
        &self,
        file: &File,
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
                    let note = format!("left out {left} indices that make no whole triangle");
                    notes.push(note);
                }
                whole.to_vec()
            }
        })
    }
}

fn check_count(file: &File, accessor: Whole, found: usize, vertices: usize) -> Result<()> {
    if found == vertices {
        return Ok(());
    }
    let cause = format!("{found} elements for {vertices} vertices");
    Err(file.wrong(("accessor", accessor.0), cause))
}

/// Drawn primitive with everything that determines its positions.
#[derive(Clone)]
pub(super) struct Part {
    node: usize,
    /// Transform relative to the node.
    place: DMat4,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) colour: Rgb,
    rest: Vec<DVec3>,
    /// Displacements of all vertices, for each morph target with displacements.
    targets: Vec<(usize, Vec<DVec3>)>,
    /// Weights of the morph targets if no clip animates them.
    weights: Vec<f64>,
    skin: Option<Skin>,
}

impl Part {
    pub(super) fn vertices(&self) -> usize {
        self.rest.len()
    }

    /// Returns the positions in world space.
    pub(super) fn positions(&self, pose: &[DMat4], motion: &Motion, time: f64) -> Vec<Position> {
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

/// Skin with its weights for one primitive.
#[derive(Clone)]
struct Skin {
    /// Node and inverse bind matrix of each joint.
    joints: Vec<(usize, DMat4)>,
    /// Joints and weights of each vertex. The weights add up to 1. Without weights, the vertex follows its node.
    holds: Vec<Vec<(usize, f64)>>,
}

impl Skin {
    fn new(file: &File, number: Whole, primitive: &Primitive, vertices: usize) -> Result<Self> {
        let skin = file.item("skin", &file.document.skins, number)?;
        let mut joints = Vec::with_capacity(skin.joints.len());
        for &joint in &skin.joints {
            file.node(joint)?;
            joints.push((joint.0, DMat4::IDENTITY));
        }
        if let Some(accessor) = skin.inverse_bind_matrices {
            let binds = floats::<16>(file, accessor)?;
            if binds.len() < joints.len() {
                let (found, joints) = (binds.len(), joints.len());
                let cause = format!("{found} inverse bind matrices for {joints} joints");
                return Err(file.wrong(("skin", number.0), cause));
            }
            for ((_, bind), found) in joints.iter_mut().zip(&binds) {
                *bind = Mat4::from_cols_array(found).as_dmat4();
            }
        }
        let mut holds = vec![Vec::new(); vertices];
        for set in 0.. {
            let attribute = |name| primitive.attributes.get(&format!("{name}_{set}"));
            let Some((&numbers, &weights)) = attribute("JOINTS").zip(attribute("WEIGHTS")) else {
                break;
            };
            add_holds(file, &mut holds, joints.len(), (numbers, weights))?;
        }
        holds.iter_mut().for_each(normalise);
        Ok(Self { joints, holds })
    }

    /// Transforms each vertex by its joints, but not by the skinned node itself (glTF 2.0, 3.7.3.3).
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

/// Adds one set of four joints per vertex. A joint index with weight 0 may be invalid.
fn add_holds(
    file: &File,
    holds: &mut [Vec<(usize, f64)>],
    joints: usize,
    (numbers, weights): (Whole, Whole),
) -> Result<()> {
    let place = ("accessor", numbers.0);
    let (found, weight) = (floats::<4>(file, numbers)?, floats::<4>(file, weights)?);
    check_count(file, numbers, found.len(), holds.len())?;
    check_count(file, weights, weight.len(), holds.len())?;
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

/// Scales the weights so that their sum is 1, since they are often stored with few bits.
fn normalise(holds: &mut Vec<(usize, f64)>) {
    let sum: f64 = holds.iter().map(|h| h.1).sum();
    if sum == 0.0 {
        holds.clear();
    }
    holds.iter_mut().for_each(|h| h.1 /= sum);
}
