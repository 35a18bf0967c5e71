//! The driver's own trees, beside the reference. `ABVH_REQUIRE_BACKENDS=vulkan-rt` turns an absent device red.

use crate::scenes::{SHADOWED, apart, camera, go, hits, open, rays, stand, swarm, tree_at};
use backend::{Backend, Generation, Hits, Method, QueryKind, Rays};
use cpu_ref::CpuBackend;
use geom::{Animation, Hit};
use gpu_vulkan::{Options, Validation};
use gpu_vulkan_rt::{DriverTreeBackend, Prefer};
use std::sync::Arc;

/// A backend whose validation layer must have nothing to say.
struct Watched(DriverTreeBackend);

impl Drop for Watched {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            assert_eq!(self.0.gpu().validation_messages(), [""; 0]);
        }
    }
}

fn made(prefer: Prefer) -> Watched {
    let options = Options {
        validation: Validation::IfInstalled,
        ..Options::default()
    };
    Watched(DriverTreeBackend::new(&options, prefer).unwrap())
}

/// What both find at some times: the driver by trees made anew where `anew` says so, else updated.
fn both(
    prefer: Prefer,
    animation: &Arc<Animation>,
    frames: &[(f64, bool)],
    (rays, kind): (Rays<'_>, QueryKind),
) -> Vec<[(Hits, [u64; 4]); 2]> {
    let mut watched = made(prefer);
    let subject = &mut watched.0;
    let mut reference = CpuBackend::new(Some(1)).unwrap();
    open(&mut reference, animation);
    subject
        .load(Arc::clone(animation), Method::default())
        .unwrap();
    let mut found = Vec::new();
    for (i, &(time, anew)) in frames.iter().enumerate() {
        subject.interpolate(animation.pose(time)).unwrap();
        if anew {
            subject.rebuild(Generation(i as u64 + 1)).unwrap();
        }
        subject.preprocess().unwrap();
        subject.refit().unwrap();
        stand(&mut reference, animation, time);
        found.push([subject, &mut reference as &mut dyn Backend].map(|b| {
            let ticket = go(b, rays, kind);
            let r = b.wait(ticket).unwrap();
            (
                hits(b, ticket),
                [r.hits, r.blocked, r.inactive, r.degenerate],
            )
        }));
    }
    found
}

/// Rays that differ in what they hit, or are off by more than a little.
fn differences(both: &[(Hits, [u64; 4]); 2]) -> usize {
    let [(a, _), (b, _)] = both;
    let near = |a: f32, b: f32| (a - b).abs() <= 1e-4 * (1.0 + b.abs());
    let same = |(a, b): &(&Hit, &Hit)| {
        a.triangle == b.triangle
            && (!a.is_hit() || near(a.t, b.t) && near(a.u, b.u) && near(a.v, b.v))
    };
    let closest = a.closest.iter().zip(&b.closest).filter(|p| !same(p));
    let blocked = a.blocked.iter().zip(&b.blocked).filter(|(a, b)| a != b);
    closest.count() + blocked.count()
}

const ALL: [(f64, bool); 6] = [
    (0.0, true),
    (0.6, false),
    (1.0, false),
    (1.3, true),
    (1.7, true),
    (2.0, false),
];

pub(crate) fn the_drivers_trees_are_hit_where_the_references_are() {
    let animation = swarm(2000);
    let (camera, list) = (camera(), rays(3000));
    for prefer in [Prefer::FastBuild, Prefer::FastTrace] {
        for (rays, kind) in [
            (Rays::Camera(&camera), SHADOWED),
            (Rays::Camera(&camera), QueryKind::Closest),
            (Rays::List(&list), SHADOWED),
            (Rays::List(&list), QueryKind::Closest),
            (Rays::List(&list), QueryKind::Any),
        ] {
            for both in both(prefer, &animation, &ALL, (rays, kind)) {
                let off = differences(&both);
                assert!(off <= rays.count() / 1000, "{off} {prefer:?} {kind:?}");
                let [a, b] = &both;
                let met = b.1[0];
                assert!(met as usize > rays.count() / 30, "{met}");
                // What the driver does not tell is counted as by the reference.
                assert!(a.1[2..] == b.1[2..] && b.1[2] > 0 && b.1[3] > 0);
                let hits = a.0.closest.iter().filter(|h| h.is_hit()).count() as u64;
                let blocked = a.0.blocked.iter().filter(|&&b| b == 1).count() as u64;
                let expected = match kind {
                    QueryKind::Any => [blocked, 0],
                    _ => [hits, blocked],
                };
                assert_eq!(a.1[..2], expected);
            }
        }
    }
}

pub(crate) fn the_drivers_work_is_timed_and_counting_is_not() {
    let mut watched = made(Prefer::FastBuild);
    let subject = &mut watched.0;
    let animation = swarm(300);
    subject
        .load(Arc::clone(&animation), Method::default())
        .unwrap();
    subject.interpolate(animation.pose(0.0)).unwrap();
    subject.rebuild(Generation(1)).unwrap();
    subject.refit().unwrap();
    let ticket = go(subject, Rays::Camera(&camera()), SHADOWED);
    let times = subject.wait(ticket).unwrap().times;
    let stages = [
        times.interpolate_ms,
        times.preprocess_ms,
        times.refit_ms,
        times.trace_primary_ms,
    ];
    let sum: f64 = stages.iter().map(|t| t.unwrap()).sum();
    assert!((sum - times.device_ms).abs() < 1e-6, "{times:?}");
    assert_eq!(times.trace_shadow_ms, None);
}

pub(crate) fn a_scene_without_live_triangles_is_hit_by_nothing() {
    let animation = apart(vec![vec![[f32::NAN; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
    let camera = camera();
    let first = [(0.0, true)];
    for [a, b] in both(
        Prefer::FastBuild,
        &animation,
        &first,
        (Rays::Camera(&camera), SHADOWED),
    ) {
        assert!(a.0 == b.0 && a.1 == b.1);
    }
}

pub(crate) fn trees_of_others_are_refused() {
    let mut watched = made(Prefer::FastBuild);
    let animation = swarm(3);
    let subject = &mut watched.0;
    subject
        .load(Arc::clone(&animation), Method::default())
        .unwrap();
    let tree = tree_at(&animation, 0.0);
    let refused = subject.adopt(&tree, Generation(1)).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "vulkan-rt does not support trees made by others"
    );
    assert!(subject.makes_own_trees() && subject.inspect().boxes().is_err());
}
