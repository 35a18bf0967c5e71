//! What a correct caller cannot foresee is an error; misuse panics.

use crate::CpuBackend;
use crate::testing::{moving, senseless_tree, soup, still, trace, tree_at, tree_over};
use backend::{Backend, BackendError, Generation, Intersector, QueryKind, Rays, Ticket};
use geom::{Aabb, Ray};

#[test]
fn what_cannot_be_done_is_refused() {
    assert!(CpuBackend::new(Some(0)).is_err());
}

#[test]
fn a_tree_of_another_scene_is_refused_and_the_old_one_kept() {
    let animation = moving();
    let mut backend = still(&animation, Intersector::Watertight);
    let n = animation.triangle_count() as u32;
    let boxes_without = |left_out: u32| -> Vec<Aabb> {
        let at = |i| {
            if i == left_out {
                Aabb::EMPTY
            } else {
                Aabb {
                    min: [i as f32; 3],
                    max: [i as f32; 3],
                }
            }
        };
        (0..n).map(at).collect()
    };
    let another = soup(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
    let wrong = [
        // The triangle that never is has a leaf, in place of one that is.
        (tree_over(boxes_without(0).as_slice()), "never active"),
        (tree_over(boxes_without(n).as_slice()), "leaves"),
        (tree_at(&another, another.pose(0.0)), "triangles"),
    ];
    for (tree, why) in wrong {
        let error = backend.adopt(&tree, Generation(9)).unwrap_err();
        assert!(matches!(&error, BackendError::WrongTree(_)), "{error}");
        assert!(error.to_string().contains(why), "{error}");
    }
    let ray = Ray::new([0.0, 0.0, 9.0], [0.0, 0.0, -1.0]);
    assert!(trace(&mut backend, Rays::List(&[ray]), QueryKind::Closest).closest[0].is_hit());
    backend
        .adopt(&senseless_tree(&animation), Generation(2))
        .unwrap();
}

#[test]
#[should_panic(expected = "the tree is stale")]
fn a_tree_adopted_and_not_refitted_is_not_traced() {
    let animation = moving();
    let mut backend = still(&animation, Intersector::Watertight);
    backend
        .adopt(&senseless_tree(&animation), Generation(2))
        .unwrap();
    trace(&mut backend, Rays::List(&[]), QueryKind::Closest);
}

#[test]
#[should_panic(expected = "the tree is stale")]
fn positions_that_moved_are_not_traced_with_the_old_boxes() {
    let animation = moving();
    let mut backend = still(&animation, Intersector::Watertight);
    backend.interpolate(animation.pose(1.0)).unwrap();
    trace(&mut backend, Rays::List(&[]), QueryKind::Closest);
}

#[test]
#[should_panic(expected = "the tree is stale")]
fn leaves_that_moved_are_not_traced_before_a_refit() {
    let animation = moving();
    let mut backend = still(&animation, Intersector::Watertight);
    backend.preprocess().unwrap();
    trace(&mut backend, Rays::List(&[]), QueryKind::Closest);
}

#[test]
#[should_panic(expected = "generations rise")]
fn generations_do_not_fall() {
    let animation = moving();
    let mut backend = still(&animation, Intersector::Watertight);
    let _ = backend.adopt(&senseless_tree(&animation), Generation(1));
}

#[test]
#[should_panic(expected = "never given")]
fn a_ticket_never_given_is_misuse() {
    let animation = moving();
    let _ = still(&animation, Intersector::Watertight).wait(Ticket(77));
}
