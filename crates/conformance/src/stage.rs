//! Functions that load a scene into a backend, compute its boxes and trace queries.

use anyhow::bail;
use backend::{
    Backend, FrameReport, Generation, Hits, Intersector, Query, QueryKind, Rays, Result, Snapshot,
    Ticket,
};
use bvh_build::{AnimationBoxes, BinaryTree, Cancel, SahBuilder};
use bvh_layout::Topology;
use geom::{Animation, Point, Triangle};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The key frames that these functions read are always in memory.
const IN_MEMORY: &str = "key frames are in memory";

/// Maximum time that [`next_positions`] waits for a copy of positions.
const TIME_LIMIT: Duration = Duration::from_secs(30);

/// Returns the vertices at `time`, by the blend formula of `geom`.
pub fn vertices(animation: &Animation, time: f64) -> Vec<Point> {
    let moment = animation.at(time).expect(IN_MEMORY);
    let all = 0..animation.vertex_count() as u32;
    all.map(|v| moment.vertex(v)).collect()
}

/// Returns the triangles at `time`.
pub fn triangles(animation: &Animation, time: f64) -> Vec<Triangle> {
    let moment = animation.at(time).expect(IN_MEMORY);
    let all = 0..animation.triangle_count() as u32;
    all.map(|t| moment.corners(t)).collect()
}

/// Returns a static animation of the scene at time 0 and one more triangle.
pub(crate) fn with_triangle(animation: &Animation, corners: Triangle) -> Animation {
    let mut points = vertices(animation, 0.0);
    let mut triangles = animation.triangles().to_vec();
    let first = points.len() as u32;
    points.extend(corners);
    triangles.push([first, first + 1, first + 2]);
    let animation = Animation::new(vec![points], triangles);
    animation.expect("triangles use only vertices of the scene")
}

/// Returns whether, with `watertight` and `exact`, every backend must test a ray from `origin` at `time` in exact
/// arithmetic: see [`geom::CoordinateRange`].
///
/// Backends trace in *scaled units* of `2^k` scene units, where `k` is [`Animation::scale_exponent`]. A scene is scaled
/// if `k` is not 0.
pub(crate) fn is_extreme(animation: &Animation, time: f64, origin: Point) -> bool {
    let unit = f64::from(-animation.scale_exponent()).exp2();
    let scaled = origin.map(|x| (f64::from(x) * unit) as f32);
    animation.range(animation.pose(time)).is_extreme(scaled)
}

/// Builds a tree over these vertices.
///
/// The topology has treelets, and lists of the treelets that contain moving triangles unless more than half of all do
/// ([`Topology::with_moving`]).
pub fn tree_over(animation: &Animation, vertices: &[Point]) -> Topology {
    let mut tree = BinaryTree::default();
    let boxes = AnimationBoxes {
        animation,
        vertices,
    };
    let built = SahBuilder::default().build(&boxes, &Cancel::new(), &mut tree);
    built.expect("the build is not cancelled");
    let topology = Topology::new(Arc::new(tree), animation.triangle_count());
    topology.with_moving(animation.static_parts())
}

/// Builds a tree over the scene at `time`: see [`tree_over`].
pub fn tree_at(animation: &Animation, time: f64) -> Topology {
    tree_over(animation, &vertices(animation, time))
}

/// Loads the scene and adopts a first tree, built at `time`.
///
/// # Errors
/// The backend failed.
pub fn open(
    backend: &mut dyn Backend,
    animation: &Arc<Animation>,
    time: f64,
    intersector: Intersector,
) -> Result<()> {
    backend.load(Arc::clone(animation), intersector)?;
    backend.adopt(&tree_at(animation, time), Generation(1))
}

/// Records `interpolate`, `preprocess` and `refit` at `time`, so that rays can be traced.
///
/// # Errors
/// The backend failed.
pub fn interpolate_and_refit(
    backend: &mut dyn Backend,
    animation: &Animation,
    time: f64,
) -> Result<()> {
    backend.interpolate(animation.pose(time))?;
    preprocess_and_refit(backend)
}

/// Records `preprocess` and `refit`, for new positions or a new tree.
pub(crate) fn preprocess_and_refit(backend: &mut dyn Backend) -> Result<()> {
    backend.preprocess()?;
    backend.refit()
}

/// Records a trace and submits it.
///
/// # Errors
/// The backend failed.
pub fn start(backend: &mut dyn Backend, rays: Rays<'_>, kind: QueryKind) -> Result<Ticket> {
    backend.trace(&[Query { rays, kind }])?;
    backend.submit()
}

/// Results of a trace.
#[derive(Clone, Debug, Default)]
pub struct Traced {
    /// Its hits.
    pub hits: Hits,
    /// Report of its submission.
    pub report: FrameReport,
}

/// Waits for the trace of one query. Returns its hits and report.
pub(crate) fn fetch(backend: &mut dyn Backend, ticket: Ticket) -> Result<Traced> {
    let report = backend.wait(ticket)?;
    let mut hits = Hits::default();
    backend.take_hits(ticket, 0, &mut hits)?;
    Ok(Traced { hits, report })
}

/// Traces rays, and waits for the results.
///
/// # Errors
/// The backend failed.
pub fn trace_and_wait(
    backend: &mut dyn Backend,
    rays: Rays<'_>,
    kind: QueryKind,
) -> Result<Traced> {
    let ticket = start(backend, rays, kind)?;
    fetch(backend, ticket)
}

/// Waits for the oldest requested positions.
///
/// # Errors
/// The backend failed, or no positions arrived in time.
pub fn next_positions(backend: &mut dyn Backend) -> anyhow::Result<(Ticket, Snapshot)> {
    let begun = Instant::now();
    while begun.elapsed() < TIME_LIMIT {
        if let Some(arrived) = backend.take_positions()? {
            return Ok(arrived);
        }
        std::thread::yield_now();
    }
    bail!("no positions arrived within {TIME_LIMIT:?}")
}
