//! Tests of the eight-wide form, read back lane by lane.

use super::{random_tree, scene_triangle_count};
use crate::{Block, BlockTree, CollapseOptions, FirstVisited, LANES, Link};
use bvh_build::{BinaryTree, Subtree};
use geom::Aabb;

/// Collapses a tree over triangles without common vertices, so that a vertex identifies its triangle.
fn collapsed(tree: &BinaryTree, boxes: &[Aabb], first_visited: FirstVisited) -> BlockTree {
    let triangles = (0..scene_triangle_count(tree) as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    let options = CollapseOptions {
        boxes,
        first_visited,
    };
    BlockTree::of(tree, &triangles.collect::<Vec<_>>(), options)
}

/// Appends the triangles below a node to `out`, depth first. Visits the children from the last lane to the first.
fn below(tree: &BlockTree, node: usize, depth: usize, seen: &mut [u32], out: &mut Vec<u32>) {
    assert!(
        tree.levels[depth].contains(&node),
        "node {node} at depth {depth}"
    );
    seen[node] += 1;
    let links = tree.nodes[node].links;
    let children = links.iter().filter(|&&link| link != Link::NONE).count();
    let (links, empty) = links.split_at(children);
    assert!(empty.iter().all(|&link| link == Link::NONE));
    assert_eq!(tree.nodes[node].ranges.count(), children.saturating_sub(1));
    // Blocks and inner children are in the order of nodes and lanes.
    let (blocks, nodes): (Vec<Link>, Vec<Link>) = links.iter().partition(|link| link.is_block());
    for (links, firsts) in [(blocks, &tree.first_blocks), (nodes, &tree.first_children)] {
        let places = firsts[node] as usize..firsts[node + 1] as usize;
        assert!(links.into_iter().map(Link::index).eq(places), "node {node}");
    }
    // The left subtree is visited first, so it is in the last lane.
    for link in links.iter().rev() {
        if link.is_block() {
            triangles_of(&tree.blocks[link.index()], out);
        } else {
            below(tree, link.index(), depth + 1, seen, out);
        }
    }
}

fn triangles_of(block: &Block, out: &mut Vec<u32>) {
    let count = usize::from(block.count);
    assert!((1..=LANES).contains(&count) && block.ranges.count() == count - 1);
    let (own, empty) = block.triangles.split_at(count);
    assert!(empty.iter().all(|&t| t == u32::MAX));
    for (lane, &t) in own.iter().enumerate() {
        let vertices = block.vertices.map(|corner| corner[lane]);
        assert_eq!(vertices, [3 * t, 3 * t + 1, 3 * t + 2]);
    }
    out.extend(own);
}

pub(super) fn check(binary: &BinaryTree) {
    let tree = collapsed(binary, &[], FirstVisited::Left);
    let mut found = Vec::new();
    let mut seen = vec![0; tree.nodes.len()];
    if binary.leaf_count() > 0 {
        below(&tree, 0, 0, &mut seen, &mut found);
        assert!(seen.iter().all(|&n| n == 1), "every node has one parent");
    }
    assert_eq!(found, binary.order());
    // Every block belongs to a node.
    let ends = (tree.first_blocks[0], *tree.first_blocks.last().unwrap());
    assert_eq!(ends, (0, tree.blocks.len() as u32));
    // `below` and `triangles_of` check that each node and each block has one range less than used lanes. So there are
    // as many ranges as inner nodes of the binary tree.
}

#[test]
fn large_trees_fill_nodes_and_blocks() {
    let wide = collapsed(&random_tree(20_000, 5), &[], FirstVisited::Left);
    let upper = &wide.nodes[wide.levels[1].clone()];
    assert!(upper.iter().all(|node| !node.links.contains(&Link::NONE)));
    assert!(wide.blocks.len() * 4 < 20_000);
}

/// Returns equal boxes, except for one large triangle.
fn boxes(n: usize, large: u32) -> Vec<Aabb> {
    let bounds = |t| Aabb {
        min: [0.0; 3],
        max: [if t == large { 100.0 } else { 1.0 }; 3],
    };
    (0..n as u32).map(bounds).collect()
}

#[test]
fn known_areas_move_large_triangles_up() {
    // Only the nodes above one large triangle differ in area.
    let tree = random_tree(20_000, 5);
    let large = tree.order()[7];
    let boxes = boxes(scene_triangle_count(&tree), large);
    let depth = |wide: &BlockTree| {
        let is_there = |block: &Block| block.triangles.contains(&large);
        let block = wide.blocks.iter().position(is_there).unwrap() as u32;
        let node = wide.first_blocks.partition_point(|&first| first <= block) - 1;
        let mut levels = wide.levels.iter();
        levels.position(|level| level.contains(&node)).unwrap()
    };
    let [by_size, by_area] =
        [&[][..], &boxes].map(|boxes| depth(&collapsed(&tree, boxes, FirstVisited::Larger)));
    assert!(by_area < by_size);
}

/// Returns the block that an any-hit traversal visits first.
fn first_visited_block(wide: &BlockTree) -> &Block {
    let mut link = Link::ROOT;
    while !link.is_block() {
        let links = &wide.nodes[link.index()].links;
        link = *links.iter().rfind(|&&l| l != Link::NONE).unwrap();
    }
    &wide.blocks[link.index()]
}

#[test]
fn visits_larger_or_left_subtree_first() {
    let tree = random_tree(20_000, 5);
    let order = tree.order();
    for large in [order[0], order[9_000], order[19_999]] {
        let boxes = boxes(scene_triangle_count(&tree), large);
        for (first_visited, found) in [
            (FirstVisited::Larger, large),
            (FirstVisited::Left, order[0]),
        ] {
            let wide = collapsed(&tree, &boxes, first_visited);
            let visited = first_visited_block(&wide).triangles;
            assert!(visited.contains(&found), "{large} {first_visited:?}");
        }
    }
}

/// Returns the box of the subtree at a link, and the total area of its nodes and blocks.
fn areas_below(wide: &BlockTree, link: Link, boxes: &[Aabb]) -> (Aabb, f64) {
    let (mut bounds, mut sum) = (Aabb::EMPTY, 0.0);
    if link.is_block() {
        let block = &wide.blocks[link.index()];
        for &t in &block.triangles[..usize::from(block.count)] {
            bounds = bounds.union(boxes[t as usize]);
        }
    } else {
        let links = wide.nodes[link.index()].links;
        for child in links.into_iter().filter(|&child| child != Link::NONE) {
            let (below, areas) = areas_below(wide, child, boxes);
            bounds = bounds.union(below);
            sum += areas;
        }
    }
    (bounds, sum + bounds.half_area())
}

/// A binary tree with a box for each triangle, small enough to enumerate all its wide forms.
struct AllForms<'a> {
    tree: &'a BinaryTree,
    boxes: &'a [Aabb],
}

impl AllForms<'_> {
    /// Returns the least total area of the wide nodes and blocks of a subtree.
    fn least(&self, node: Subtree) -> f64 {
        let leaves = node.leaves as usize;
        let triangles = &self.tree.order()[node.first_leaf as usize..][..leaves];
        let boxes = triangles.iter().map(|&t| self.boxes[t as usize]);
        let own = boxes.fold(Aabb::EMPTY, Aabb::union).half_area();
        if leaves <= LANES {
            return own;
        }
        let of_cut = |cut: Vec<Subtree>| cut.into_iter().map(|part| self.least(part)).sum();
        let opened = self.cuts(node).into_iter().skip(1).map(of_cut);
        own + opened.fold(f64::MAX, f64::min)
    }

    /// Returns all partitions of a subtree into at most eight subtrees. They divide no subtree that fits a block. The first
    /// partition is the whole subtree.
    fn cuts(&self, node: Subtree) -> Vec<Vec<Subtree>> {
        let mut all = vec![vec![node]];
        if node.leaves as usize > LANES {
            let [left, right] = self.tree.children(node).map(|child| self.cuts(child));
            for left in left {
                let joined = right.iter().map(|right| [&left[..], right].concat());
                all.extend(joined.filter(|cut| cut.len() <= LANES));
            }
        }
        all
    }
}

#[test]
fn wide_nodes_have_minimal_area() {
    for n in [9, 40, 100, 120] {
        let tree = random_tree(n, n as u64);
        let bounds = |t: usize| {
            let min = [7, 31, 57].map(|step| (t * step % 101) as f32);
            let max = [0, 1, 2].map(|axis| min[axis] + (t * (axis + 3) % 11).pow(2) as f32);
            Aabb { min, max }
        };
        let boxes: Vec<_> = (0..scene_triangle_count(&tree)).map(bounds).collect();
        let wide = collapsed(&tree, &boxes, FirstVisited::Left);
        let (_, found) = areas_below(&wide, Link::ROOT, &boxes);
        let all = AllForms {
            tree: &tree,
            boxes: &boxes,
        };
        let least = all.least(tree.root().unwrap());
        assert!((found / least - 1.0).abs() < 1e-5, "{n}: {found} {least}");
    }
}
