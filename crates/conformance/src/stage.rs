//! The few steps of which every question to a backend is made.

use anyhow::bail;
use backend::{
    Backend, FrameReport, Generation, Hits, Method, Query, QueryKind, Rays, Result, Snapshot,
    Ticket,
};
use bvh_build::{BinaryTree, Builder, Cancel};
use bvh_layout::{Converter, Spare, Topology};
use geom::{Animation, Point, Triangle};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Of all scenes here.
const HELD: &str = "key frames are held";

/// How long a copy of positions may take, its submission being done.
const TIME_LIMIT: Duration = Duration::from_secs(30);

/// The vertices at a time, by the one formula there is.
pub fn vertices(animation: &Animation, time: f64) -> Vec<Point> {
    let moment = animation.at(time).expect(HELD);
    let all = 0..animation.vertex_count() as u32;
    all.map(|v| moment.vertex(v)).collect()
}

/// The triangles at a time.
pub fn triangles(animation: &Animation, time: f64) -> Vec<Triangle> {
    let moment = animation.at(time).expect(HELD);
    let all = 0..animation.triangle_count() as u32;
    all.map(|t| moment.corners(t)).collect()
}

/// Whether a ray from `origin` is answered in exact arithmetic at a time, whatever the backend: see [`geom::Range`].
pub(crate) fn is_extreme(animation: &Animation, time: f64, origin: Point) -> bool {
    let unit = f64::from(-animation.scale_exponent()).exp2();
    let scaled = origin.map(|x| (f64::from(x) * unit) as f32);
    animation.range(animation.pose(time)).is_extreme(scaled)
}

/// A tree over these vertices, with lists of what moves where they pay.
pub fn tree_over(animation: &Animation, vertices: &[Point]) -> Topology {
    let mut tree = BinaryTree::default();
    let built = Builder::default().build(&(animation, vertices), &Cancel::new(), &mut tree);
    built.expect("nobody cancels");
    let record = Converter::default().convert(&tree, animation.triangle_count(), Spare::default());
    record.with_moving(animation.static_parts())
}

/// Likewise, for the scene as it stands at `time`.
pub fn tree_at(animation: &Animation, time: f64) -> Topology {
    tree_over(animation, &vertices(animation, time))
}

/// Loads the scene and adopts a first tree, built at `time`.
pub(crate) fn open(
    backend: &mut dyn Backend,
    animation: &Arc<Animation>,
    time: f64,
    method: Method,
) -> Result<()> {
    backend.load(Arc::clone(animation), method)?;
    backend.adopt(&tree_at(animation, time), Generation(1))
}

/// Records everything up to the boxes at `time`.
///
/// # Errors
/// The backend failed; likewise below.
pub fn stand(backend: &mut dyn Backend, animation: &Animation, time: f64) -> Result<()> {
    backend.interpolate(animation.pose(time))?;
    boxes_anew(backend)
}

/// Records the boxes after a change of tree.
pub(crate) fn boxes_anew(backend: &mut dyn Backend) -> Result<()> {
    backend.preprocess()?;
    backend.refit()
}

/// Records a trace and starts it.
pub fn start(backend: &mut dyn Backend, rays: Rays<'_>, kind: QueryKind) -> Result<Ticket> {
    backend.trace(Query { rays, kind })?;
    backend.submit()
}

/// Fetches what a trace found, and what the backend reports of it.
pub(crate) fn fetch(backend: &mut dyn Backend, ticket: Ticket) -> Result<(Hits, FrameReport)> {
    let report = backend.wait(ticket)?;
    Ok((backend.hits(ticket)?.clone(), report))
}

/// Traces and fetches.
pub fn ask(
    backend: &mut dyn Backend,
    rays: Rays<'_>,
    kind: QueryKind,
) -> Result<(Hits, FrameReport)> {
    let ticket = start(backend, rays, kind)?;
    fetch(backend, ticket)
}

/// Waits for the oldest positions that were requested.
///
/// # Errors
/// As above, or they do not come.
pub fn next_positions(backend: &mut dyn Backend) -> anyhow::Result<(Ticket, Snapshot)> {
    let begun = Instant::now();
    while begun.elapsed() < TIME_LIMIT {
        if let Some(arrived) = backend.take_positions()? {
            return Ok(arrived);
        }
        std::thread::yield_now();
    }
    bail!("no positions came in {TIME_LIMIT:?}")
}
