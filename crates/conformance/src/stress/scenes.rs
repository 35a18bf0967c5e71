//! Each family's scenes and rays.

use crate::leaks::Aim;
use crate::stress::meshes::{self, Mesh, PLUMP, separate, soup};
use crate::stress::rays::{Aims, Target, of_zeros};
use crate::stress::{Family, Plan, closed};
use fastrand::Rng;
use geom::{Animation, Point, Ray, Triangle};
use std::sync::Arc;

/// A family has at least so many scenes, among which its rays are shared out.
const SCENES: u32 = 32;
/// Rays beyond which there are more scenes, so that rates spread alike whatever the number of rays.
const RAYS: u32 = 256;

/// A scene, how to stand it up, and what to ask it.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub(crate) animation: Arc<Animation>,
    /// When its tree is built, in key frames.
    pub(crate) built: f64,
    /// When it is traced.
    pub(crate) time: f64,
    pub(crate) rays: Vec<Ray>,
    /// Of a closed body: which rays begin inside.
    pub(crate) inside: Option<Vec<bool>>,
}

/// All scenes of a family; they depend on the family and the plan alone.
pub(crate) fn scenes(family: Family, plan: &Plan) -> Vec<Scene> {
    let shares = shares(plan.rays);
    let far = |offset| closed::scenes(offset, None, plan.seed, &shares);
    let near = |aim| closed::scenes(0.0, Some(aim), plan.seed, &shares);
    match family {
        Family::Far10 => far(10.0),
        Family::Far1e3 => far(1e3),
        Family::Far1e5 => far(1e5),
        Family::Far1e7 => closed::no_longer(far(1e7)),
        Family::Edges => near(Aim::Edge),
        Family::Vertices => near(Aim::Vertex),
        Family::FoldingCloth => vec![cloth(plan)],
        Family::Outlier => (0..)
            .zip(far(0.0))
            .map(|(i, body)| beside_outlier(body, &mut rng(family, plan.seed, i)))
            .collect(),
        _ => (0..)
            .zip(shares)
            .map(|(i, rays)| one(family, i, rays, &mut rng(family, plan.seed, i)))
            .collect(),
    }
}

/// How many rays each scene is asked.
fn shares(rays: u32) -> Vec<usize> {
    let scenes = rays.div_ceil(RAYS).max(SCENES);
    let share = |i| rays / scenes + u32::from(i < rays % scenes);
    (0..scenes).map(|i| share(i) as usize).collect()
}

fn rng(family: Family, seed: u64, number: u32) -> Rng {
    let mixed = |x: u64| Rng::with_seed(x).u64(..);
    Rng::with_seed(mixed(mixed(seed) ^ family as u64) ^ u64::from(number))
}

/// One scene of a family, with so many rays. Each begins with another sort of ray, so that few are of all sorts too.
fn one(family: Family, number: u32, rays: usize, rng: &mut Rng) -> Scene {
    let plump = |rng: &mut Rng| soup(64, 0.4, PLUMP, rng);
    let scaled = |exponents, rng: &mut Rng| {
        let by = meshes::power(exponents, rng);
        still(separate(&meshes::scaled(&plump(rng), by)))
    };
    let stage = match family {
        Family::Needles => still(separate(&soup(64, 0.8, [-7.0, -3.0], rng))),
        Family::ZeroArea => still(separate(&meshes::flakes(rng))),
        Family::Huge => scaled([15.0, 37.4], rng),
        Family::Tiny => scaled([-35.0, -12.0], rng),
        Family::Subnormal => scaled([-43.0, -38.0], rng),
        Family::Stacks => still(separate(&meshes::stacks(rng))),
        Family::InPlane => {
            let mut all = plump(rng);
            all.extend((0..64).map(|i| meshes::flat(i % 3, rng)));
            still(separate(&all))
        }
        Family::OnSurface => still(meshes::sheet(1000, rng)),
        Family::AxisParallel => still(meshes::sheet(8, rng)),
        Family::ExtremeKeys => extreme(plump(rng), plump(rng), rng),
        Family::Rearranged => {
            let key = |rng: &mut Rng| soup(256, 0.1, PLUMP, rng).concat();
            let keys = vec![key(rng), key(rng)];
            moving(keys, 0.0, 1.0)
        }
        Family::SignedZeros => still(separate(&meshes::zeros(48, rng))),
        Family::NonFinite => broken(&plump(rng), rng),
        Family::Exploding => exploding(rng),
        _ => unreachable!("{family} has scenes of its own"),
    };
    asked(stage, rays, |aims, i| {
        ray(family, aims, i + number as usize, rng)
    })
}

/// The `i`-th ray at a scene of a family.
fn ray(family: Family, aims: &Aims, i: usize, rng: &mut Rng) -> Ray {
    let targets = [Target::Inside, Target::Edge, Target::Vertex];
    match family {
        Family::InPlane => aims.in_plane(rng),
        Family::OnSurface => aims.on_surface(rng),
        Family::AxisParallel => aims.along_axis(targets[i % 3], rng),
        Family::Stacks if i.is_multiple_of(2) => aims.along_axis(Target::Inside, rng),
        Family::SignedZeros if i.is_multiple_of(2) => of_zeros(rng),
        _ => aims.aimed(Target::Inside, rng),
    }
}

/// Fills in a scene's rays; those that are not valid are made again.
fn asked(mut scene: Scene, rays: usize, mut ray: impl FnMut(&Aims, usize) -> Ray) -> Scene {
    let pose = scene.animation.pose(scene.time);
    let all = 0..scene.animation.triangle_count() as u32;
    let aims = Aims::new(all.map(|t| scene.animation.corners(pose, t)).collect());
    let valid = |i| {
        let mut again = std::iter::repeat_with(|| ray(&aims, i));
        again.find(Ray::is_valid).expect("most rays are valid")
    };
    scene.rays = (0..rays).map(valid).collect();
    scene
}

pub(crate) fn still((points, triangles): Mesh) -> Scene {
    let animation = Animation::new(vec![points], triangles);
    Scene {
        animation: Arc::new(animation.expect("meshes name their own vertices")),
        built: 0.0,
        time: 0.0,
        rays: Vec::new(),
        inside: None,
    }
}

/// Free triangles in motion.
pub(crate) fn moving(keys: Vec<Vec<Point>>, built: f64, time: f64) -> Scene {
    let count = keys[0].len() as u32 / 3;
    let triangles = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    let animation = Animation::new(keys, triangles.collect());
    Scene {
        animation: Arc::new(animation.expect("key frames have three vertices a triangle")),
        built,
        time,
        rays: Vec::new(),
        inside: None,
    }
}

/// From unit size to a million times that, or back.
fn extreme(small: Vec<Triangle>, large: Vec<Triangle>, rng: &mut Rng) -> Scene {
    let mut keys = vec![small.concat(), meshes::scaled(&large, 1e6).concat()];
    let time = meshes::power([-7.0, -0.01], rng);
    if rng.bool() {
        keys.reverse();
        return moving(keys, 0.0, 1.0 - time);
    }
    moving(keys, 0.0, time)
}

/// A quarter of the triangles has a vertex that is not finite in the first key frame, the second or both.
pub(crate) fn broken(triangles: &[Triangle], rng: &mut Rng) -> Scene {
    let mut keys = vec![triangles.concat(); 2];
    for t in 0..triangles.len() / 4 {
        let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][rng.usize(..3)];
        let vertex = 3 * t + rng.usize(..3);
        let axis = rng.usize(..3);
        let which = rng.usize(1..4);
        for (k, key) in keys.iter_mut().enumerate() {
            if which >> k & 1 == 1 {
                key[vertex][axis] = bad;
            }
        }
    }
    moving(keys, 0.0, [0.0, 0.5, 1.0][rng.usize(..3)])
}

/// A closed body beside one more triangle, which hardly any ray meets.
fn beside_outlier(body: Scene, rng: &mut Rng) -> Scene {
    let mut points = body.animation.keys()[0].clone();
    let mut triangles = body.animation.triangles().to_vec();
    let first = points.len() as u32;
    points.extend(meshes::outlier(rng));
    triangles.push([first, first + 1, first + 2]);
    let animation = Animation::new(vec![points], triangles);
    Scene {
        animation: Arc::new(animation.expect("the triangle names its own vertices")),
        ..body
    }
}

/// A sheet at rest, on its way, or with one vertex gone far.
pub(crate) fn exploding(rng: &mut Rng) -> Scene {
    let (points, triangles) = meshes::sheet(8, rng);
    let mut far = points.clone();
    let vertex = rng.usize(..far.len());
    far[vertex] = meshes::outlying(far[vertex], rng);
    let animation = Animation::new(vec![points.clone(), points, far], triangles);
    let time = [0.0, 1.0, 1.0 + rng.f64(), 2.0][rng.usize(..4)];
    Scene {
        animation: Arc::new(animation.expect("the mesh is the same")),
        built: [0.0, time][rng.usize(..2)],
        time,
        rays: Vec::new(),
        inside: None,
    }
}

/// `demo:twist` at its end, where it is tightest, on a tree of its beginning.
fn cloth(plan: &Plan) -> Scene {
    let demo = scene::open("demo:twist:3000", &scene::Options::default());
    let animation = demo.expect("demos need no file").animation;
    let stage = Scene {
        built: 0.0,
        time: animation.end(),
        animation,
        rays: Vec::new(),
        inside: None,
    };
    let mut rng = rng(Family::FoldingCloth, plan.seed, 0);
    asked(stage, plan.rays as usize, |aims, i| {
        let target = [Target::Inside, Target::Edge, Target::Vertex][i % 3];
        aims.aimed(target, &mut rng)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_depend_on_family_and_plan_alone_and_are_as_many_as_asked_for() {
        for family in Family::ALL {
            let made = |seed, rays| {
                let all = scenes(family, &Plan { seed, rays });
                all.iter().flat_map(|s| s.rays.clone()).collect::<Vec<_>>()
            };
            let rays = made(3, 101);
            assert_eq!(rays.len(), 101, "{family}");
            assert_eq!(rays, made(3, 101), "{family}");
            assert_ne!(rays, made(4, 101), "{family}");
            assert!(rays.iter().all(Ray::is_valid), "{family}");
        }
    }
}
