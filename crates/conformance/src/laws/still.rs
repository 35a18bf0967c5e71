//! What never moves may be passed over, and nothing else.

use crate::Case;
use crate::compare::{answers, lists, same_box, same_point};
use crate::stage::{
    boxes_anew, methods, open, open_with, plainly, stand, start, tree_at, vertices,
};
use crate::topologies::{Split, live, record};
use backend::{Backend, Generation, Hits, Method, QueryKind, Rays};
use bvh_layout::Topology;
use geom::Aabb;

/// Frames that are looked at.
const FRAMES: u64 = 7;
/// By how much, relatively, costs of trees may differ: sums in single precision, taken in any order.
const COST_TOLERANCE: f64 = 1e-4;

/// A tree that comes with lists of what moves gives the positions, boxes, counts,
/// cost and hits of one that comes without, frame after frame and tree after tree,
/// whichever stages were done before, in every layout.
pub(crate) fn passed_over(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    for method in methods(subject)? {
        if method.intersector == Method::default().intersector {
            passed_over_by(method, case, subject, reference)
                .map_err(|e| format!("{method:?}: {e}"))?;
        }
    }
    Ok(())
}

fn passed_over_by(
    method: Method,
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let mut rng = fastrand::Rng::with_seed(case.chance);
    let mut tree = tree_at(&case.animation, case.times[0]);
    open_with(subject, &case.animation, case.times[0], method).map_err(plainly)?;
    let mut now = case.times[0];
    stand(subject, &case.animation, now)?;
    for frame in 0..FRAMES {
        let seen = look(case, subject, now)?;
        let expected = whole(case, reference, (&tree, now))?;
        same(case, now, &seen, &expected).map_err(|e| format!("frame {frame}: {e}"))?;
        if rng.u8(..3) == 0 {
            tree = another_tree(case, &mut rng);
            subject
                .adopt(&tree, Generation(2 + frame))
                .map_err(plainly)?;
        }
        // Stages that nothing follows must not be taken for more than they were.
        for _ in 0..rng.u8(..3) {
            now = case.times[rng.usize(..3)];
            let pose = case.animation.pose(now);
            subject.interpolate(pose).map_err(plainly)?;
            if rng.bool() {
                subject.preprocess().map_err(plainly)?;
            }
            subject.submit().map_err(plainly)?;
        }
        if rng.bool() {
            now = case.times[rng.usize(..3)];
            stand(subject, &case.animation, now)?;
        }
        boxes_anew(subject)?;
    }
    Ok(())
}

/// Built or odd, with lists or without.
fn another_tree(case: &Case, rng: &mut fastrand::Rng) -> Topology {
    let animation = &case.animation;
    let built = tree_at(animation, case.times[rng.usize(..3)]);
    let parts = animation.static_parts();
    match rng.u8(..3) {
        0 => built,
        1 => sound(built.words().to_vec()),
        _ => {
            let leaves = live(animation, rng.u64(..));
            let words = record(
                animation.triangle_count(),
                &leaves,
                Split::Random,
                rng.u64(..),
            );
            sound(words).with_moving(parts)
        }
    }
}

/// A record without lists.
fn sound(words: Vec<u32>) -> Topology {
    Topology::from_words(words).expect("records made here are sound")
}

/// What a frame shows.
struct View {
    boxes: Vec<Aabb>,
    counts: [u64; 3],
    cost: Option<f64>,
    hits: Hits,
}

/// Traces what was recorded, and looks.
fn look(case: &Case, backend: &mut dyn Backend, now: f64) -> Result<View, String> {
    let rays = Rays::List(&case.rays);
    let ticket = start(backend, rays, QueryKind::Closest)?;
    let report = backend.wait(ticket).map_err(plainly)?;
    let mut hits = Hits::default();
    backend.hits(ticket, &mut hits).map_err(plainly)?;
    let expected = vertices(&case.animation, now);
    let positions = backend.inspect().positions().map_err(plainly)?;
    lists("position of vertex", &positions, &expected, same_point)?;
    Ok(View {
        boxes: backend.inspect().boxes().map_err(plainly)?,
        counts: [report.inactive, report.degenerate, report.hits],
        cost: report.sah_cost,
        hits,
    })
}

/// What a backend shows that has just got the scene, and the tree without lists.
fn whole(
    case: &Case,
    backend: &mut dyn Backend,
    (tree, now): (&Topology, f64),
) -> Result<View, String> {
    open(backend, &case.animation, now)?;
    let plain = sound(tree.words().to_vec());
    backend.adopt(&plain, Generation(2)).map_err(plainly)?;
    stand(backend, &case.animation, now)?;
    look(case, backend, now)
}

fn same(case: &Case, now: f64, seen: &View, expected: &View) -> Result<(), String> {
    lists("box of node", &seen.boxes, &expected.boxes, same_box)?;
    if seen.counts != expected.counts {
        let (seen, expected) = (seen.counts, expected.counts);
        return Err(format!(
            "inactive, degenerate, hits are {seen:?}, expected {expected:?}"
        ));
    }
    same_cost(case, seen, expected)?;
    let rays = Rays::List(&case.rays);
    answers(case, now, rays, &seen.hits, &expected.hits)
}

/// Costs agree, where there are any and areas neither overflow nor vanish in single precision.
fn same_cost(case: &Case, seen: &View, expected: &View) -> Result<(), String> {
    let (Some(seen), Some(expected)) = (seen.cost, expected.cost) else {
        return Ok(());
    };
    let ordinary = case.animation.scale_exponent() == 0;
    if ordinary && (seen / expected - 1.0).abs() > COST_TOLERANCE {
        return Err(format!("the tree's cost is {seen}, expected {expected}"));
    }
    Ok(())
}
