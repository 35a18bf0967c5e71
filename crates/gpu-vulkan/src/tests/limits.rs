//! Scenes and queries that the device cannot hold.

use super::scenes::{device, go, hits, open, rays, stand, swarm};
use crate::VulkanBackend;
use backend::{Backend, BackendError, Method, QueryKind, Rays};
use geom::Animation;
use std::sync::Arc;

/// Triangles of a scene that just outgrows a buffer: nodes take 64 bytes a triangle, and triangles may share corners.
fn too_many(backend: &VulkanBackend) -> u64 {
    backend.gpu.limits.buffer_bytes() / 64 + 2
}

/// Why a scene that outgrows a buffer is not for this machine's own memory.
pub(super) fn are_too_large(backend: &VulkanBackend) -> Option<String> {
    let triangles = too_many(backend);
    (triangles > 10_000_000).then(|| format!("it takes {triangles} triangles to outgrow a buffer"))
}

pub(super) fn a_scene_too_large_is_refused_with_both_numbers_and_a_small_one_still_goes() {
    let mut backend = device();
    let (triangles, limit) = (too_many(&backend), backend.gpu.limits.buffer_bytes());
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let list = vec![[0, 1, 2]; triangles as usize];
    let huge = Arc::new(Animation::new(vec![corners], list).unwrap());
    match backend.load(huge, Method::default()) {
        Err(BackendError::Limit {
            what,
            need,
            limit: found,
        }) => {
            assert!(what.contains("nodes"), "{what}");
            assert!(need > limit && found == limit, "{need} {found}");
        }
        other => panic!("{other:?}"),
    }
    let small = swarm(50);
    open(&mut *backend, &small);
    stand(&mut *backend, &small, 0.5);
    let ticket = go(&mut *backend, Rays::List(&rays(8)), QueryKind::Closest);
    assert_eq!(hits(&mut *backend, ticket).closest.len(), 8);
}

pub(super) fn a_query_too_large_is_refused_and_a_smaller_one_may_follow_at_once() {
    let mut backend = device();
    let limit = backend.gpu.limits.buffer_bytes();
    let animation = swarm(50);
    open(&mut *backend, &animation);
    stand(&mut *backend, &animation, 0.5);
    // Hits take 16 bytes a pixel.
    let (eye, up) = ([0.3, 0.2, 3.0], [0.0, 1.0, 0.0]);
    let side = ((limit / 16) as f64).sqrt() as u32 + 1;
    let camera = geom::Camera::look_at(eye, [0.0; 3], up, 50.0, [side, side]).unwrap();
    let query = backend::Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::Closest,
    };
    let refused = backend.trace(query);
    assert!(
        matches!(refused, Err(BackendError::Limit { need, .. }) if need > limit),
        "{refused:?}"
    );
    let ticket = go(&mut *backend, Rays::List(&rays(8)), QueryKind::Closest);
    assert_eq!(hits(&mut *backend, ticket).closest.len(), 8);
}
