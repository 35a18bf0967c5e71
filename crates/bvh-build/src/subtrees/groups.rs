//! Which subtrees of a tree still lie together.

use crate::gather::is_usable;
use crate::{BinaryTree, Boxes, Subtree};
use geom::Aabb;
use rayon::prelude::*;

/// Triangles of a group at most.
pub(super) const MOST: u32 = 8;
/// Levels below a group's root at most.
pub(super) const LEVELS: u32 = MOST - 1;
/// Two parts are one while the area of the box round both is so many times that of both boxes at most.
const TOGETHER: f64 = 1.2;
/// Subtrees of at most so many leaves are gone through by one thread.
const TASK: u32 = 2048;

/// Sums of half areas of nodes of the tree at hand.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Areas {
    pub(super) root: f64,
    pub(super) all: f64,
    /// Of those below the roots of groups.
    pub(super) within_groups: f64,
}

/// Groups of a tree, from left to right, with their boxes; keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Groups {
    pub(super) nodes: Vec<Subtree>,
    pub(super) boxes: Vec<Aabb>,
    parts: Vec<Part>,
}

impl Groups {
    pub(super) fn find<B: Boxes + ?Sized>(&mut self, tree: &BinaryTree, boxes: &B) -> Areas {
        let mut tasks = Vec::new();
        if let Some(root) = tree.root() {
            split(tree, root, &mut tasks);
        }
        self.parts.resize_with(tasks.len(), Part::default);
        let parts = self.parts.par_iter_mut().zip(tasks);
        parts.for_each(|(part, task)| part.find(tree, boxes, task));
        join(&self.parts, &mut self.nodes, |p| &p.nodes);
        join(&self.parts, &mut self.boxes, |p| &p.boxes);
        let mut areas = Areas::default();
        if let Some(root) = tree.root() {
            let bounds = sum(tree, root, &mut self.parts.iter(), &mut areas);
            areas.root = bounds.half_area();
        }
        areas
    }
}

/// Subtrees for one thread each that make up `node`, from left to right.
fn split(tree: &BinaryTree, node: Subtree, out: &mut Vec<Subtree>) {
    if node.leaves <= TASK {
        return out.push(node);
    }
    let [a, b] = tree.children(node);
    split(tree, a, out);
    split(tree, b, out);
}

/// Adds the areas below `node` up; gives its box.
fn sum<'a>(
    tree: &BinaryTree,
    node: Subtree,
    parts: &mut impl Iterator<Item = &'a Part>,
    areas: &mut Areas,
) -> Aabb {
    if node.leaves > TASK {
        let [a, b] = tree.children(node);
        let both = sum(tree, a, parts, areas).union(sum(tree, b, parts, areas));
        areas.all += both.half_area();
        return both;
    }
    let part = parts.next().expect("a task for each");
    areas.all += part.areas.all;
    areas.within_groups += part.areas.within_groups;
    part.bounds
}

/// Puts parts of all one after the other.
fn join<T: Copy + Default + Send + Sync>(
    from: &[Part],
    to: &mut Vec<T>,
    of: impl Fn(&Part) -> &[T] + Sync,
) {
    to.resize(from.iter().map(|part| of(part).len()).sum(), T::default());
    let mut rest = &mut to[..];
    let mut places = Vec::with_capacity(from.len());
    for part in from {
        let place = rest.split_off_mut(..of(part).len());
        places.push((place.expect("there is room for all"), part));
    }
    let fill = |(place, part): (&mut [T], &Part)| place.copy_from_slice(of(part));
    places.into_par_iter().for_each(fill);
}

/// What one thread found at a time.
#[derive(Debug, Default)]
struct Part {
    /// Of all triangles, from left to right.
    leaves: Vec<Aabb>,
    nodes: Vec<Subtree>,
    boxes: Vec<Aabb>,
    areas: Areas,
    bounds: Aabb,
}

/// A subtree gone through.
#[derive(Clone, Copy)]
struct Seen {
    bounds: Aabb,
    area: f64,
    /// The areas below its root, if it is one group.
    within: Option<f64>,
}

impl Part {
    fn find<B: Boxes + ?Sized>(&mut self, tree: &BinaryTree, boxes: &B, task: Subtree) {
        self.nodes.clear();
        self.boxes.clear();
        self.areas = Areas::default();
        // Triangles lie scattered in memory: asked for in a row, many are on their way at once.
        let leaves = tree.triangles(task).iter().map(|&t| boxes.get(t));
        self.leaves.clear();
        self.leaves.extend(leaves);
        let seen = self.see(tree, task, task.first_leaf);
        self.areas.within_groups += seen.within.unwrap_or(0.0);
        self.bounds = seen.bounds;
    }

    /// Adds the groups below `node`; the task's own leaves begin with `first`.
    fn see(&mut self, tree: &BinaryTree, node: Subtree, first: u32) -> Seen {
        let before = self.nodes.len();
        let seen = if node.leaves == 1 {
            let bounds = self.leaves[(node.first_leaf - first) as usize];
            assert!(
                is_usable(&bounds),
                "a triangle of the last tree has no usable box"
            );
            let area = bounds.half_area();
            let within = Some(0.0);
            Seen {
                bounds,
                area,
                within,
            }
        } else {
            let children = tree.children(node).map(|c| self.see(tree, c, first));
            let seen = both(children, node.leaves);
            if seen.within.is_none() {
                let within = children.iter().filter_map(|c| c.within);
                self.areas.within_groups += within.sum::<f64>();
            }
            seen
        };
        self.areas.all += seen.area;
        if seen.within.is_some() {
            self.nodes.truncate(before);
            self.nodes.push(node);
            self.boxes.truncate(before);
            self.boxes.push(seen.bounds);
        }
        seen
    }
}

/// A node of so many leaves over two.
fn both([a, b]: [Seen; 2], leaves: u32) -> Seen {
    let bounds = a.bounds.union(b.bounds);
    let area = bounds.half_area();
    let apart = a.area + b.area;
    let together = leaves <= MOST && area <= TOGETHER * apart;
    let within = a.within.zip(b.within).filter(|_| together);
    Seen {
        bounds,
        area,
        within: within.map(|(x, y)| x + y + apart),
    }
}
