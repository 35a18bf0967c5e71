//! What holds for the tree of any soup: a permutation of the active triangles, consistent counts,
//! bounded depth, and the same bits for every number of threads and every history of the workspace.

mod temporal;

use bvh_build::{BinaryTree, Builder, Cancel, MAX_DEPTH, Subtree, sah_cost};
use geom::Aabb;
use proptest::prelude::*;

fn build(boxes: &[Aabb]) -> BinaryTree {
    let mut tree = BinaryTree::default();
    Builder::new()
        .build(boxes, &Cancel::new(), &mut tree)
        .unwrap();
    tree
}

fn build_with_threads(boxes: &[Aabb], threads: usize) -> BinaryTree {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(|| build(boxes))
}

fn is_usable(b: &Aabb) -> bool {
    let finite = b.min.iter().chain(&b.max).all(|x| x.is_finite());
    finite && !b.is_empty()
}

/// Depth of the deepest leaf; checks that every child holds something.
fn depth_of(tree: &BinaryTree) -> u32 {
    let mut deepest = 0;
    let mut stack: Vec<(Subtree, u32)> = tree.root().map(|root| (root, 0)).into_iter().collect();
    let mut visited = 0;
    while let Some((node, depth)) = stack.pop() {
        visited += 1;
        deepest = deepest.max(depth);
        if node.leaves > 1 {
            let [a, b] = tree.children(node);
            assert!(
                a.leaves > 0 && b.leaves > 0 && a.leaves < node.leaves,
                "{node:?}"
            );
            stack.extend([(a, depth + 1), (b, depth + 1)]);
        }
    }
    assert_eq!(visited, (2 * tree.leaf_count()).saturating_sub(1));
    deepest
}

fn check(boxes: &[Aabb], tree: &BinaryTree) {
    let active = (0..boxes.len() as u32).filter(|&i| is_usable(&boxes[i as usize]));
    check_holds(active.collect(), tree);
}

/// Each of `active` once, in a tree that is consistent and not deep.
fn check_holds(active: Vec<u32>, tree: &BinaryTree) {
    let mut order = tree.order().to_vec();
    order.sort_unstable();
    assert_eq!(order, active);
    assert_eq!(tree.left_leaves().len(), active.len().saturating_sub(1));
    assert!(depth_of(tree) <= MAX_DEPTH);
}

/// Box of edge `edge` at `at`.
fn cube(at: [f32; 3], edge: f32) -> Aabb {
    Aabb {
        min: at,
        max: at.map(|x| x + edge),
    }
}

fn scaled(b: &Aabb, f: impl Fn(f32) -> f32) -> Aabb {
    Aabb {
        min: b.min.map(&f),
        max: b.max.map(&f),
    }
}

/// A cheap sequence of numbers in `0.0..1.0`.
fn noise(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u32 << 24) as f32
    }
}

/// One box of a soup, of one of the kinds that trouble builders.
fn troublesome(kind: u8, scale: f32, next: &mut impl FnMut() -> f32) -> Aabb {
    let at = [next(), next(), next()];
    let size = [next(), next(), next()].map(|x| x * 0.01);
    let mut b = Aabb {
        min: at,
        max: std::array::from_fn(|i| at[i] + size[i]),
    };
    match kind {
        0 => {}
        1 => b = cube([0.25, 0.5, 0.75], 0.125),
        2 => b = cube(at.map(|x| 0.7 + x * 1e-4), 1e-5),
        3 => b.max[1] = b.min[1] + 1.0,
        4 => (b.min[2], b.max[2]) = (0.5, 0.5),
        5 => b = cube([2.0_f32.powf(-40.0 * next()), 0.0, 0.0], 0.0),
        6 => b.min[0] = f32::NAN,
        7 => b.max[1] = f32::INFINITY,
        8 => (b.min[2], b.max[2]) = (b.max[2] + 0.01, b.min[2]),
        9 => b = Aabb::EMPTY,
        _ => b = cube(at.map(|x| x - 0.5), 0.5 * next()),
    }
    scaled(&b, |x| x * scale)
}

fn soup() -> impl Strategy<Value = Vec<Aabb>> {
    let scale = prop_oneof![Just(1.0), Just(1e38), Just(1e-40), Just(1e-44), Just(1e12)];
    let kinds = prop::collection::vec(0_u8..11, 1..4);
    let size = prop_oneof![0_usize..6, 6_usize..80, 80_usize..600, Just(20_000)];
    (kinds, scale, size, any::<u64>()).prop_map(|(kinds, scale, size, seed)| {
        let mut next = noise(seed);
        let mut pick = noise(!seed);
        (0..size)
            .map(|_| {
                let kind = kinds[(pick() * kinds.len() as f32) as usize];
                troublesome(kind, scale, &mut next)
            })
            .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn a_tree_holds_each_active_triangle_once_and_is_not_deep(boxes in soup()) {
        check(&boxes, &build(&boxes));
    }

    #[test]
    fn the_workspace_leaves_no_trace_in_the_tree(first in soup(), second in soup()) {
        let mut builder = Builder::new();
        let mut tree = BinaryTree::default();
        builder.build(&first[..], &Cancel::new(), &mut tree).unwrap();
        builder.build(&second[..], &Cancel::new(), &mut tree).unwrap();
        prop_assert_eq!(tree, build(&second));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn the_tree_and_its_cost_are_the_same_for_every_number_of_threads(boxes in soup(), seed: u64) {
        let mut next = noise(seed);
        let large: Vec<_> = (0..70_000).map(|i| troublesome((i % 11) as u8, 1.0, &mut next)).collect();
        for boxes in [boxes, large] {
            let one = build_with_threads(&boxes, 1);
            for threads in [2, 3] {
                prop_assert_eq!(&one, &build_with_threads(&boxes, threads));
            }
            let [a, b] = [1, 3].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| sah_cost(&one, &boxes[..])).to_bits()
            });
            prop_assert_eq!(a, b);
        }
    }
}

#[test]
fn a_small_stack_suffices() {
    let mut next = noise(3);
    let boxes: Vec<_> = (0..300_000)
        .map(|_| troublesome(0, 1.0, &mut next))
        .collect();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .stack_size(256 << 10);
    let tree = pool.build().unwrap().install(|| build(&boxes));
    check(&boxes, &tree);
}

#[test]
fn a_million_identical_triangles_make_a_balanced_tree() {
    let boxes = vec![cube([1.0; 3], 2.0); 1_000_000];
    let tree = build(&boxes);
    check(&boxes, &tree);
    assert_eq!(depth_of(&tree), 20);
}

#[test]
fn positions_in_a_geometric_series_stay_within_the_depth_bound() {
    for ratio in [0.5_f32, 0.9, 0.99] {
        let mut x = 1e30;
        let boxes: Vec<_> = (0..30_000)
            .map(|_| {
                x = (x * ratio).max(f32::from_bits(1));
                cube([x, 0.0, 0.0], x)
            })
            .collect();
        check(&boxes, &build(&boxes));
    }
}

#[test]
fn nested_boxes_with_one_centre_stay_within_the_depth_bound() {
    let boxes: Vec<_> = (0..5_000)
        .map(|i| cube([-(i as f32); 3], 2.0 * i as f32))
        .collect();
    check(&boxes, &build(&boxes));
}

#[test]
fn a_scene_that_wants_a_deeper_tree_gets_the_deepest_allowed() {
    // On each axis every point lies 64 times as far out as the next, so that each
    // plane takes one away; the last 32 halve instead, for the exact sweep.
    let mut boxes = Vec::new();
    for i in 0..26 {
        let far = 2.0_f32.powi(58 - 6 * i);
        for axis in 0..3 {
            let mut at = [0.0; 3];
            at[axis] = far;
            boxes.push(cube(at, 0.0));
        }
    }
    boxes.extend((0..32).map(|i| cube([2.0_f32.powi(-60 - i); 3], 0.0)));
    let tree = build(&boxes);
    check(&boxes, &tree);
    assert_eq!(depth_of(&tree), MAX_DEPTH);
}

#[test]
fn specks_too_small_to_tell_apart_share_a_scene_with_a_large_box() {
    let speck = |i: u32| cube([f32::from_bits(i), 0.0, 0.0], 0.0);
    let mut boxes: Vec<_> = (0..1_000).map(speck).collect();
    boxes.push(cube([0.5; 3], 0.5));
    check(&boxes, &build(&boxes));
}

#[test]
fn the_scale_of_a_scene_does_not_change_its_tree() {
    // Multiples of 2^-16 within -2..2 keep all their bits at every scale there is.
    let round = |x: f32| ((x - 0.75) * 98_304.0).round() / 65_536.0;
    let mut next = noise(7);
    let boxes: Vec<_> = (0..3_000)
        .map(|i| troublesome([0, 3, 4, 10][i % 4], 1.0, &mut next))
        .map(|b| scaled(&b, round))
        .collect();
    let tree = build(&boxes);
    for k in [-133, -100, -40, 40, 100, 127] {
        let (a, b) = (2.0_f32.powi(k / 2), 2.0_f32.powi(k - k / 2));
        let scaled: Vec<_> = boxes.iter().map(|c| scaled(c, |x| x * a * b)).collect();
        assert_eq!(build(&scaled), tree, "2^{k}");
    }
}
