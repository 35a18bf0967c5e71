//! Collapses a binary tree to a [`BlockTree`], in parallel, level by level.

use super::costs::CostedTree;
use super::{Block, BlockTree, BlockTreeNode, CollapseOptions, LANES, Link, Ranges, TASK_SIZE};
use bvh_build::{BinaryTree, Subtree};
use rayon::prelude::*;

impl BlockTree {
    /// Collapses a binary tree, in the rayon pool that the caller installed. `triangles` holds three vertex indices for
    /// each triangle of the scene.
    ///
    /// # Panics
    /// If the tree does not belong to a scene of these triangles.
    #[must_use]
    pub fn of(tree: &BinaryTree, triangles: &[[u32; 3]], options: CollapseOptions<'_>) -> Self {
        let boxes = Some(options.boxes).filter(|boxes| boxes.len() == triangles.len());
        let costed = &CostedTree::of(tree, boxes, options.first_visited);
        let (mut all, roots) = Self::nodes_of(costed, tree.root());
        roots
            .into_par_iter()
            .with_min_len(TASK_SIZE / 8)
            .map(|root| of_leaves(&costed.open_block(root), tree.order(), triangles))
            .collect_into_vec(&mut all.blocks);
        all
    }

    /// Creates all wide nodes. Returns them with the binary root of each block.
    fn nodes_of(tree: &CostedTree<'_>, root: Option<Subtree>) -> (Self, Vec<Subtree>) {
        let mut all = Self::default();
        let mut roots = Vec::new();
        let mut level = Vec::from_iter(root);
        while !level.is_empty() {
            level = all.add_level(tree, &level, &mut roots);
        }
        if all.nodes.is_empty() {
            all.nodes.push(BlockTreeNode::EMPTY);
            all.first_blocks.push(0);
            all.first_children.push(1);
            all.levels.push(0..1);
        }
        all.first_blocks.push(roots.len() as u32);
        all.first_children.push(all.nodes.len() as u32);
        (all, roots)
    }

    /// Appends the wide nodes of one level. Returns the binary roots of the next level's wide nodes.
    fn add_level(
        &mut self,
        tree: &CostedTree<'_>,
        level: &[Subtree],
        roots: &mut Vec<Subtree>,
    ) -> Vec<Subtree> {
        let opened = level.par_iter().with_min_len(TASK_SIZE / 32);
        let opened: Vec<Opened> = opened.map(|&root| tree.open_node(root)).collect();
        let (start, end) = (self.nodes.len(), self.nodes.len() + opened.len());
        let mut next = Vec::new();
        for opened in &opened {
            self.first_blocks.push(roots.len() as u32);
            self.first_children.push((end + next.len()) as u32);
            let mut links = [Link::NONE; LANES];
            for (link, &lane) in links.iter_mut().zip(opened.lanes()) {
                if lane.leaves as usize <= LANES {
                    *link = Link::block(roots.len());
                    roots.push(lane);
                } else {
                    *link = Link::node(end + next.len());
                    next.push(lane);
                }
            }
            let ranges = opened.ranges();
            self.nodes.push(BlockTreeNode { links, ranges });
        }
        self.levels.push(start..end);
        next
    }
}

/// Creates a block. `order` maps leaves to triangles, and `triangles` has their vertex indices.
fn of_leaves(leaves: &Opened, order: &[u32], triangles: &[[u32; 3]]) -> Block {
    let mut block = Block {
        ranges: leaves.ranges(),
        count: leaves.count as u8,
        ..Block::EMPTY
    };
    for (lane, leaf) in leaves.lanes().iter().enumerate() {
        let triangle = order[leaf.first_leaf as usize];
        block.triangles[lane] = triangle;
        let vertices = triangles[triangle as usize];
        for (corner, vertex) in block.vertices.iter_mut().zip(vertices) {
            corner[lane] = vertex;
        }
    }
    block
}

/// Neighbouring binary subtrees that become the lanes of one wide node or block.
#[derive(Clone, Copy, Debug, Default)]
struct Opened {
    lanes: [Subtree; LANES],
    count: usize,
    /// First and end lane of each binary node that was replaced by its children. Their number is `count - 1`.
    ranges: [[u8; 2]; LANES - 1],
}

impl Opened {
    fn of(root: Subtree) -> Self {
        let mut opened = Self::default();
        opened.lanes[0] = root;
        opened.count = 1;
        opened
    }

    /// Replaces the inner node in `lane` by its children.
    fn open(&mut self, lane: usize, [left, right]: [Subtree; 2]) {
        self.lanes.copy_within(lane + 1..self.count, lane + 2);
        self.lanes[lane] = left;
        self.lanes[lane + 1] = right;
        let lane = lane as u8;
        for [first, end] in &mut self.ranges[..self.count - 1] {
            *first += u8::from(*first > lane);
            *end += u8::from(*end > lane);
        }
        self.ranges[self.count - 1] = [lane, lane + 2];
        self.count += 1;
    }

    fn ranges(&self) -> Ranges {
        let mut ranges = Ranges::NONE;
        for &[first, end] in &self.ranges[..self.count - 1] {
            ranges.push(first, end);
        }
        ranges
    }

    fn lanes(&self) -> &[Subtree] {
        &self.lanes[..self.count]
    }
}

impl CostedTree<'_> {
    /// Returns the subtrees of one wide node.
    fn open_node(&self, root: Subtree) -> Opened {
        let mut opened = Opened::of(root);
        if root.leaves as usize > LANES {
            self.open(&mut opened, 0, LANES);
        }
        opened
    }

    /// Replaces the subtree in `lane` by the cheapest set of at most `lanes` subtrees.
    fn open(&self, opened: &mut Opened, lane: usize, lanes: usize) {
        let children = self.children_in_lane_order(opened.lanes[lane]);
        let [a, b] = children.map(|child| self.costs(child));
        let cost = |share: usize| a[share - 1] + b[lanes - share - 1];
        let cheaper = |x, y| if cost(y) < cost(x) { y } else { x };
        let share = (2..lanes).fold(1, cheaper);
        opened.open(lane, children);
        // The child in the later lane first: opening it does not move the other child.
        for (lane, costs, share) in [(lane + 1, b, lanes - share), (lane, a, share)] {
            // Uses the fewest lanes that reach the least cost. If one lane suffices, the subtree is not opened.
            let enough = costs[..share]
                .iter()
                .position(|&cost| cost <= costs[share - 1]);
            if let Some(less @ 1..) = enough {
                self.open(opened, lane, less + 1);
            }
        }
    }

    /// Returns the leaves of one block.
    fn open_block(&self, root: Subtree) -> Opened {
        let mut opened = Opened::of(root);
        let mut lane = 0;
        while lane < opened.count {
            if opened.lanes[lane].leaves == 1 {
                lane += 1;
            } else {
                opened.open(lane, self.tree.children(opened.lanes[lane]));
            }
        }
        opened
    }
}
