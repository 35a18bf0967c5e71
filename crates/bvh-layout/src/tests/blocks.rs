//! The wide tree read back, lane by lane.

use super::{random_tree, record, scene, shapes};
use crate::{Block, BlockTree, First, LANES, Link};
use bvh_build::BinaryTree;

/// Every triangle's own corners, so that vertices tell whose they are.
fn triangles(n: usize) -> Vec<[u32; 3]> {
    (0..n as u32)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect()
}

/// Triangles below a node, depth first, in the order of lanes.
fn below(tree: &BlockTree, node: usize, depth: usize, seen: &mut [u32], out: &mut Vec<u32>) {
    assert!(
        tree.levels[depth].contains(&node),
        "node {node} at depth {depth}"
    );
    seen[node] += 1;
    let links = tree.nodes[node].links;
    let children = links.iter().filter(|&&link| link != Link::ROOT).count();
    let (links, empty) = links.split_at(children);
    assert!(empty.iter().all(|&link| link == Link::ROOT));
    assert_eq!(tree.nodes[node].ranges.count(), children.saturating_sub(1));
    // Blocks lie in the order of nodes and lanes, and so do children.
    let (blocks, nodes): (Vec<Link>, Vec<Link>) = links.iter().partition(|link| link.is_block());
    for (links, firsts) in [(blocks, &tree.first_blocks), (nodes, &tree.first_children)] {
        let places = firsts[node] as usize..firsts[node + 1] as usize;
        assert!(links.into_iter().map(Link::index).eq(places), "node {node}");
    }
    // The left subtree is asked first, so it is in the last lane.
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

fn check(binary: &BinaryTree) {
    let topology = &record(binary);
    let triangles = triangles(topology.triangle_count());
    let tree = BlockTree::of(topology, &triangles, (&[], First::Left));
    let mut found = Vec::new();
    let mut seen = vec![0; tree.nodes.len()];
    if topology.leaf_count() > 0 {
        below(&tree, 0, 0, &mut seen, &mut found);
        assert!(seen.iter().all(|&n| n == 1), "every node has one parent");
    }
    assert_eq!(found, binary.order());
    // Every block belongs to a node, so all binary nodes have their ranges: as many as children or triangles, less one.
    let ends = (tree.first_blocks[0], *tree.first_blocks.last().unwrap());
    assert_eq!(ends, (0, tree.blocks.len() as u32));
}

#[test]
fn each_triangle_and_each_inner_node_has_one_place() {
    for tree in shapes().iter().chain(&[random_tree(20_000, 5)]) {
        check(tree);
    }
}

#[test]
fn full_subtrees_make_full_nodes() {
    let tree = random_tree(20_000, 5);
    let corners = triangles(scene(&tree));
    let wide = BlockTree::of(&record(&tree), &corners, (&[], First::Left));
    let upper = &wide.nodes[wide.levels[1].clone()];
    assert!(upper.iter().all(|node| !node.links.contains(&Link::ROOT)));
    assert!(wide.blocks.len() * 4 < 20_000);
}

/// Equal boxes, but for that of one large triangle.
fn boxes(n: usize, large: u32) -> Vec<geom::Aabb> {
    let bounds = |t| geom::Aabb {
        min: [0.0; 3],
        max: [if t == large { 100.0 } else { 1.0 }; 3],
    };
    (0..n as u32).map(bounds).collect()
}

#[test]
fn the_subtree_of_the_largest_area_is_opened_first() {
    // All subtrees are alike but those above one large triangle.
    let tree = random_tree(20_000, 5);
    let record = record(&tree);
    let corners = triangles(scene(&tree));
    let large = record.leaf_triangles()[7];
    let boxes = boxes(scene(&tree), large);
    let depth = |wide: &BlockTree| {
        let is_there = |block: &Block| block.triangles.contains(&large);
        let block = wide.blocks.iter().position(is_there).unwrap() as u32;
        let node = wide.first_blocks.partition_point(|&first| first <= block) - 1;
        let mut levels = wide.levels.iter();
        levels.position(|level| level.contains(&node)).unwrap()
    };
    let [by_size, by_area] =
        [&[][..], &boxes].map(|b| BlockTree::of(&record, &corners, (b, First::Larger)));
    assert!(depth(&by_area) < depth(&by_size));
}

/// The block that a search comes to that asks the last lane of each node first.
fn asked_first(wide: &BlockTree) -> &Block {
    let mut link = Link::ROOT;
    while !link.is_block() {
        let links = &wide.nodes[link.index()].links;
        link = *links.iter().rfind(|&&l| l != Link::ROOT).unwrap();
    }
    &wide.blocks[link.index()]
}

#[test]
fn of_two_subtrees_the_larger_is_asked_first_or_the_left_one() {
    let tree = random_tree(20_000, 5);
    let record = record(&tree);
    let order = tree.order();
    for large in [order[0], order[9_000], order[19_999]] {
        let boxes = boxes(scene(&tree), large);
        let corners = triangles(scene(&tree));
        for (first, found) in [(First::Larger, large), (First::Left, order[0])] {
            let wide = BlockTree::of(&record, &corners, (&boxes, first));
            let asked = asked_first(&wide).triangles;
            assert!(asked.contains(&found), "{large} {first:?}");
        }
    }
}
