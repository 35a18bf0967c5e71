//! Compares every instruction set of the machine with the reference: by all properties of `conformance`, and by the
//! hits of packets and of groups of rays.

use backend::{Backend, Generation, Intersector, QueryKind, Rays};
use bvh_layout::Topology;
use conformance::stage::{interpolate_and_refit, trace_and_wait, tree_at};
use conformance::{Cases, PROPERTIES, Reference, check_property, nth_case, uneven_tree};
use cpu_ref::CpuBackend;
use cpu_simd::{InstructionSet, open_at};
use geom::{Animation, Camera, CameraPose, Point, Ray};
use proptest::prelude::*;
use std::sync::Arc;

/// Beyond this, squares of single precision overflow.
const FAR: f32 = 2e19;
/// Cases of each property and instruction set.
const CASES: u32 = 4;

#[test]
fn properties_hold_for_every_instruction_set() {
    let mut reference = Reference::new(Box::new(CpuBackend::new(Some(1)).unwrap()));
    for instruction_set in InstructionSet::all() {
        let mut subject = open_at(instruction_set, Some(2)).unwrap();
        for property in PROPERTIES {
            let held = check_property(
                property,
                &mut subject,
                &mut reference,
                &Cases::new(7, 0..=CASES - 1),
            );
            held.unwrap_or_else(|e| panic!("{instruction_set:?}: {e}"));
        }
    }
}

/// In some scenes, a vertex is so far away that areas overflow.
#[test]
fn overflowing_areas_yield_no_cost() {
    let name = "frames_equal_the_reference_after_any_commands";
    let property = PROPERTIES
        .iter()
        .find(|property| property.name == name)
        .unwrap();
    let mut reference = Reference::new(Box::new(CpuBackend::new(Some(1)).unwrap()));
    let mut subject = open_at(InstructionSet::all()[0], Some(2)).unwrap();
    let is_far = |number: &u32| {
        let animation = nth_case(1, *number).animation;
        let keys = animation.all_keys().unwrap();
        let coordinates = || keys.iter().flat_map(|key| key.iter()).flatten();
        animation.scale_exponent() == 0
            && coordinates().all(|x| x.is_finite())
            && coordinates().any(|x| x.abs() >= FAR)
    };
    let number = (0..1000).find(is_far).unwrap();
    let held = check_property(
        property,
        &mut subject,
        &mut reference,
        &Cases::new(1, number..=number),
    );
    held.unwrap();
}

fn near(reach: f32) -> impl Strategy<Value = Point> {
    [-reach..reach, -reach..reach, -reach..reach]
}

/// Cameras inside and outside the ball, with fields of view of 2 to 175 degrees. Some look at the origin. Lengths of
/// directions vary.
fn cameras() -> impl Strategy<Value = Camera> {
    let eye = prop_oneof![3 => near(4.0), 1 => near(0.9), 1 => near(60.0)];
    let at = prop_oneof![3 => near(1.0), 1 => Just([0.0; 3])];
    let fov = prop_oneof![2.0_f32..20.0, 20.0_f32..175.0];
    let length =
        prop_oneof![2 => Just(1.0_f32), 1 => 0.1_f32..30.0, 1 => Just(1e25), 1 => Just(1e-25)];
    (eye, at, fov, length, [1_u32..70, 1_u32..40]).prop_map(|(eye, at, fov, length, size)| {
        let camera = |eye, target| {
            let pose = CameraPose::new(eye, target).with_fov(fov);
            Camera::look_at(pose.with_up([0.1, 1.0, 0.2]), size)
        };
        let camera = camera(eye, at).or_else(|| camera([0.0, 0.0, 5.0], [0.0; 3]));
        let camera = camera.expect("a valid camera");
        Camera {
            corner: camera.corner.map(|x| x * length),
            across: camera.across.map(|x| x * length),
            down: camera.down.map(|x| x * length),
            ..camera
        }
    })
}

/// Numbers of any size and sign, including infinity and NaN.
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

/// Unrelated rays of every direction and length. Some have limits, and some are invalid.
fn unrelated_rays() -> impl Strategy<Value = Vec<Ray>> {
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

/// Triangles around the origin, within about `size` along each axis. Some move, appear late, shrink to a point or are
/// never active.
fn ball(size: f32) -> Arc<Animation> {
    let (mut state, mut keys) = (9_u32, vec![Vec::new(); 2]);
    let mut number = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 8_388_608.0 - 1.0
    };
    for triangle in 0..1200 {
        let middle: Point = std::array::from_fn(|_| number());
        for _ in 0..3 {
            let corner: Point = std::array::from_fn(|i| size * (middle[i] + 0.15 * number()));
            let moved = corner.map(|x| if triangle % 3 == 0 { x + 0.2 * size } else { x });
            let inactive = [f32::NAN; 3];
            keys[0].push(if triangle % 50 < 2 { inactive } else { corner });
            keys[1].push(match triangle % 50 {
                1 => inactive,
                7 => [size; 3],
                _ => moved,
            });
        }
    }
    let triangles = (0..1200).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    Arc::new(Animation::new(keys, triangles.collect()).expect("a ball"))
}

/// A good tree, and one built without regard to the triangles' positions.
fn trees(animation: &Animation) -> [Topology; 2] {
    let good = tree_at(animation, 0.7);
    let mut leaves = good.binary().order().to_vec();
    leaves.sort_unstable();
    let bad = uneven_tree(animation.triangle_count(), &leaves, 20);
    [good, bad]
}

fn ready(
    mut backend: CpuBackend,
    animation: &Arc<Animation>,
    intersector: Intersector,
    tree: &Topology,
) -> CpuBackend {
    backend.load(Arc::clone(animation), intersector).unwrap();
    backend.adopt(tree, Generation(1)).unwrap();
    interpolate_and_refit(&mut backend, animation, 0.7).unwrap();
    backend.submit().unwrap();
    backend
}

/// Returns all answers to these rays, as bits.
fn answers(
    backend: &mut CpuBackend,
    rays: Rays<'_>,
    light: Point,
) -> [(Vec<[u32; 4]>, Vec<u8>); 3] {
    let kinds = [
        QueryKind::Closest,
        QueryKind::Any,
        QueryKind::ClosestAndShadow { light },
    ];
    kinds.map(|kind| {
        let hits = trace_and_wait(backend, rays, kind).unwrap().hits;
        let bits = hits.closest.iter();
        let bits = bits.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.triangle]);
        (bits.collect(), hits.blocked)
    })
}

/// Checks that every instruction set finds the reference's hits. The instruction sets use the two trees in turn.
fn check(
    animation: &Arc<Animation>,
    intersector: Intersector,
    rays: &[Rays<'_>],
    light: Point,
) -> Result<(), TestCaseError> {
    let trees = trees(animation);
    let reference = CpuBackend::new(Some(1)).unwrap();
    let mut reference = ready(reference, animation, intersector, &trees[0]);
    let expected = answers(&mut reference, rays[0], light);
    for (instruction_set, tree) in InstructionSet::all().into_iter().zip(trees.iter().cycle()) {
        let subject = open_at(instruction_set, Some(1)).unwrap();
        let mut subject = ready(subject, animation, intersector, tree);
        for &rays in rays {
            let found = answers(&mut subject, rays, light);
            prop_assert!(found == expected, "{instruction_set:?} {intersector}");
        }
    }
    Ok(())
}

fn larger(ray: &Ray, size: f32) -> Ray {
    Ray {
        origin: ray.origin.map(|x| x * size),
        t_min: ray.t_min * size,
        t_max: ray.t_max * size,
        ..*ray
    }
}

/// Sizes of scenes, with and without scaling.
fn size() -> impl Strategy<Value = f32> {
    prop_oneof![Just(1.0), (-18_i32..18).prop_map(|e| 2.0_f32.powi(4 * e))]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn ray_groups_match_single_rays(camera in cameras(), light in near(9.0), size in size()) {
        let camera = Camera { eye: camera.eye.map(|x| x * size), ..camera };
        let rays: Vec<Ray> = camera.rays().collect();
        let rays = [Rays::List(&rays), Rays::Camera(&camera)];
        for intersector in Intersector::ALL {
            check(&ball(size), intersector, &rays, light.map(|x| x * size))?;
        }
    }

    #[test]
    fn ray_groups_respect_individual_intervals(
        camera in cameras(),
        own in prop::collection::vec([-2.0_f32..3.0, 0.1_f32..9.0, -0.1_f32..0.1], 1..17),
        light in near(9.0),
    ) {
        let own = own.iter().cycle();
        let rays = camera.rays().zip(own).map(|(ray, &[t_min, t_max, shift])| {
            let length = ray.direction.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
            let [t_min, t_max] = [t_min, t_max].map(|t| t / length);
            let origin = ray.origin.map(|x| x + shift);
            Ray { origin, t_min, t_max, ..ray }
        });
        let rays: Vec<Ray> = rays.collect();
        for intersector in Intersector::ALL {
            check(&ball(1.0), intersector, &[Rays::List(&rays)], light)?;
        }
    }

    #[test]
    fn incoherent_rays_match_scalar_hits(
        rays in unrelated_rays(),
        light in near(9.0),
        size in size(),
        intersector in prop::sample::select(&Intersector::ALL[..]),
    ) {
        let rays: Vec<_> = rays.iter().map(|ray| larger(ray, size)).collect();
        check(&ball(size), intersector, &[Rays::List(&rays)], light.map(|x| x * size))?;
    }
}

/// The third key frame prevents scaling. In the others, products of coordinates with `1 / d` overflow.
#[test]
fn distant_triangles_of_unscaled_scenes_are_hit() {
    let (far, wide) = (2.0_f32.powi(68), 2.0_f32.powi(48));
    let distant = vec![[far, 0.0, 0.0], [far + wide, 0.0, 0.0], [far, 1.0, 0.0]];
    let outlying = vec![[1.0; 3], [1e6, 0.0, 0.0], [1.0; 3]];
    let keys = vec![distant.clone(), distant, outlying];
    let animation = Arc::new(Animation::new(keys, vec![[0, 1, 2]]).unwrap());
    assert_eq!(animation.scale_exponent(), 0);
    let tree = tree_at(&animation, 0.7);
    let ray = Ray::new([far + 0.25 * wide, 0.25, -1.0], [0.0, 0.0, 1.0]);
    for intersector in Intersector::ALL {
        for instruction_set in InstructionSet::all() {
            let subject = open_at(instruction_set, Some(1)).unwrap();
            let mut subject = ready(subject, &animation, intersector, &tree);
            let rays = Rays::List(std::slice::from_ref(&ray));
            let traced = trace_and_wait(&mut subject, rays, QueryKind::Closest).unwrap();
            let t = traced.hits.closest[0].t;
            assert_eq!(t, 1.0, "{instruction_set:?} {intersector}");
        }
    }
}
