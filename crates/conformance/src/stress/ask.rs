//! The few sentences in which a backend is asked.

use crate::stress::scenes::Scene;
use backend::{Backend, FrameReport, Generation, Hits, Method, Query, QueryKind, Rays, Result};
use bvh_build::{BinaryTree, Builder, Cancel};
use bvh_layout::{Converter, Topology};
use geom::{Animation, Ray};
use std::sync::Arc;

/// A tree built for the scene as it stands at `time`.
fn tree_at(animation: &Animation, time: f64) -> Topology {
    let pose = animation.pose(time);
    let all = 0..animation.vertex_count() as u32;
    let vertices: Vec<_> = all.map(|v| animation.vertex(pose, v)).collect();
    let mut tree = BinaryTree::default();
    Builder::new()
        .build(&(animation, vertices.as_slice()), &Cancel::new(), &mut tree)
        .expect("nobody cancels");
    Converter::new().convert(&tree, animation.triangle_count(), Vec::new())
}

/// Loads a scene, with a tree built at `built`, and stands it up at its own time.
pub(crate) fn stand(
    subject: &mut dyn Backend,
    scene: &Scene,
    method: Method,
    built: f64,
) -> Result<()> {
    let animation = &scene.animation;
    subject.load(Arc::clone(animation), method)?;
    subject.adopt(&tree_at(animation, built), Generation(1))?;
    subject.interpolate(animation.pose(scene.time))?;
    subject.preprocess()?;
    subject.refit()
}

/// What rays hit first in the scene that stands.
pub(crate) fn trace(subject: &mut dyn Backend, rays: &[Ray]) -> Result<(Hits, FrameReport)> {
    kind(subject, rays, QueryKind::Closest)
}

/// What rays find in the scene that stands.
pub(crate) fn kind(
    subject: &mut dyn Backend,
    rays: &[Ray],
    kind: QueryKind,
) -> Result<(Hits, FrameReport)> {
    let rays = Rays::List(rays);
    subject.trace(Query { rays, kind })?;
    let ticket = subject.submit()?;
    let report = subject.wait(ticket)?;
    let mut hits = Hits::default();
    subject.hits(ticket, &mut hits)?;
    Ok((hits, report))
}
