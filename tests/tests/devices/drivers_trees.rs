//! The driver's own trees, beside what their laws say (`tests/backends.rs`).

use crate::scenes::{SHADOWED, camera, go, swarm, tree_at};
use backend::{Backend, Generation, Method, Rays};
use gpu_vulkan::{Options, Validation};
use gpu_vulkan_rt::{DriverTreeBackend, Prefer};
use std::sync::Arc;

pub(crate) fn the_drivers_work_is_timed_and_trees_of_others_are_refused() {
    let options = Options {
        validation: Validation::IfInstalled,
        ..Options::default()
    };
    let mut subject = DriverTreeBackend::new(&options, Prefer::FastBuild).unwrap();
    let animation = swarm(300);
    let method = Method::default();
    subject.load(Arc::clone(&animation), method).unwrap();
    subject.interpolate(animation.pose(0.0)).unwrap();
    subject.rebuild(Generation(1)).unwrap();
    subject.refit().unwrap();
    let ticket = go(&mut subject, Rays::Camera(&camera()), SHADOWED);
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
    let refused = subject.adopt(&tree_at(&animation, 0.0), Generation(2));
    let said = refused.unwrap_err().to_string();
    assert_eq!(said, "vulkan-rt does not support trees made by others");
    assert!(subject.makes_own_trees() && subject.inspect().boxes().is_err());
    assert_eq!(subject.gpu().validation_messages(), [""; 0]);
}
