//! The same of trees for several moments, and that they are good at all of them.

use crate::{check_holds, cube, depth_of, is_usable, noise, soup, troublesome};
use bvh_build::{
    BinaryTree, BuildError, Builder, Cancel, MAX_DEPTH, MAX_MOMENTS, Moment, TemporalBuilder,
    sah_cost, temporal_cost,
};
use geom::{Aabb, Animation};
use proptest::prelude::*;

/// Boxes of one moment.
struct Frozen<'a>(&'a [Aabb]);

impl bvh_build::Boxes for Frozen<'_> {
    fn len(&self) -> usize {
        self.0.len()
    }
    fn get(&self, triangle: u32) -> Aabb {
        self.0[triangle as usize]
    }
}

fn moments(all: &[Vec<Aabb>]) -> Vec<Moment<Frozen<'_>>> {
    let moment = |(boxes, weight): (_, f64)| Moment { boxes, weight };
    let weights = (1..).map(f64::from);
    (all.iter().map(|b| Frozen(b)).zip(weights).map(moment)).collect()
}

fn build(all: &[Vec<Aabb>]) -> BinaryTree {
    let mut tree = BinaryTree::default();
    TemporalBuilder::new()
        .build(&moments(all), &Cancel::new(), &mut tree)
        .unwrap();
    tree
}

fn build_at(boxes: &[Aabb]) -> BinaryTree {
    let mut tree = BinaryTree::default();
    Builder::new()
        .build(boxes, &Cancel::new(), &mut tree)
        .unwrap();
    tree
}

fn check(all: &[Vec<Aabb>], tree: &BinaryTree) {
    let usable = |i: &u32| all.iter().any(|boxes| is_usable(&boxes[*i as usize]));
    let active = (0..all[0].len() as u32).filter(usable).collect();
    check_holds(active, tree);
}

/// Soups of one size at several moments.
fn moving_soup() -> impl Strategy<Value = Vec<Vec<Aabb>>> {
    prop::collection::vec(soup(), 1..=MAX_MOMENTS).prop_map(|mut soups| {
        let n = soups.iter().map(Vec::len).min().unwrap_or(0);
        soups.iter_mut().for_each(|s| s.truncate(n));
        soups
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn a_tree_holds_each_triangle_active_at_some_moment_once_and_is_not_deep(all in moving_soup()) {
        check(&all, &build(&all));
    }

    #[test]
    fn the_workspace_leaves_no_trace_in_the_tree(first in moving_soup(), second in moving_soup()) {
        let mut builder = TemporalBuilder::new();
        let mut tree = BinaryTree::default();
        builder.build(&moments(&first), &Cancel::new(), &mut tree).unwrap();
        builder.build(&moments(&second), &Cancel::new(), &mut tree).unwrap();
        prop_assert_eq!(tree, build(&second));
    }
}

#[test]
fn the_tree_is_the_same_for_every_number_of_threads() {
    let mut next = noise(11);
    let mut frame = || {
        (0..40_000)
            .map(|i| troublesome((i % 11) as u8, 1.0, &mut next))
            .collect::<Vec<_>>()
    };
    let all = [frame(), frame(), frame()];
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| build(&all))
    };
    let one = with(1);
    check(&all, &one);
    assert!([2, 3].into_iter().all(|threads| with(threads) == one));
}

#[test]
fn many_identical_triangles_make_a_balanced_tree() {
    let tree = build(&vec![vec![cube([1.0; 3], 2.0); 1 << 17]; 2]);
    assert_eq!(depth_of(&tree), 17);
}

#[test]
fn positions_in_a_geometric_series_stay_within_the_depth_bound() {
    let series = |ratio: f32| -> Vec<Aabb> {
        let mut x = 1e30;
        let next = |_| {
            x = (x * ratio).max(f32::from_bits(1));
            cube([x, 0.0, 0.0], x)
        };
        (0..20_000).map(next).collect()
    };
    let all = [0.5, 0.9, 0.99].map(series);
    let tree = build(&all);
    check(&all, &tree);
    assert!(depth_of(&tree) <= MAX_DEPTH);
}

/// Boxes in a row, each at the place that `place` gives it.
fn row(n: u32, place: impl Fn(u32) -> u32) -> Vec<Aabb> {
    (0..n)
        .map(|i| cube([place(i) as f32, 0.0, 0.0], 0.9))
        .collect()
}

/// Pairs keep together; what lies next to a pair changes from moment to moment.
#[test]
fn what_keeps_together_at_all_moments_is_put_together() {
    let shuffled = |factor: u32| row(512, move |i| 2 * (i / 2 * factor % 256) + i % 2);
    let all = [shuffled(1), shuffled(37), shuffled(91)];
    let tree = build(&all);
    let pairs = tree.order().windows(2).filter(|p| p[0] / 2 == p[1] / 2);
    // Bins may cut a pair or two.
    assert!(pairs.count() > 250);
}

#[test]
fn a_tree_for_all_moments_costs_less_over_them_than_one_for_any() {
    // A plane of boxes whose rows slide apart, more and more.
    let slide = |far: f32| -> Vec<Aabb> {
        let at = |i: u32| {
            [
                (i % 40) as f32 + far * (i / 40) as f32,
                (i / 40) as f32,
                0.0,
            ]
        };
        (0..1600).map(|i| cube(at(i), 0.9)).collect()
    };
    let all = [0.0, 2.0, 5.0].map(slide);
    let cost = |tree: &BinaryTree| temporal_cost(tree, &moments(&all));
    let for_all = cost(&build(&all));
    for boxes in &all {
        let for_one = cost(&build_at(boxes));
        assert!(for_all < 0.97 * for_one, "{for_all} {for_one}");
    }
}

#[test]
fn at_one_moment_the_tree_is_nearly_as_good_as_that_moments_own() {
    let mut next = noise(5);
    let boxes: Vec<_> = (0..5000).map(|_| troublesome(0, 1.0, &mut next)).collect();
    let [for_all, own] =
        [build(std::slice::from_ref(&boxes)), build_at(&boxes)].map(|t| sah_cost(&t, &boxes[..]));
    assert!(for_all < 1.03 * own, "{for_all} {own}");
}

#[test]
fn the_cost_over_moments_is_the_mean_by_weight() {
    let all = [row(9, |i| i), row(9, |i| i * i)];
    let tree = build(&all);
    let [a, b] = [0, 1].map(|k| sah_cost(&tree, &all[k][..]));
    let mean = temporal_cost(&tree, &moments(&all));
    assert!((mean - (a + 2.0 * b) / 3.0).abs() < 1e-12 && a != b);
    let none = moments(&all)
        .into_iter()
        .map(|m| Moment { weight: 0.0, ..m });
    assert_eq!(temporal_cost(&tree, &none.collect::<Vec<_>>()), 0.0);
}

#[test]
fn a_triangle_without_a_box_at_some_moments_has_a_leaf() {
    let mut all = [row(5, |i| i), row(5, |i| i)];
    (all[0][1], all[1][2]) = (Aabb::EMPTY, Aabb::EMPTY);
    (all[0][4], all[1][4]) = (Aabb::EMPTY, Aabb::EMPTY);
    check_holds(vec![0, 1, 2, 3], &build(&all));
}

#[test]
fn a_cancelled_build_leaves_an_empty_tree() {
    let mut tree = build(&[row(9, |i| i)]);
    let cancel = Cancel::new();
    cancel.cancel();
    let all = [row(9, |i| i)];
    let built = TemporalBuilder::new().build(&moments(&all), &cancel, &mut tree);
    assert_eq!((built, tree.root()), (Err(BuildError::Cancelled), None));
    assert!(tree.left_leaves().is_empty());
}

#[test]
fn an_animation_at_a_pose_gives_the_boxes_of_its_vertices() {
    let key = |x: f32| vec![[x, 0.0, 0.0], [1.0, x, 0.0], [0.0, 1.0, x]];
    let animation = Animation::new(vec![key(0.0), key(3.0)], vec![[0, 1, 2]]).unwrap();
    let pose = animation.pose(0.25);
    let positions: Vec<_> = (0..3).map(|v| animation.vertex(pose, v)).collect();
    let boxes: [Box<dyn bvh_build::Boxes>; 2] = [
        Box::new((&animation, pose)),
        Box::new((&animation, &positions[..])),
    ];
    let [blended, given] = boxes.map(|b| (b.len(), b.get(0)));
    assert_eq!(blended, given);
    assert_eq!(given.1.max, [1.0, 1.0, 0.75]);
}
