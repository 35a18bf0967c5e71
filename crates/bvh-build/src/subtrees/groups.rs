//! Finds the subtrees of a tree that are still compact.

use crate::gather::is_usable;
use crate::{BinaryTree, Boxes, Subtree};
use geom::Aabb;
use rayon::prelude::*;

/// Maximum number of triangles of a group.
pub(super) const MOST: u32 = 8;
/// Maximum number of levels below a group's root.
pub(super) const MAX_GROUP_HEIGHT: u32 = MOST - 1;
/// Maximum ratio of a box's area to the summed areas of its two child boxes, for each inner node of a group.
const TOGETHER: f64 = 1.2;
/// Maximum number of leaves of the subtree that one task visits.
const TASK: u32 = 2048;

/// Half areas of nodes, from which the costs of trees are computed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Areas {
    /// Half area of the root.
    pub(super) root: f64,
    /// Sum over all nodes.
    pub(super) all: f64,
    /// Sum over the nodes below the roots of groups.
    pub(super) within_groups: f64,
}

/// The groups of a tree from left to right, with their boxes. A group is a subtree of few triangles that are close
/// together. Keeps its memory.
#[derive(Debug, Default)]
pub(super) struct SubtreeGroups {
    pub(super) nodes: Vec<Subtree>,
    pub(super) boxes: Vec<Aabb>,
    parts: Vec<TaskGroups>,
}

impl SubtreeGroups {
    pub(super) fn find<B: Boxes + ?Sized>(&mut self, tree: &BinaryTree, boxes: &B) -> Areas {
        let mut tasks = Vec::new();
        if let Some(root) = tree.root() {
            split(tree, root, &mut tasks);
        }
        self.parts.resize_with(tasks.len(), TaskGroups::default);
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

/// Divides `node` into subtrees of at most [`TASK`] leaves, and appends them from left to right. Each is one task.
fn split(tree: &BinaryTree, node: Subtree, out: &mut Vec<Subtree>) {
    if node.leaves <= TASK {
        return out.push(node);
    }
    let [a, b] = tree.children(node);
    split(tree, a, out);
    split(tree, b, out);
}

/// Adds the areas of `node` and of all nodes below to `areas`. Returns the node's box. `parts` returns the results of
/// the tasks below `node`, from left to right.
fn sum<'a>(
    tree: &BinaryTree,
    node: Subtree,
    parts: &mut impl Iterator<Item = &'a TaskGroups>,
    areas: &mut Areas,
) -> Aabb {
    if node.leaves > TASK {
        let [a, b] = tree.children(node);
        let both = sum(tree, a, parts, areas).union(sum(tree, b, parts, areas));
        areas.all += both.half_area();
        return both;
    }
    let part = parts.next().expect("one part per task");
    areas.all += part.areas.all;
    areas.within_groups += part.areas.within_groups;
    part.bounds
}

/// Concatenates the slices that `of` returns for each part.
fn join<T: Copy + Default + Send + Sync>(
    from: &[TaskGroups],
    to: &mut Vec<T>,
    of: impl Fn(&TaskGroups) -> &[T] + Sync,
) {
    to.resize(from.iter().map(|part| of(part).len()).sum(), T::default());
    let mut rest = &mut to[..];
    let mut places = Vec::with_capacity(from.len());
    for part in from {
        let place = rest.split_off_mut(..of(part).len());
        places.push((place.expect("the total length of all parts"), part));
    }
    let fill = |(place, part): (&mut [T], &TaskGroups)| place.copy_from_slice(of(part));
    places.into_par_iter().for_each(fill);
}

/// Result of one task.
#[derive(Debug, Default)]
struct TaskGroups {
    /// Boxes of all triangles, from left to right.
    leaves: Vec<Aabb>,
    nodes: Vec<Subtree>,
    boxes: Vec<Aabb>,
    areas: Areas,
    bounds: Aabb,
}

/// Summary of a visited subtree.
#[derive(Clone, Copy)]
struct Visited {
    bounds: Aabb,
    area: f64,
    /// Sum of the areas below the root, if the subtree can be one group.
    within: Option<f64>,
}

impl TaskGroups {
    fn find<B: Boxes + ?Sized>(&mut self, tree: &BinaryTree, boxes: &B, task: Subtree) {
        self.nodes.clear();
        self.boxes.clear();
        self.areas = Areas::default();
        // Triangles are scattered in memory. Reading all boxes in one loop overlaps the cache misses.
        let leaves = tree.triangles(task).iter().map(|&t| boxes.get(t));
        self.leaves.clear();
        self.leaves.extend(leaves);
        let visited = self.visit(tree, task, task.first_leaf);
        self.areas.within_groups += visited.within.unwrap_or(0.0);
        self.bounds = visited.bounds;
    }

    /// Adds the groups below `node`. The leaves of the task start at `first`.
    fn visit(&mut self, tree: &BinaryTree, node: Subtree, first: u32) -> Visited {
        let before = self.nodes.len();
        let visited = if node.leaves == 1 {
            let bounds = self.leaves[(node.first_leaf - first) as usize];
            assert!(
                is_usable(&bounds),
                "a triangle of the last tree has no usable box"
            );
            let area = bounds.half_area();
            let within = Some(0.0);
            Visited {
                bounds,
                area,
                within,
            }
        } else {
            let children = tree.children(node).map(|c| self.visit(tree, c, first));
            let visited = combine(children, node.leaves);
            if visited.within.is_none() {
                let within = children.iter().filter_map(|c| c.within);
                self.areas.within_groups += within.sum::<f64>();
            }
            visited
        };
        self.areas.all += visited.area;
        if visited.within.is_some() {
            self.nodes.truncate(before);
            self.nodes.push(node);
            self.boxes.truncate(before);
            self.boxes.push(visited.bounds);
        }
        visited
    }
}

/// Combines two children to a node of `leaves` leaves.
fn combine([a, b]: [Visited; 2], leaves: u32) -> Visited {
    let bounds = a.bounds.union(b.bounds);
    let area = bounds.half_area();
    let apart = a.area + b.area;
    let together = leaves <= MOST && area <= TOGETHER * apart;
    let within = a.within.zip(b.within).filter(|_| together);
    Visited {
        bounds,
        area,
        within: within.map(|(x, y)| x + y + apart),
    }
}
