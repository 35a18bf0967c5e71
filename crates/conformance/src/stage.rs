//! The few sentences in which laws are written.

use backend::{
    Backend, BackendError, Generation, Hits, Intersector, Layout, Method, Query, QueryKind, Rays,
    Ticket,
};
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

/// A tree built for the scene as it stands at `time`, with lists of what moves where they pay.
pub(crate) fn tree_at(animation: &Animation, time: f64) -> Topology {
    let vertices = vertices(animation, time);
    let mut tree = BinaryTree::default();
    let boxes = (animation, vertices.as_slice());
    Builder::new()
        .build(&boxes, &Cancel::new(), &mut tree)
        .expect("nobody cancels");
    Converter::new()
        .convert(&tree, animation.triangle_count(), Vec::new())
        .with_moving(animation.static_parts())
}

/// Loads the scene and adopts a first tree, built at `time`, unless the backend makes its own.
pub(crate) fn open(
    backend: &mut dyn Backend,
    animation: &Arc<Animation>,
    time: f64,
) -> Result<(), String> {
    open_with(backend, animation, time, Method::default()).map_err(plainly)
}

/// Likewise, by another method than usual.
pub(crate) fn open_with(
    backend: &mut dyn Backend,
    animation: &Arc<Animation>,
    time: f64,
    method: Method,
) -> backend::Result<()> {
    backend.load(Arc::clone(animation), method)?;
    if backend.makes_own_trees() {
        return Ok(());
    }
    backend.adopt(&tree_at(animation, time), Generation(1))
}

/// Every method by which the backend traces.
pub(crate) fn methods(backend: &dyn Backend) -> Result<Vec<Method>, String> {
    let with = |intersector| {
        Layout::ALL.map(|layout| Method {
            intersector,
            layout,
        })
    };
    let all = Intersector::ALL.into_iter().flat_map(with);
    let methods: Vec<Method> = all.filter(|&m| backend.supports(m)).collect();
    if methods.contains(&Method::default()) {
        return Ok(methods);
    }
    Err("the backend does not support the usual method".to_owned())
}

/// The subject's methods whose answers are the same everywhere, each with the reference's that gives them.
pub(crate) fn robust_methods(
    [subject, reference]: [&dyn Backend; 2],
) -> Result<Vec<[Method; 2]>, String> {
    let known = methods(reference)?;
    let robust = |m: &Method| matches!(m.intersector, Intersector::Watertight | Intersector::Exact);
    let pair = |method: Method| {
        let layout = Layout::Bvh2;
        let usual = Method { layout, ..method };
        known.contains(&usual).then_some([method, usual])
    };
    let all = methods(subject)?;
    Ok(all.into_iter().filter(robust).filter_map(pair).collect())
}

/// Records everything up to the boxes at `time`; a backend that makes its own trees makes one.
pub(crate) fn stand(
    backend: &mut dyn Backend,
    animation: &Animation,
    time: f64,
) -> Result<(), String> {
    backend.interpolate(animation.pose(time)).map_err(plainly)?;
    if backend.makes_own_trees() {
        backend.rebuild(Generation(1)).map_err(plainly)?;
    }
    boxes_anew(backend)
}

/// Likewise, with the last tree whoever made it.
pub(crate) fn stand_on(
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

/// Records a trace and starts it.
pub(crate) fn start(
    backend: &mut dyn Backend,
    rays: Rays<'_>,
    kind: QueryKind,
) -> Result<Ticket, String> {
    backend.trace(Query { rays, kind }).map_err(plainly)?;
    backend.submit().map_err(plainly)
}

/// Fetches what a trace found.
pub(crate) fn fetch(backend: &mut dyn Backend, ticket: Ticket) -> Result<Hits, String> {
    let mut hits = Hits::default();
    backend.wait(ticket).map_err(plainly)?;
    backend.hits(ticket, &mut hits).map_err(plainly)?;
    Ok(hits)
}

/// Traces and fetches.
pub(crate) fn ask(
    backend: &mut dyn Backend,
    rays: Rays<'_>,
    kind: QueryKind,
) -> Result<Hits, String> {
    let ticket = start(backend, rays, kind)?;
    fetch(backend, ticket)
}
