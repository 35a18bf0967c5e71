//! Properties of the tree of any triangle soup: a permutation of the active triangles, consistent counts, bounded
//! depth, and the same bits for every number of threads and every earlier use of the workspace.

use bvh_build::{BinaryTree, Cancel, MAX_DEPTH, SahBuilder, Subtree, sah_cost};
use fastrand::Rng;
use geom::Aabb;
use proptest::prelude::*;

/// Builds a tree and checks the properties of every tree. Returns its depth.
fn check(boxes: &[Aabb]) -> u32 {
    let active = (0..boxes.len() as u32).filter(|&i| is_usable(&boxes[i as usize]));
    check_holds(active.collect(), &BinaryTree::over(boxes))
}

fn is_usable(b: &Aabb) -> bool {
    let finite = b.min.iter().chain(&b.max).all(|x| x.is_finite());
    finite && !b.is_empty()
}

/// Checks that the tree contains each of `active` once, is consistent and not too deep. Returns the maximum leaf depth.
fn check_holds(active: Vec<u32>, tree: &BinaryTree) -> u32 {
    let mut order = tree.order().to_vec();
    order.sort_unstable();
    assert_eq!(order, active);
    assert_eq!(tree.left_leaves().len(), active.len().saturating_sub(1));
    let mut deepest = 0;
    let mut stack: Vec<(Subtree, u32)> = tree.root().map(|root| (root, 0)).into_iter().collect();
    let mut visited = 0;
    while let Some((node, depth)) = stack.pop() {
        visited += 1;
        deepest = deepest.max(depth);
        if node.leaves > 1 {
            let [a, b] = tree.children(node);
            let holds = a.leaves > 0 && b.leaves > 0 && a.leaves < node.leaves;
            assert!(holds, "{node:?}");
            stack.extend([(a, depth + 1), (b, depth + 1)]);
        }
    }
    assert_eq!(visited, (2 * tree.leaf_count()).saturating_sub(1));
    assert!(deepest <= MAX_DEPTH);
    assert_eq!(tree.depth(0), deepest);
    assert_eq!(tree.depth(deepest / 2), deepest);
    assert_eq!(tree.depth(deepest + 1), deepest + 1);
    deepest
}

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

/// Returns one box of a kind that is difficult for builders.
fn troublesome(kind: u8, scale: f32, random: &mut Rng) -> Aabb {
    let [at, size] = [1.0, 0.01].map(|most| [0; 3].map(|_| random.f32() * most));
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
        5 => b = cube([2.0_f32.powf(-40.0 * random.f32()), 0.0, 0.0], 0.0),
        6 => b.min[0] = f32::NAN,
        7 => b.max[1] = f32::INFINITY,
        8 => (b.min[2], b.max[2]) = (b.max[2] + 0.01, b.min[2]),
        9 => b = Aabb::EMPTY,
        _ => b = cube(at.map(|x| x - 0.5), 0.5 * random.f32()),
    }
    scaled(&b, |x| x * scale)
}

/// Returns `n` boxes that cycle through `kinds`.
fn boxes(n: usize, kinds: &[u8], random: &mut Rng) -> Vec<Aabb> {
    let kinds = kinds.iter().cycle().take(n);
    kinds.map(|&kind| troublesome(kind, 1.0, random)).collect()
}

fn soup() -> impl Strategy<Value = Vec<Aabb>> {
    let scale = prop_oneof![Just(1.0), Just(1e38), Just(1e-40), Just(1e-44), Just(1e12)];
    let kinds = prop::collection::vec(0_u8..11, 1..4);
    let size = prop_oneof![0_usize..6, 6_usize..80, 80_usize..600, Just(20_000)];
    (kinds, scale, size, any::<u64>()).prop_map(|(kinds, scale, size, seed)| {
        let [mut random, mut pick] = [seed, !seed].map(Rng::with_seed);
        let mut one = |_| troublesome(*pick.choice(&kinds).unwrap(), scale, &mut random);
        (0..size).map(&mut one).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn trees_are_complete_and_independent_of_earlier_builds(first in soup(), second in soup()) {
        check(&second);
        let (mut builder, mut reused) = (SahBuilder::default(), BinaryTree::default());
        for boxes in [&first, &second] {
            builder.build(&boxes[..], &Cancel::new(), &mut reused).unwrap();
        }
        prop_assert_eq!(reused, BinaryTree::over(&second[..]));
    }
}

/// Configures few cases, since any large soup reveals a threading error. With `ABVH_FULL=1`, configures more.
fn soups_by_threads() -> ProptestConfig {
    let full = std::env::var("ABVH_FULL").is_ok_and(|v| v == "1");
    ProptestConfig::with_cases(if full { 12 } else { 3 })
}

proptest! {
    #![proptest_config(soups_by_threads())]

    #[test]
    fn build_is_deterministic_across_thread_counts(small in soup(), seed: u64) {
        let (kinds, mut random) = ([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10], Rng::with_seed(seed));
        let large = boxes(70_000, &kinds, &mut random);
        let with = |boxes: &[Aabb], threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let tree = BinaryTree::over(boxes);
                let cost = sah_cost(&tree, boxes).to_bits();
                (tree, cost)
            })
        };
        for boxes in [small, large] {
            let one = with(&boxes, 1);
            prop_assert!([2, 3].into_iter().all(|threads| with(&boxes, threads) == one));
        }
    }
}

#[test]
fn builds_on_a_small_stack() {
    let boxes = boxes(300_000, &[0], &mut Rng::with_seed(3));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .stack_size(256 << 10);
    pool.build().unwrap().install(|| check(&boxes));
}

#[test]
fn identical_triangles_make_a_balanced_tree() {
    assert_eq!(check(&vec![cube([1.0; 3], 2.0); 1 << 17]), 17);
}

#[test]
fn skewed_scenes_respect_maximum_depth() {
    let series = |ratio: f32| -> Vec<Aabb> {
        let mut x = 1e30;
        let next = |_| {
            x = (x * ratio).max(f32::from_bits(1));
            cube([x, 0.0, 0.0], x)
        };
        (0..30_000).map(next).collect()
    };
    for ratio in [0.5, 0.9, 0.99] {
        check(&series(ratio));
    }
    let nested = |i: u16| cube([-f32::from(i); 3], 2.0 * f32::from(i));
    check(&(0..5_000).map(nested).collect::<Vec<_>>());
    // Boxes too small to distinguish share a scene with a large box.
    let speck = |i: u32| cube([f32::from_bits(i), 0.0, 0.0], 0.0);
    let large = cube([0.5; 3], 0.5);
    check(&(0..1_000).map(speck).chain([large]).collect::<Vec<_>>());
}

#[test]
fn depth_is_capped_at_maximum() {
    // On each axis, every point is 64 times as far out as the next, so that each plane separates one point. 58 levels
    // separate 58 of the 110 points. To separate the other 52 one by one would exceed `MAX_DEPTH`. So that node is
    // halved, and `small.rs` builds both halves.
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
    assert_eq!(check(&boxes), MAX_DEPTH);
}

#[test]
fn tree_is_independent_of_scale() {
    // Multiples of 2^-16 within -2..2 keep all their bits at every scale in this test.
    let round = |x: f32| ((x - 0.75) * 98_304.0).round() / 65_536.0;
    let boxes = boxes(3_000, &[0, 3, 4, 10], &mut Rng::with_seed(7));
    let boxes: Vec<_> = boxes.iter().map(|b| scaled(b, round)).collect();
    let tree = BinaryTree::over(&boxes[..]);
    for k in [-133, -100, -40, 40, 100, 127] {
        let (a, b) = (2.0_f32.powi(k / 2), 2.0_f32.powi(k - k / 2));
        let scaled: Vec<_> = boxes.iter().map(|c| scaled(c, |x| x * a * b)).collect();
        assert_eq!(BinaryTree::over(&scaled[..]), tree, "2^{k}");
    }
}
