//! Trees for several moments are good at all of them.

use crate::{boxes, check_holds, cube, moments};
use bvh_build::{BinaryTree, BuildError, Cancel, Moment, TemporalBuilder, sah_cost, temporal_cost};
use geom::Aabb;

fn build(all: &[Vec<Aabb>]) -> BinaryTree {
    let mut tree = BinaryTree::default();
    let built = TemporalBuilder::default().build(&moments(all), &Cancel::new(), &mut tree);
    built.map(|()| tree).unwrap()
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
        let at = |x: f32, row: f32| [x + far * row, row, 0.0];
        (0..1600)
            .map(|i| cube(at((i % 40) as f32, (i / 40) as f32), 0.9))
            .collect()
    };
    let all = [0.0, 2.0, 5.0].map(slide);
    let cost = |tree: &BinaryTree| temporal_cost(tree, &moments(&all));
    let for_all = cost(&build(&all));
    for boxes in &all {
        let for_one = cost(&BinaryTree::over(&boxes[..]));
        assert!(for_all < 0.97 * for_one, "{for_all} {for_one}");
    }
}

#[test]
fn a_tree_is_nearly_as_good_as_a_moments_own_where_others_are_few_or_count_for_less() {
    let mut random = fastrand::Rng::with_seed(5);
    let all = [(); 2].map(|()| boxes(5000, &[0], &mut random));
    let cost = |tree: &BinaryTree, k: usize| sah_cost(tree, &all[k][..]);
    let own = [0, 1].map(|k| cost(&BinaryTree::over(&all[k][..]), k));
    let alone = cost(&build(&all[..1]), 0);
    assert!(alone < 1.03 * own[0], "{alone} {own:?}");
    for (weights, k) in [([1.0, 1e-3], 0), ([1e-3, 1.0], 1)] {
        let weighed = moments(&all).into_iter().zip(weights);
        let weighed: Vec<_> = weighed.map(|(m, weight)| Moment { weight, ..m }).collect();
        let mut tree = BinaryTree::default();
        let built = TemporalBuilder::default().build(&weighed, &Cancel::new(), &mut tree);
        let (heavy, light) = (cost(&tree, k), cost(&tree, 1 - k));
        assert!(
            built.is_ok() && heavy < 1.1 * own[k] && light > 3.0 * heavy,
            "{heavy} {light} {own:?}"
        );
    }
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
    let built = TemporalBuilder::default().build(&moments(&all), &cancel, &mut tree);
    assert_eq!((built, tree.root()), (Err(BuildError::Cancelled), None));
    assert!(tree.left_leaves().is_empty());
}
