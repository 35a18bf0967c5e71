//! A tree as the host sees it when it looks at a device's memory.

use crate::Shape;
use crate::params::{scale, scaled_point};
use crate::rebuild::{links_of_rows, read};
use backend::Layout;
use bvh_layout::{Topology, Treelets};
use geom::{Aabb, Animation, Point};
use std::collections::VecDeque;

/// What a device holds of the tree in use.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The tree's shape, and whether it was made on the device.
    pub shape: &'a Shape,
    /// Likewise.
    pub made_on_device: bool,
    /// The buffer `nodes`, [`Shape::node_rows`] long.
    pub rows: &'a [[u32; 4]],
    /// The leaves' triangles: of the buffer `sorted` where the tree was made on the device, else of the record.
    pub triangles: &'a [u32],
    /// The scene.
    pub animation: &'a Animation,
}

impl View<'_> {
    /// The record of a tree made on the device.
    ///
    /// # Errors
    /// What the device made is no tree.
    pub fn topology(&self) -> Result<Topology, String> {
        Ok(self.found()?.0)
    }

    /// One box a node in breadth-first order, in the scene's units, as [`backend::Inspect::boxes`] gives them.
    /// `positions` are those that the boxes were made of.
    ///
    /// # Errors
    /// The tree was made on the device and is none.
    pub fn boxes(&self, positions: &[Point]) -> Result<Vec<Aabb>, String> {
        let found = self.made_on_device.then(|| self.found()).transpose()?;
        if self.shape.layout == Layout::Fast {
            let rows: &[[f32; 4]] = bytemuck::cast_slice(self.rows);
            return Ok(unfold(rows, self.triangles, self.animation, positions));
        }
        let boxes = self.boxes_of_nodes();
        Ok(match found {
            Some((_, places)) => places.iter().map(|&i| boxes[i as usize]).collect(),
            None => boxes,
        })
    }

    /// The tree made on the device, and where each node of its record lies there.
    fn found(&self) -> Result<(Topology, Vec<u32>), String> {
        let links = match self.shape.layout {
            Layout::Bvh2 => self.rows.iter().step_by(2).map(|row| row[3]).collect(),
            Layout::Fast => links_of_rows(self.rows, self.triangles.len())?,
        };
        let scene = self.animation.triangle_count() as u32;
        read(&links, self.triangles, scene)
    }

    fn boxes_of_nodes(&self) -> Vec<Aabb> {
        let unscale = scale(-self.animation.scale_exponent());
        let point = |row: &[u32; 4]| [0, 1, 2].map(|i| f32::from_bits(row[i]) * unscale);
        let pairs = self.rows.chunks_exact(2);
        pairs
            .map(|pair| Aabb {
                min: point(&pair[0]),
                max: point(&pair[1]),
            })
            .collect()
    }
}

/// Bits of the word that tells traversal how to go on: a leaf, and one of two triangles.
const LEAF: u32 = 1 << 31;
const TWO: u32 = 1 << 30;

/// One box a node in breadth-first order and in the scene's units, as [`backend::Inspect::boxes`] gives them.
///
/// `nodes` are the buffer's rows; `words` are those of the [`Treelets`] from the triangles on, or the triangles of a tree made on the device.
/// Boxes of triangles that share a leaf stand nowhere: they are made anew from `positions`.
fn unfold(
    nodes: &[[f32; 4]],
    words: &[u32],
    animation: &Animation,
    positions: &[Point],
) -> Vec<Aabb> {
    let tree = Tree {
        nodes,
        words,
        animation,
        positions,
        exponent: animation.scale_exponent(),
    };
    let leaves = animation.live_count();
    let mut boxes = Vec::with_capacity((2 * leaves).saturating_sub(1));
    let mut waiting: VecDeque<_> = (leaves > 0).then(|| tree.node(0)).into_iter().collect();
    while let Some(node) = waiting.pop_front() {
        boxes.push(tree.unscaled(node.own));
        waiting.extend(tree.children(node).into_iter().flatten());
    }
    boxes
}

struct Tree<'a> {
    nodes: &'a [[f32; 4]],
    words: &'a [u32],
    animation: &'a Animation,
    positions: &'a [Point],
    exponent: i32,
}

#[derive(Clone, Copy)]
struct Node {
    own: Aabb,
    below: Below,
}

#[derive(Clone, Copy)]
enum Below {
    Inner(usize),
    Two([Aabb; 2]),
    Nothing,
}

impl Tree<'_> {
    fn children(&self, node: Node) -> Option<[Node; 2]> {
        let below = Below::Nothing;
        match node.below {
            Below::Inner(at) => Some([self.node(4 * at), self.node(4 * at + 2)]),
            Below::Two(boxes) => Some(boxes.map(|own| Node { own, below })),
            Below::Nothing => None,
        }
    }

    fn node(&self, row: usize) -> Node {
        let [low, high] = [self.nodes[row], self.nodes[row + 1]];
        let own = Aabb {
            min: [low[0], low[1], low[2]],
            max: [high[0], high[1], high[2]],
        };
        let name = low[3].to_bits();
        let below = match name & LEAF {
            0 => Below::Inner(name as usize),
            _ => self.leaf(name, own),
        };
        Node { own, below }
    }

    /// A leaf of two whose other triangle cannot be hit goes by the number of the one that can.
    fn leaf(&self, name: u32, own: Aabb) -> Below {
        let first = (name & !(LEAF | TWO)) as usize;
        let shares = |leaf: usize| self.words[leaf] & Treelets::SHARED != 0;
        if name & TWO != 0 {
            Below::Two([self.triangle(first), self.triangle(first + 1)])
        } else if shares(first) {
            Below::Two([own, Aabb::EMPTY])
        } else if first > 0 && shares(first - 1) {
            Below::Two([Aabb::EMPTY, own])
        } else {
            Below::Nothing
        }
    }

    fn triangle(&self, leaf: usize) -> Aabb {
        let triangle = self.words[leaf] & !Treelets::SHARED;
        let corners = self.animation.triangles()[triangle as usize];
        let corners = corners.map(|v| scaled_point(self.positions[v as usize], self.exponent));
        let least = |i| corners.iter().map(|c| c[i]).fold(f32::INFINITY, f32::min);
        let most = |i| {
            corners
                .iter()
                .map(|c| c[i])
                .fold(f32::NEG_INFINITY, f32::max)
        };
        Aabb {
            min: [0, 1, 2].map(least),
            max: [0, 1, 2].map(most),
        }
    }

    fn unscaled(&self, b: Aabb) -> Aabb {
        let point = |p: Point| p.map(|x| x * scale(-self.exponent));
        Aabb {
            min: point(b.min),
            max: point(b.max),
        }
    }
}
