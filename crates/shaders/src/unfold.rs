//! Nodes of layout `fast`, as a device keeps them, back to one box a node in breadth-first order.

use crate::params::{scale, scaled_point};
use bvh_layout::Treelets;
use geom::{Aabb, Animation, Point};
use std::collections::VecDeque;

/// Bits of the word that tells traversal how to go on: a leaf, and one of two triangles.
const LEAF: u32 = 1 << 31;
const TWO: u32 = 1 << 30;

/// One box a node in breadth-first order and in the scene's units, as [`backend::Inspect::boxes`] gives them.
///
/// `nodes` are the buffer's rows; `words` are those of the [`Treelets`] from the triangles on, or the triangles of a tree made on the device.
/// Boxes of triangles that share a leaf stand nowhere: they are made anew from `positions`.
pub(crate) fn unfold(
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
