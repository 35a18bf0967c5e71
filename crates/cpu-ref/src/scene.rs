//! What is current: an animation, a tree, and everything computed from them.

use crate::exact::Exact;
use crate::interpolate::{copy, interpolate, interpolate_moving};
use crate::moller_trumbore::MollerTrumbore;
use crate::moving::MovingNodes;
use crate::nodes::Nodes;
use crate::preprocess::{Geometry, Unhittable, preprocess, preprocess_moving};
use crate::refit::{refit, refit_moving};
use crate::reserve;
use crate::scale::Scale;
use crate::simd::Level;
use crate::trace::{Counts, Tracer};
use crate::traverse::TraversedTree;
use crate::triangle_test::{Record, TriangleTest};
use crate::watertight::Watertight;
use crate::wide::{Wide, WideTracer};
use crate::woop::Woop;
use backend::{BackendError, Intersector, Layout, Method, Rays, Result, check_tree};
use bvh_build::MAX_DEPTH;
use bvh_layout::Topology;
use geom::{Aabb, Animation, Camera, Hit, Point, Pose, StaticParts};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// Static vertices between two runs of moving ones: fewer are written again, for a run costs more.
const GAP: usize = 64;

/// An animation with its tree and the state of one moment.
pub(crate) struct SceneState {
    animation: Arc<Animation>,
    intersector: Intersector,
    scale: Scale,
    /// Of the moment that was interpolated last.
    range: geom::Range,
    positions: Vec<Point>,
    /// Runs of vertices that hold all that move; `None` where static ones are too few to be passed over.
    runs: Option<Vec<Range<usize>>>,
    /// What of the tree moves; `None` likewise.
    moving: Option<MovingNodes>,
    /// Whether every leaf of the tree was preprocessed since it was adopted.
    leaves_done: bool,
    /// Half areas of nodes beside which nothing moves, once every box of the tree was refitted.
    still_areas: Option<f64>,
    nodes: Nodes,
    records: Vec<Record>,
    /// In the place of nodes and records if the layout is `fast`.
    wide: Option<Wide>,
    sums: Vec<f64>,
    /// As of the last preprocess, triangles without a leaf included.
    pub(crate) unhittable: Unhittable,
    /// As of the last refit.
    pub(crate) sah_cost: Option<f64>,
    settled: AtomicU64,
}

/// Calls a method for the intersector that `$intersector` names; `$exact` stands in for the exact one.
macro_rules! with_test {
    ($intersector:expr, $exact:ty, $object:expr, $method:ident ( $($argument:expr),* )) => {
        match $intersector {
            Intersector::MollerTrumbore => $object.$method::<MollerTrumbore>($($argument),*),
            Intersector::Woop => $object.$method::<Woop>($($argument),*),
            Intersector::Exact => $object.$method::<$exact>($($argument),*),
            _ => $object.$method::<Watertight>($($argument),*),
        }
    };
}

/// Calls a method of the tracer that the layout and the intersector ask for.
macro_rules! with_tracer {
    ($scene:expr, $rays:expr, $method:ident ( $($argument:expr),* )) => {{
        let (scene, rays) = ($scene, $rays);
        match &scene.wide {
            Some(tree) if scene.intersector == Intersector::Watertight && !scene.is_extreme(rays) => {
                let (geometry, settled) = (scene.geometry(), &scene.settled);
                WideTracer { rays, tree, geometry, settled }.$method($($argument),*)
            }
            Some(tree) => {
                with_test!(scene.intersector, Exact, scene.tracer(rays, tree), $method($($argument),*))
            }
            None => {
                let tree = scene.target();
                with_test!(scene.intersector, Exact, scene.tracer(rays, tree), $method($($argument),*))
            }
        }
    }};
}

impl SceneState {
    /// # Errors
    /// Memory does not suffice.
    pub(crate) fn new(animation: Arc<Animation>, method: Method, level: Level) -> Result<Self> {
        let mut positions = Vec::new();
        reserve(&mut positions, animation.vertex_count(), "positions")?;
        positions.resize(animation.vertex_count(), [0.0; 3]);
        // Static vertices stand from the start.
        copy(&animation.keys()[0], &mut positions);
        let parts = animation.static_parts();
        let (still, all) = (parts.vertex_count(), animation.vertex_count());
        let runs = StaticParts::pays(all - still, all).then(|| parts.moving_runs(GAP));
        Ok(Self {
            scale: Scale::of(&animation),
            range: geom::Range::ORDINARY,
            animation,
            intersector: method.intersector,
            positions,
            runs,
            moving: None,
            leaves_done: false,
            still_areas: None,
            nodes: Nodes::default(),
            records: Vec::new(),
            wide: (method.layout == Layout::Fast).then(|| Wide::new(level)),
            sums: Vec::new(),
            unhittable: Unhittable::default(),
            sah_cost: None,
            settled: AtomicU64::new(0),
        })
    }

    /// # Errors
    /// The tree is not one of this scene, or memory does not suffice.
    pub(crate) fn adopt(&mut self, tree: &Topology) -> Result<()> {
        check_tree(tree, &self.animation)?;
        if tree.level_count() > MAX_DEPTH as usize + 1 {
            let (levels, limit) = (tree.level_count(), MAX_DEPTH + 1);
            let why = format!("it has {levels} levels, the limit is {limit}");
            return Err(BackendError::WrongTree(why));
        }
        if let Some(wide) = &mut self.wide {
            let animation = &self.animation;
            return wide.adopt(tree, animation.triangles(), animation.static_parts());
        }
        let leaves = tree.leaf_count();
        reserve(&mut self.nodes.pairs, leaves + 1, "nodes")?;
        reserve(&mut self.nodes.triangles, leaves, "leaves")?;
        reserve(&mut self.nodes.leaves, leaves, "leaves")?;
        reserve(&mut self.records, leaves, "triangle records")?;
        self.nodes.expand(tree, self.animation.triangles());
        self.records.resize(leaves, Record::default());
        (self.leaves_done, self.still_areas) = (false, None);
        let mut lists = self.moving.take().unwrap_or_default();
        self.moving = tree.moving().map(|moving| {
            lists.fill(moving);
            lists
        });
        Ok(())
    }

    /// Whether trees are used in their eight-wide form.
    pub(crate) fn is_wide(&self) -> bool {
        self.wide.is_some()
    }

    pub(crate) fn interpolate(&mut self, pose: Pose) {
        self.range = self.animation.range(pose);
        let to = &mut self.positions;
        match &self.runs {
            Some(runs) => interpolate_moving(&self.animation, pose, (runs, to)),
            None => interpolate(&self.animation, pose, to),
        }
    }

    pub(crate) fn preprocess(&mut self) {
        // The exact test filters by the watertight test's numbers.
        with_test!(self.intersector, Watertight, self, preprocess_for());
    }

    fn preprocess_for<T: TriangleTest>(&mut self) {
        let geometry = Geometry {
            positions: &self.positions,
            triangles: self.animation.triangles(),
            scale: self.scale,
            range: self.range,
        };
        let without_leaf = self.animation.triangle_count() - self.animation.live_count();
        self.unhittable = match (&mut self.wide, &self.moving) {
            (Some(wide), _) => {
                let unhittable = wide.preprocess(geometry);
                match self.intersector {
                    Intersector::Woop | Intersector::MollerTrumbore => wide.make_records::<T>(),
                    Intersector::Watertight | Intersector::Exact => {}
                }
                unhittable
            }
            (None, Some(moving)) if self.leaves_done => {
                let chosen = (&moving.leaves[..], &mut self.records[..]);
                let mut found = preprocess_moving::<T>(geometry, &mut self.nodes, chosen);
                // A static triangle with a leaf is active.
                found.degenerate += self.animation.static_parts().degenerate.len() as u64;
                found
            }
            (None, _) => preprocess::<T>(geometry, &mut self.nodes, &mut self.records),
        };
        self.leaves_done = true;
        self.unhittable.inactive += without_leaf as u64;
    }

    /// Brings boxes up to date, and the tree's cost by the surface area heuristic:
    /// the sum of all nodes' areas over the root's (MacDonald, Booth 1990); `None` if the root has no area.
    pub(crate) fn refit(&mut self) {
        let nodes = &mut self.nodes;
        let total = match (&mut self.wide, &self.moving, self.still_areas) {
            (Some(wide), ..) => wide.refit(),
            (None, Some(moving), Some(still)) => still + refit_moving(nodes, moving),
            (None, Some(moving), None) => {
                let total = refit(nodes, &mut self.sums);
                self.still_areas = Some(total - refit_moving(nodes, moving));
                total
            }
            (None, None, _) => refit(nodes, &mut self.sums),
        };
        let root = self.root().half_area();
        self.sah_cost = (root > 0.0).then(|| total / root);
    }

    /// The box of the whole tree, in scaled units.
    fn root(&self) -> Aabb {
        match &self.wide {
            Some(wide) => wide.root,
            None => self.nodes.root(),
        }
    }

    /// See [`Tracer::closest`].
    pub(crate) fn closest(&self, rays: Rays<'_>, out: &mut [Hit]) -> Counts {
        with_tracer!(self, rays, closest(out))
    }

    /// See [`Tracer::any`].
    pub(crate) fn any(&self, rays: Rays<'_>, out: &mut [u8]) -> Counts {
        with_tracer!(self, rays, any(out))
    }

    /// See [`Tracer::closest_and_shadow`].
    pub(crate) fn closest_and_shadow(
        &self,
        rays: Rays<'_>,
        light: Point,
        out: (&mut [Hit], &mut [u8]),
    ) -> Counts {
        with_tracer!(self, rays, closest_and_shadow(light, out))
    }

    /// Boxes and records, to trace through.
    pub(crate) fn target(&self) -> TraversedTree<'_> {
        TraversedTree {
            nodes: &self.nodes,
            records: &self.records,
        }
    }

    /// Whether all of these rays are beyond what rounded tests can tell.
    fn is_extreme(&self, rays: Rays<'_>) -> bool {
        let by_eye = |camera: &Camera| self.range.is_extreme(self.scale.apply(camera.eye));
        self.range.extreme || matches!(rays, Rays::Camera(camera) if by_eye(camera))
    }

    fn tracer<'a, N>(&'a self, rays: Rays<'a>, tree: N) -> Tracer<'a, N> {
        Tracer {
            rays,
            tree,
            geometry: self.geometry(),
            settled: &self.settled,
        }
    }

    fn geometry(&self) -> Geometry<'_> {
        Geometry {
            positions: &self.positions,
            triangles: self.animation.triangles(),
            scale: self.scale,
            range: self.range,
        }
    }

    /// Rays that exact arithmetic settled since it was last asked.
    pub(crate) fn take_settled(&mut self) -> u64 {
        std::mem::take(self.settled.get_mut())
    }

    pub(crate) fn positions(&self) -> &[Point] {
        &self.positions
    }

    /// Boxes in node order, in the scene's units.
    pub(crate) fn boxes(&self) -> Vec<Aabb> {
        let undo = |b: Aabb| self.scale.undo(b);
        match &self.wide {
            None => self.nodes.boxes().map(undo).collect(),
            Some(wide) => self.binary_nodes(wide).boxes().map(undo).collect(),
        }
    }

    /// The binary tree that a wide one stands for, with the boxes that it would have.
    fn binary_nodes(&self, wide: &Wide) -> Nodes {
        let (mut nodes, mut records) = (Nodes::default(), Vec::new());
        nodes.expand(&wide.binary, self.animation.triangles());
        records.resize(wide.binary.leaf_count(), Record::default());
        preprocess::<Watertight>(self.geometry(), &mut nodes, &mut records);
        refit(&mut nodes, &mut Vec::new());
        nodes
    }
}
