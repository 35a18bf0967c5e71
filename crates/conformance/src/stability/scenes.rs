//! Scenes and rays of each family.

use crate::generate::bodies::{
    BODIES, BodyRayKind, BodyTarget, PlacedBody, body_rays, placed_body,
};
use crate::generate::meshes::{self, IndexedMesh, UNSHORTENED_EDGE, apart, separate, soup};
use crate::generate::rays::{RayKind, Target, TargetTriangles, of_zeros, rays_of};
use crate::generate::strategies::sample;
use crate::generate::{mixed, shares};
use crate::stability::{Family, Plan};
use crate::stage::with_triangle;
use fastrand::Rng;
use geom::{Animation, Point, Ray, Triangle};
use proptest::strategy::Strategy;
use std::sync::Arc;

/// Minimum number of scenes per family, among which its rays are divided. `folding-cloth` has one scene, with all rays.
const SCENES: u32 = 32;
/// Maximum number of rays per scene. More rays need more scenes, so that the spread of a rate does not depend on the
/// number of rays.
const RAYS: u32 = 256;

/// A scene, the times of its tree and its trace, and its rays.
#[derive(Clone, Debug)]
pub(crate) struct StabilityScene {
    pub(crate) animation: Arc<Animation>,
    /// Time at which the tree is built, in key frames.
    pub(crate) built: f64,
    /// Time at which rays are traced, in key frames.
    pub(crate) time: f64,
    pub(crate) rays: Vec<Ray>,
    /// For closed bodies: whether each ray starts inside.
    pub(crate) inside: Option<Vec<bool>>,
}

impl StabilityScene {
    /// Creates a scene without rays, whose tree is built at `built` and which is traced at `time`.
    pub(crate) fn new(animation: Arc<Animation>, [built, time]: [f64; 2]) -> Self {
        Self {
            animation,
            built,
            time,
            rays: Vec::new(),
            inside: None,
        }
    }
}

fn drawn<S: Strategy>(strategy: S, rng: &mut Rng) -> S::Value {
    sample(&strategy, rng.u64(..))
}

/// Returns all scenes of a family, which depend only on the family and the plan.
pub(crate) fn scenes(family: Family, plan: &Plan) -> Vec<StabilityScene> {
    let rng = |number| Rng::with_seed(mixed(mixed(plan.seed) ^ family as u64) ^ number);
    if family == Family::FoldingCloth {
        return vec![cloth(plan.rays as usize, &mut rng(0))];
    }
    let count = plan.rays.div_ceil(RAYS).max(SCENES);
    let numbered = (0..).zip(shares(plan.rays.into(), count.into()));
    let scenes = numbered.map(|(i, rays)| one(family, i, rays as usize, &mut rng(i as u64)));
    scenes.collect()
}

/// Returns one scene of a family, with `rays` rays. Scenes start with different kinds of rays, so that all kinds occur
/// even if scenes have few rays.
fn one(family: Family, number: usize, rays: usize, rng: &mut Rng) -> StabilityScene {
    let body = |offset: f32, target: Option<BodyTarget>, rng: &mut Rng| {
        let placed = placed_body(&BODIES[number % BODIES.len()], offset, false);
        let placed = drawn(placed, rng);
        // After each round over all bodies, scenes start with the next kind of rays.
        let kinds = number / BODIES.len()..;
        closed(&placed, target, kinds.take(rays), rng)
    };
    match family {
        Family::Far10 => body(10.0, None, rng),
        Family::Far1e3 => body(1e3, None, rng),
        Family::Far1e5 => body(1e5, None, rng),
        // At this distance, rounding may deform the body so that a point inside is then outside.
        Family::Far1e7 => StabilityScene {
            inside: None,
            ..body(1e7, None, rng)
        },
        Family::Edges => body(0.0, Some(BodyTarget::Edge), rng),
        Family::Vertices => body(0.0, Some(BodyTarget::Vertex), rng),
        Family::Outlier => beside_outlier(body(0.0, None, rng), rng),
        _ => {
            let scene = scene_without_rays(family, rng);
            with_rays(scene, rays, |targets, i| {
                ray(family, targets, i + number, rng)
            })
        }
    }
}

/// Returns a closed body with one ray per number in `kinds`. The number selects a [`BodyRayKind`] among those with this
/// target, or among all if `target` is `None`, modulo their count.
fn closed(
    placed: &PlacedBody,
    target: Option<BodyTarget>,
    kinds: impl Iterator<Item = usize>,
    rng: &mut Rng,
) -> StabilityScene {
    let mut wanted: Vec<_> = (0..6).map(BodyRayKind::nth).collect();
    wanted.retain(|kind| target.is_none_or(|target| target == kind.target));
    let ray = |i: usize| {
        let kind = wanted[i % wanted.len()];
        (
            kind.is_inside,
            valid(|| placed.ray(&drawn(body_rays(kind), rng))),
        )
    };
    let (inside, rays) = kinds.map(ray).unzip();
    StabilityScene {
        rays,
        inside: Some(inside),
        ..StabilityScene::new(placed.animation(), [0.0; 2])
    }
}

/// Returns a scene of a family that has no closed bodies. The scene has no rays yet.
fn scene_without_rays(family: Family, rng: &mut Rng) -> StabilityScene {
    let regular = |rng: &mut Rng| drawn(soup(64, 0.4, UNSHORTENED_EDGE), rng);
    let scaled = |exponents, rng: &mut Rng| {
        let by = drawn(meshes::power(exponents), rng);
        still(separate(&meshes::scaled(&regular(rng), by)))
    };
    match family {
        Family::Needles => still(separate(&drawn(soup(64, 0.8, [-7.0, -3.0]), rng))),
        Family::ZeroArea => still(separate(&drawn(meshes::flakes(), rng))),
        Family::Huge => scaled([15.0, 37.4], rng),
        Family::Tiny => scaled([-35.0, -12.0], rng),
        Family::Subnormal => scaled([-43.0, -38.0], rng),
        Family::Stacks => still(drawn(meshes::stacks(), rng)),
        Family::InPlane => {
            let mut all = regular(rng);
            all.extend((0..64).map(|i| drawn(meshes::flat(i % 3), rng)));
            still(separate(&all))
        }
        Family::OnSurface => still(drawn(meshes::sheet(16, 1000), rng)),
        Family::AxisParallel => still(drawn(meshes::sheet(16, 8), rng)),
        Family::ExtremeKeys => extreme(regular(rng), regular(rng), rng),
        Family::SignedZeros => {
            const NUMBERS: &[f32] = &[0.0, -0.0, 0.0, -0.0, 1.0, -1.0, 0.5, -0.5];
            still(separate(&drawn(meshes::of_numbers(NUMBERS, 48), rng)))
        }
        Family::NonFinite => broken(&regular(rng), rng),
        Family::Exploding => exploding(rng),
        _ => unreachable!("{family} has scenes of its own"),
    }
}

/// Returns a random ray for a scene of a family. `i` selects its kind and target where these rotate.
fn ray(family: Family, targets: &TargetTriangles, i: usize, rng: &mut Rng) -> Ray {
    let (kind, target) = match family {
        Family::InPlane => (RayKind::InPlane, Target::Inside),
        Family::OnSurface => (RayKind::OnSurface, Target::Inside),
        Family::AxisParallel => (RayKind::AlongAxis, Target::ALL[i % 3]),
        Family::Stacks if i.is_multiple_of(2) => (RayKind::AlongAxis, Target::Inside),
        Family::SignedZeros if i.is_multiple_of(2) => return drawn(of_zeros(), rng),
        _ => (RayKind::Aimed, Target::Inside),
    };
    targets.ray(&drawn(rays_of(kind, target), rng))
}

/// Generates the rays of a scene.
fn with_rays(
    mut scene: StabilityScene,
    rays: usize,
    mut ray: impl FnMut(&TargetTriangles, usize) -> Ray,
) -> StabilityScene {
    let [_, targets] = TargetTriangles::of(&scene.animation, scene.time);
    scene.rays = (0..rays).map(|i| valid(|| ray(&targets, i))).collect();
    scene
}

/// Repeats `ray` until it returns a valid ray.
fn valid(ray: impl FnMut() -> Ray) -> Ray {
    let mut again = std::iter::repeat_with(ray);
    again.find(Ray::is_valid).expect("most rays are valid")
}

/// Creates a scene without rays, whose tree is built at the first of two times and which is traced at the second.
fn scene(keys: Vec<Vec<Point>>, triangles: Vec<[u32; 3]>, times: [f64; 2]) -> StabilityScene {
    let animation = Animation::new(keys, triangles);
    let animation = animation.expect("meshes use only their own vertices");
    StabilityScene::new(Arc::new(animation), times)
}

fn still((points, triangles): IndexedMesh) -> StabilityScene {
    scene(vec![points], triangles, [0.0; 2])
}

/// Creates a scene of separate moving triangles.
fn moving(keys: Vec<Vec<Point>>, time: f64) -> StabilityScene {
    let triangles = apart(keys[0].len() / 3);
    scene(keys, triangles, [0.0, time])
}

/// Returns a scene that grows by a factor of a million from unit size, or shrinks to unit size.
fn extreme(small: Vec<Triangle>, large: Vec<Triangle>, rng: &mut Rng) -> StabilityScene {
    let mut keys = vec![small.concat(), meshes::scaled(&large, 1e6).concat()];
    let time = drawn(meshes::power([-7.0, -0.01]), rng);
    if rng.bool() {
        keys.reverse();
        return moving(keys, 1.0 - time);
    }
    moving(keys, time)
}

/// Makes one vertex of a quarter of the triangles not finite in the first key frame, the second or both.
fn broken(triangles: &[Triangle], rng: &mut Rng) -> StabilityScene {
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
    moving(keys, [0.0, 0.5, 1.0][rng.usize(..3)])
}

/// Adds an outlying triangle to a scene with a closed body. Hardly any ray hits this triangle.
fn beside_outlier(body: StabilityScene, rng: &mut Rng) -> StabilityScene {
    let outlier = drawn(meshes::outlier(), rng);
    let animation = Arc::new(with_triangle(&body.animation, outlier));
    StabilityScene { animation, ..body }
}

/// Returns a sheet of which one vertex is at rest, moving or far away at the traced time.
fn exploding(rng: &mut Rng) -> StabilityScene {
    let (points, triangles) = drawn(meshes::sheet(16, 8), rng);
    let mut far = points.clone();
    let vertex = rng.usize(..far.len());
    far[vertex] = drawn(meshes::outlying(far[vertex]), rng);
    let time = [0.0, 1.0, 1.0 + rng.f64(), 2.0][rng.usize(..4)];
    let built = [0.0, time][rng.usize(..2)];
    scene(vec![points.clone(), points, far], triangles, [built, time])
}

/// Returns `demo:twist` at its end, where it is tightest, with a tree built at its start.
fn cloth(rays: usize, rng: &mut Rng) -> StabilityScene {
    let demo = ::scene::open("demo:twist:3000", &::scene::SceneOptions::default());
    let animation = demo.expect("demos need no file").animation;
    let times = [0.0, animation.end()];
    with_rays(StabilityScene::new(animation, times), rays, |targets, i| {
        targets.ray(&drawn(rays_of(RayKind::Aimed, Target::ALL[i % 3]), rng))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn family_rays_are_reproducible() {
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
