//! The few sentences in which laws are written.

use backend::{Backend, BackendError, Generation, Hits, Method, Query, Rays, Seek};
use bvh_build::{BinaryTree, Builder, Cancel};
use bvh_layout::{Converter, Topology};
use geom::{Animation, Point};
use std::sync::Arc;

/// What a law says when the subject cannot even be asked.
pub(crate) fn plainly(e: BackendError) -> String {
    format!("the backend failed: {e}")
}

/// The vertices at a time, by the one formula there is.
pub(crate) fn vertices(animation: &Animation, time: f64) -> Vec<Point> {
    let pose = animation.pose(time);
    (0..animation.vertex_count() as u32)
        .map(|v| animation.vertex(pose, v))
        .collect()
}

/// A tree built for the scene as it stands at `time`.
pub(crate) fn tree_at(animation: &Animation, time: f64) -> Topology {
    let vertices = vertices(animation, time);
    let mut tree = BinaryTree::default();
    let boxes = (animation, vertices.as_slice());
    Builder::new()
        .build(&boxes, &Cancel::new(), &mut tree)
        .expect("nobody cancels");
    Converter::new().convert(&tree, animation.triangle_count(), Vec::new())
}

/// Loads the scene and adopts a first tree, built at `time`.
pub(crate) fn open(
    backend: &mut dyn Backend,
    animation: &Arc<Animation>,
    time: f64,
) -> Result<(), String> {
    backend
        .load(Arc::clone(animation), Method::default())
        .map_err(plainly)?;
    backend
        .adopt(&tree_at(animation, time), Generation(1))
        .map_err(plainly)
}

/// Records everything up to the boxes at `time`.
pub(crate) fn stand(
    backend: &mut dyn Backend,
    animation: &Animation,
    time: f64,
) -> Result<(), String> {
    backend.interpolate(animation.pose(time)).map_err(plainly)?;
    boxes_anew(backend)
}

/// Records the boxes after a change of tree.
pub(crate) fn boxes_anew(backend: &mut dyn Backend) -> Result<(), String> {
    backend.preprocess().map_err(plainly)?;
    backend.refit().map_err(plainly)
}

/// Traces and fetches.
pub(crate) fn ask(backend: &mut dyn Backend, rays: Rays<'_>, seek: Seek) -> Result<Hits, String> {
    backend.trace(Query { rays, seek }).map_err(plainly)?;
    let ticket = backend.submit().map_err(plainly)?;
    let mut hits = Hits::default();
    backend.wait(ticket).map_err(plainly)?;
    backend.hits(ticket, &mut hits).map_err(plainly)?;
    Ok(hits)
}
