//! Trees over a row of triangles that changes its order.

use super::*;
use crate::sampling::samples;

/// Triangles in a row: in order, and with every seventh beside the first.
fn shuffled() -> Animation {
    let row = |place: fn(u32) -> u32| -> Vec<Point> {
        let corner = |x: f32| [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.5]];
        (0..64).flat_map(|i| corner(place(i) as f32)).collect()
    };
    let triangles = (0..64).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let keys = vec![row(|i| i), row(|i| i * 37 % 64), row(|i| i)];
    Animation::new(keys, triangles).unwrap()
}

fn tree(made: Made) -> Option<Built> {
    match made {
        Made::Tree(built) => Some(built),
        Made::NoBetter => None,
    }
}

#[test]
fn only_a_tree_that_is_cheaper_where_it_will_be_used_is_handed_over() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let mut bench = Workbench::new();
    bench.build(&a, &a.keys()[0], &cancel).unwrap();
    let other = || Vertices::KeyFrames(a.pose(1.0));
    let mut made_for = |rival_at: Option<f64>| {
        let at = rival_at.map(|t| a.pose(t));
        tree(
            bench
                .build_better(&a, (other(), None), at, &cancel)
                .unwrap(),
        )
    };
    assert!(made_for(Some(0.0)).is_none() && made_for(Some(2.0)).is_none());
    // What was not handed over is no rival: this one still meets the first.
    assert!(made_for(Some(1.0)).is_some());
    // Its equal is taken, even where another would be better.
    assert!(made_for(Some(0.0)).is_some());
    assert!(made_for(None).is_some());
}

#[test]
fn where_trees_fade_the_next_is_built_for_both_halves_of_its_use() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let mut bench = Workbench::new();
    bench.build(&a, &a.keys()[0], &cancel).unwrap();
    let mut next = |time: f64| {
        let from = Vertices::KeyFrames(a.pose(time));
        let halves = [time - 0.375, time].map(|t| a.pose(t));
        let made = bench.build_better(&a, (from, Some(halves)), Some(a.pose(time)), &cancel);
        tree(made.unwrap()).unwrap()
    };
    let own = |time: f64| {
        let built = Workbench::new().build(&a, &positions(&a, time), &cancel);
        built.unwrap()
    };
    let swept = built_over(&a, [1.625, 2.0].map(|t| a.pose(t)));
    assert_ne!(own(2.0).topology.words(), swept.words());
    // At 1 the first frame's tree has faded, at 2 its successor, then none any more.
    let trees = [1.0, 2.0, 2.0, 2.0].map(&mut next);
    let expected = [&own(1.0).topology, &swept, &swept, &own(2.0).topology];
    for (found, expected) in trees.iter().zip(expected) {
        assert_eq!(found.topology.words(), expected.words());
    }
    // What a tree costs is said of the middle, whatever it was built for.
    assert!(trees[1].cost > trees[3].cost && trees[3].cost == own(2.0).cost);
}

#[test]
fn a_tree_that_nobody_weighs_does_not_count_as_faded() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let mut bench = Workbench::new();
    bench.build(&a, &a.keys()[0], &cancel).unwrap();
    let halves = [0.625, 1.0].map(|t| a.pose(t));
    for _ in 0..3 {
        let from = Vertices::KeyFrames(a.pose(1.0));
        let made = bench.build_better(&a, (from, Some(halves)), None, &cancel);
        let own = Workbench::new().build(&a, &a.keys()[1], &cancel).unwrap();
        let found = tree(made.unwrap()).unwrap();
        assert_eq!(found.topology.words(), own.topology.words());
    }
}

fn positions(a: &Animation, time: f64) -> Vec<Point> {
    let pose = a.pose(time);
    let vertices = 0..a.vertex_count() as u32;
    vertices.map(|v| a.vertex(pose, v)).collect()
}

/// The record of a tree over each triangle's boxes at both poses.
fn built_over(a: &Animation, halves: [Pose; 2]) -> Topology {
    let both = |t| {
        let [b, c] = halves.map(|pose| a.build_box_at(pose, t));
        b.union(c)
    };
    let boxes: Vec<Aabb> = (0..a.triangle_count() as u32).map(both).collect();
    let mut tree = BinaryTree::default();
    let built = Builder::new().build(&boxes[..], &Cancel::new(), &mut tree);
    built.unwrap();
    Converter::default().convert(&tree, boxes.len(), Vec::new())
}

#[test]
fn key_frames_make_the_same_tree_as_the_vertices_read_back() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let pose = a.pose(0.3);
    let positions: Vec<Point> = (0..192).map(|v| a.vertex(pose, v)).collect();
    let read_back = Vertices::ReadBack(Box::new(positions));
    let [x, y] = [Vertices::KeyFrames(pose), read_back].map(|vertices| {
        let made = Workbench::new().build_better(&a, (vertices, None), None, &cancel);
        tree(made.unwrap()).unwrap()
    });
    assert_eq!((x.topology.words(), x.cost), (y.topology.words(), y.cost));
}

#[test]
fn a_tree_for_all_times_is_never_worse_over_them_than_the_first_frames() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let samples = samples(&a, [0.0, 2.0]);
    let mut bench = Workbench::new();
    let first = a.pose(0.0);
    let for_all = bench.build_for_all(&a, &samples, first, &cancel).unwrap();
    let own = bench.build(&a, &a.keys()[0], &cancel).unwrap();
    assert_eq!(for_all.cost, own.cost);
    assert_ne!(for_all.topology.words(), own.topology.words());
    // Where hardly anything but the first frame counts, its own tree is taken.
    let mut rarely = samples;
    rarely[1..].iter_mut().for_each(|s| s.weight *= 1e-9);
    let for_first = bench.build_for_all(&a, &rarely, first, &cancel).unwrap();
    assert_eq!(for_first.topology.words(), own.topology.words());
}

#[test]
fn records_carry_the_forms_that_were_asked_for() {
    let (a, cancel) = (shuffled(), Cancel::new());
    for (treelets, blocks) in [(false, false), (true, false), (false, true)] {
        let mut bench = Workbench::with_forms(Forms { treelets, blocks });
        let tree = bench.build(&a, &a.keys()[0], &cancel).unwrap().topology;
        let carried = (tree.treelets().is_some(), tree.blocks().is_some());
        assert_eq!(carried, (treelets, blocks));
    }
}

#[test]
fn an_old_records_memory_is_used_again() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let mut bench = Workbench::new();
    let words = bench
        .build(&a, &a.keys()[0], &cancel)
        .unwrap()
        .topology
        .into_words();
    let memory = words.as_ptr();
    bench.reuse(words);
    let again = bench.build(&a, &a.keys()[1], &cancel).unwrap().topology;
    assert_eq!(again.words().as_ptr(), memory);
}
