//! Tracing by a tree against the law's own loop over all triangles, over soups made to be awkward.

use super::law::{Test, World};
use super::{bits, closest, ready, rng, senseless_tree, soup, trace, tree_at};
use crate::geometry::Geometry;
use crate::intersect::{MollerTrumbore, Woop};
use crate::scale::Scale;
use backend::{Intersector, QueryKind, Rays};
use geom::{Animation, Hit, Point, Ray, Triangle};
use proptest::prelude::*;
use std::sync::Arc;

const TESTS: [(Intersector, Test); 3] = [
    (Intersector::Watertight, Test::WATERTIGHT),
    (Intersector::MollerTrumbore, Test::of::<MollerTrumbore>()),
    (Intersector::Woop, Test::of::<Woop>()),
];

/// Small integers and halves meet each other's edges; other numbers do not.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => (-3_i8..=3).prop_map(f32::from),
        2 => (-6_i8..=6).prop_map(|x| f32::from(x) * 0.5),
        2 => -3.0_f32..3.0,
        1 => (-3_i8..=3).prop_map(|x| f32::from(x) + f32::EPSILON),
    ]
}

fn point() -> impl Strategy<Value = Point> {
    [coordinate(), coordinate(), coordinate()]
}

fn triangle() -> impl Strategy<Value = Triangle> {
    prop_oneof![
        6 => [point(), point(), point()],
        // A stack of coplanar triangles.
        2 => [point(), point(), point()].prop_map(|t| t.map(|[x, y, _]| [x, y, 1.0])),
        // A needle.
        1 => (point(), point()).prop_map(|(a, b)| [a, b, [a[0] + 1e-6, a[1], a[2]]]),
        // A sliver, the least step away from having no area.
        1 => (point(), point()).prop_map(|(a, b)| {
            let middle = |i: usize| 0.5 * (a[i] + b[i]);
            [a, b, [middle(0), middle(1).next_up(), middle(2)]]
        }),
        // No area, and no place.
        1 => (point(), point()).prop_map(|(a, b)| [a, b, a]),
        1 => (point(), point()).prop_map(|(a, b)| [a, b, [f32::NAN, 0.0, 0.0]]),
    ]
}

/// Triangles, some of them twice, far from the origin or of an odd size.
fn triangles() -> impl Strategy<Value = Vec<Triangle>> {
    let place = prop_oneof![4 => Just(0.0_f32), 1 => Just(1e3), 1 => Just(1e5)];
    let size = prop_oneof![4 => Just(1.0_f32), 1 => Just(1e-25), 1 => Just(1e30), 1 => Just(1e-38)];
    let list = prop::collection::vec(triangle(), 1..30);
    (list, place, size).prop_map(|(mut list, place, size)| {
        let again = list.len() / 3;
        list.extend_from_within(..again);
        let put = |p: Point| [p[0] + place, p[1] - place, p[2]].map(|x| x * size);
        list.iter().map(|t| t.map(put)).collect()
    })
}

/// A light that may be nowhere.
fn light() -> impl Strategy<Value = Point> {
    let nowhere = [[f32::NAN; 3], [-1.0, f32::INFINITY, 0.0]];
    prop_oneof![9 => point(), 1 => prop::sample::select(nowhere.to_vec())]
}

/// How a ray is aimed: from where, to which part of which triangle.
#[derive(Clone, Debug)]
struct Aim {
    from: Point,
    on_surface: bool,
    distance: f32,
    at: prop::sample::Index,
    weights: [f32; 3],
    axis_parallel: Option<usize>,
    span: (f32, f32),
}

fn aim() -> impl Strategy<Value = Aim> {
    let weights = prop_oneof![
        Just([1.0, 0.0, 0.0]),
        Just([0.5, 0.5, 0.0]),
        Just([0.0, 0.25, 0.75]),
        Just([0.25, 0.5, 0.25]),
        Just([0.7, 0.7, -0.4]),
    ];
    let span = prop_oneof![
        4 => Just((0.0, f32::INFINITY)),
        1 => Just((0.25, 1.0)),
        1 => Just((1.0, 1.5)),
        1 => Just((-2.0, 0.5)),
    ];
    let distance =
        prop_oneof![6 => Just(1.0_f32), 1 => Just(1e4), 1 => Just(1e-6), 1 => Just(1e18)];
    let axis = prop::option::weighted(0.3, 0_usize..3);
    let at = any::<prop::sample::Index>();
    (point(), any::<bool>(), distance, at, weights, axis, span).prop_map(
        |(from, on_surface, distance, at, weights, axis_parallel, span)| Aim {
            from,
            on_surface,
            distance,
            at,
            weights,
            axis_parallel,
            span,
        },
    )
}

impl Aim {
    fn ray(&self, triangles: &[Triangle]) -> Ray {
        let corners = self.at.get(triangles);
        let [a, b, c] = corners;
        let w = self.weights;
        let target: Point = std::array::from_fn(|i| w[0] * a[i] + w[1] * b[i] + w[2] * c[i]);
        let size = corners.concat().iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        let size = if (1e-3..=1e3).contains(&size) {
            1.0
        } else {
            size
        };
        let mut origin = if self.on_surface {
            target
        } else {
            self.from.map(|x| x * size)
        };
        let mut direction: Point = std::array::from_fn(|i| (target[i] - origin[i]) * self.distance);
        if self.on_surface {
            direction = self.from.map(|x| x * size);
        }
        if let Some(axis) = self.axis_parallel {
            let along = self.distance * size;
            origin = target;
            origin[axis] -= along;
            direction = [0.0; 3];
            direction[axis] = along;
        }
        let (t_min, t_max) = self.span;
        Ray {
            origin,
            t_min,
            direction,
            t_max,
        }
    }
}

fn world(animation: &Animation) -> World {
    World::new(Geometry {
        positions: animation.first(),
        triangles: animation.triangles(),
        scale: Scale::of(animation),
        range: animation.range(animation.pose(0.0)),
    })
}

fn check_against_the_law(
    animation: &Arc<Animation>,
    rays: &[Ray],
    light: Point,
) -> Result<(), TestCaseError> {
    let pose = animation.pose(0.0);
    let world = world(animation);
    for (intersector, test) in TESTS {
        let expected: Vec<Hit> = rays.iter().map(|r| world.closest(r, test)).collect();
        let blocked: Vec<u8> = expected.iter().map(|h| h.is_hit().into()).collect();
        let hits = rays.iter().zip(&expected);
        let shadows: Vec<u8> = hits
            .map(|(r, h)| world.blocked(r, h, light, test).into())
            .collect();
        for tree in [tree_at(animation, pose), senseless_tree(animation)] {
            let mut backend = ready(animation, intersector, &tree, pose, 1);
            let found = closest(&mut backend, rays);
            prop_assert_eq!(bits(&found), bits(&expected), "{}", intersector);
            let (rays, kind) = (Rays::List(rays), QueryKind::ClosestAndShadow { light });
            let shadow = trace(&mut backend, rays, kind);
            prop_assert_eq!(bits(&shadow.closest), bits(&expected), "{}", intersector);
            prop_assert_eq!(&shadow.blocked, &shadows, "{}", intersector);
            let any = trace(&mut backend, rays, QueryKind::Any).blocked;
            prop_assert_eq!(&any, &blocked, "{}", intersector);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]

    #[test]
    fn trees_find_what_a_loop_over_all_triangles_finds(
        triangles in triangles(),
        aims in prop::collection::vec(aim(), 24),
        (light, lit_from) in (light(), any::<prop::sample::Index>()),
    ) {
        let rays: Vec<Ray> = aims.iter().map(|aim| aim.ray(&triangles)).collect();
        // In the plane of a triangle, or beside it.
        let corners = lit_from.get(&triangles);
        let light = if light[0] > 0.0 { corners[1] } else { std::array::from_fn(|i| corners[0][i] + light[i]) };
        check_against_the_law(&soup(&triangles), &rays, light)?;
    }
}

/// Edge on, a test's `t` is little more than noise, and the clamp to the box decides.
#[test]
fn rays_within_the_plane_of_a_triangle_and_its_copy_are_settled_by_index() {
    let mut rng = rng();
    let triangles: Vec<Triangle> = (0..100)
        .map(|_| [0; 3].map(|_| [0; 3].map(|_| rng.random_range(-1.0..1.0_f32))))
        .collect();
    let rays: Vec<Ray> = (0..20_000)
        .map(|i| {
            let [a, b, c] = triangles[i % triangles.len()];
            let mut within = |reach: f32| -> Point {
                let [u, v] = [0; 2].map(|_: i32| rng.random_range(-reach..reach));
                std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]))
            };
            let (from, to) = (within(20.0), within(1.0));
            Ray::new(from, std::array::from_fn(|k| to[k] - from[k]))
        })
        .collect();
    let twice = [triangles.as_slice(), triangles.as_slice()].concat();
    check_against_the_law(&soup(&twice), &rays, [0.0, 2.0, 0.0]).unwrap();
}
