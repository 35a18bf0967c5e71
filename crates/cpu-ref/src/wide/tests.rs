//! Rays that run together against the same rays one by one.

use crate::CpuBackend;
use crate::testing::{bits, icosphere, kinds, moving, ready, senseless_tree, trace, tree_at};
use backend::{Backend, Generation, Intersector, QueryKind, Rays};
use bvh_layout::{First, Topology};
use geom::{Aabb, Animation, Camera, Point, Pose, Ray};
use proptest::prelude::*;
use std::sync::Arc;

fn near(reach: f32) -> impl Strategy<Value = Point> {
    [-reach..reach, -reach..reach, -reach..reach]
}

/// Cameras inside and outside, of every angle, some along an axis; directions of any length.
fn cameras() -> impl Strategy<Value = Camera> {
    let eye = prop_oneof![3 => near(4.0), 1 => near(0.9), 1 => near(60.0)];
    let at = prop_oneof![3 => near(1.0), 1 => Just([0.0; 3])];
    let fov = prop_oneof![2.0_f32..20.0, 20.0_f32..175.0];
    let length =
        prop_oneof![2 => Just(1.0_f32), 1 => 0.1_f32..30.0, 1 => Just(1e25), 1 => Just(1e-25)];
    (eye, at, fov, length, [1_u32..70, 1_u32..40]).prop_map(|(eye, at, fov, length, size)| {
        let up = [0.1, 1.0, 0.2];
        let camera = Camera::look_at(eye, at, up, fov, size);
        let camera = camera.unwrap_or_else(|| {
            Camera::look_at([0.0, 0.0, 5.0], [0.0; 3], up, fov, size).expect("it sees")
        });
        Camera {
            corner: camera.corner.map(|x| x * length),
            across: camera.across.map(|x| x * length),
            down: camera.down.map(|x| x * length),
            ..camera
        }
    })
}

fn check(animation: &Arc<Animation>, camera: &Camera, light: Point) -> Result<(), TestCaseError> {
    let pose = animation.pose(0.7 * animation.end());
    let rays: Vec<Ray> = camera.rays().collect();
    let trees = [tree_at(animation, pose), senseless_tree(animation)];
    let mut expected = None;
    for (kind, tree) in kinds().into_iter().zip(trees.iter().cycle()) {
        let mut backend = ready(animation, (Intersector::Watertight, kind), tree, pose, 1);
        for rays in [Rays::List(&rays), Rays::Camera(camera)] {
            let shadow = trace(&mut backend, rays, QueryKind::ClosestAndShadow { light });
            let any = trace(&mut backend, rays, QueryKind::Any);
            let found = (shadow, any);
            let expected = expected.get_or_insert_with(|| found.clone());
            prop_assert_eq!(&found, expected, "{:?}", kind);
        }
    }
    Ok(())
}

/// A number of any size and sign, some of them none.
fn any_number() -> impl Strategy<Value = f32> {
    let odd = [
        0.0,
        -0.0,
        1e-45,
        -1e-39,
        1e-30,
        3e38,
        f32::INFINITY,
        f32::NAN,
        1e19,
        -2e-19,
    ];
    prop_oneof![8 => -3.0_f32..3.0, 1 => prop::sample::select(odd.to_vec())]
}

/// Rays that have nothing in common: every direction and length, some with limits, some that mean nothing.
fn strangers() -> impl Strategy<Value = Vec<Ray>> {
    let three = || [any_number(), any_number(), any_number()];
    let length =
        prop_oneof![4 => Just(1.0_f32), 1 => Just(1e-19), 1 => Just(1e22), 1 => 0.01_f32..100.0];
    let t_min = prop_oneof![4 => Just(0.0_f32), 1 => -3.0_f32..3.0, 1 => any_number()];
    let t_max = prop_oneof![4 => Just(f32::INFINITY), 1 => 0.0_f32..4.0, 1 => any_number()];
    let ray = (three(), three(), length, t_min, t_max).prop_map(
        |(origin, direction, length, t_min, t_max)| Ray {
            origin,
            t_min: t_min / length,
            direction: direction.map(|x| x * length),
            t_max: t_max / length,
        },
    );
    prop::collection::vec(ray, 1..400)
}

/// Boxes and hits after a tree is adopted in another's place.
fn after(
    backend: &mut CpuBackend,
    tree: &Topology,
    pose: Pose,
    rays: &[Ray],
) -> (Vec<[u32; 6]>, Vec<[u32; 4]>) {
    backend.adopt(tree, Generation(2)).unwrap();
    backend.interpolate(pose).unwrap();
    backend.preprocess().unwrap();
    backend.refit().unwrap();
    let hits = trace(backend, Rays::List(rays), QueryKind::Closest).closest;
    let boxes = backend.inspect().boxes().unwrap();
    let corners = |b: &Aabb| [b.min, b.max].concat().try_into().unwrap();
    let boxes = boxes.iter().map(|b| {
        let six: [f32; 6] = corners(b);
        six.map(f32::to_bits)
    });
    (boxes.collect(), bits(&hits))
}

#[test]
fn a_tree_that_brings_its_blocks_is_adopted_as_one_that_does_not() {
    let animation = moving();
    let (first, pose) = (animation.pose(0.0), animation.pose(1.3));
    let [good, bad] = [tree_at(&animation, pose), senseless_tree(&animation)];
    let camera = Camera::look_at([3.0, 2.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 50.0, [40, 30]);
    let rays: Vec<Ray> = camera.unwrap().rays().collect();
    for (old, new) in [(&good, &bad), (&bad, &good)] {
        let mut found = kinds().into_iter().flat_map(|kind| {
            let with = new
                .clone()
                .with_blocks(animation.triangles(), (&[], First::Left));
            let method = (Intersector::Watertight, kind);
            [with, new.clone()].map(|new| {
                let mut backend = ready(&animation, method, old, first, 1);
                after(&mut backend, &new, pose, &rays)
            })
        });
        let expected = found.next().unwrap();
        assert!(found.all(|other| other == expected));
    }
}

fn check_list(animation: &Arc<Animation>, rays: &[Ray], light: Point) -> Result<(), TestCaseError> {
    let tree = tree_at(animation, animation.pose(0.0));
    let mut expected = None;
    for kind in kinds() {
        let mut backend = ready(
            animation,
            (Intersector::Watertight, kind),
            &tree,
            animation.pose(0.0),
            1,
        );
        let rays = Rays::List(rays);
        let shadow = trace(&mut backend, rays, QueryKind::ClosestAndShadow { light });
        let any = trace(&mut backend, rays, QueryKind::Any).blocked;
        let found = (bits(&shadow.closest), shadow.blocked, any);
        let expected = expected.get_or_insert_with(|| found.clone());
        prop_assert_eq!(&found, expected, "{:?}", kind);
    }
    Ok(())
}

/// A ball of many triangles in scaled units that are not the scene's.
fn far_from_one(size: f32) -> Arc<Animation> {
    let ball = icosphere(3, 1.0, [0.0; 3]);
    let keys = ball.keys().iter().map(|key| {
        let scaled = key.iter().map(|p| p.map(|x| x * size));
        scaled.collect::<Vec<_>>()
    });
    Arc::new(Animation::new(keys.collect(), ball.triangles().to_vec()).expect("a ball"))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn neighbours_together_hit_what_each_hits_alone(camera in cameras(), light in near(9.0)) {
        check(&moving(), &camera, light)?;
    }

    #[test]
    fn so_they_do_where_units_are_scaled(camera in cameras(), light in near(9.0), exponent in -30_i32..30) {
        let size = 2.0_f32.powi(4 * exponent);
        let camera = Camera { eye: camera.eye.map(|x| x * size), ..camera };
        check(&far_from_one(size), &camera, light.map(|x| x * size))?;
    }

    #[test]
    fn strangers_hit_with_vectors_what_they_hit_without(rays in strangers(), light in near(9.0)) {
        check_list(&moving(), &rays, light)?;
    }

    #[test]
    fn so_do_strangers_where_units_are_scaled(rays in strangers(), light in near(9.0), exponent in -18_i32..18) {
        let size = 2.0_f32.powi(4 * exponent);
        let larger = |ray: &Ray| Ray { origin: ray.origin.map(|x| x * size), t_min: ray.t_min * size, t_max: ray.t_max * size, ..*ray };
        let rays: Vec<_> = rays.iter().map(larger).collect();
        check_list(&far_from_one(size), &rays, light.map(|x| x * size))?;
    }
}
