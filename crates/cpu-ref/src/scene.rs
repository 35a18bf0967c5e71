//! What is current: an animation, a tree, and everything computed from them.

use crate::exact::Exact;
use crate::interpolate::interpolate;
use crate::moller_trumbore::MollerTrumbore;
use crate::nodes::Nodes;
use crate::preprocess::{Geometry, Unhittable, preprocess};
use crate::refit::refit;
use crate::scale::Scale;
use crate::trace::Tracer;
use crate::traverse::Target;
use crate::triangle_test::{Record, TriangleTest};
use crate::watertight::Watertight;
use crate::woop::Woop;
use crate::{NAME, reserve};
use backend::{BackendError, Intersector, Layout, Method, Rays, Result, check_tree};
use bvh_build::MAX_DEPTH;
use bvh_layout::Topology;
use geom::{Aabb, Animation, Hit, Point, Pose};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// An animation with its tree and the state of one moment.
pub(crate) struct Scene {
    animation: Arc<Animation>,
    intersector: Intersector,
    scale: Scale,
    positions: Vec<Point>,
    nodes: Nodes,
    records: Vec<Record>,
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

impl Scene {
    /// # Errors
    /// The method is not supported, or memory does not suffice.
    pub(crate) fn new(animation: Arc<Animation>, method: Method) -> Result<Self> {
        let unsupported = |what: String| BackendError::Unsupported {
            backend: NAME,
            what,
        };
        if method.layout != Layout::Bvh2 {
            return Err(unsupported(format!("layout '{}'", method.layout)));
        }
        let mut positions = Vec::new();
        reserve(&mut positions, animation.vertex_count(), "positions")?;
        positions.resize(animation.vertex_count(), [0.0; 3]);
        Ok(Self {
            scale: Scale::of(&animation),
            animation,
            intersector: method.intersector,
            positions,
            nodes: Nodes::default(),
            records: Vec::new(),
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
        let leaves = tree.leaf_count();
        reserve(&mut self.nodes.pairs, leaves + 1, "nodes")?;
        reserve(&mut self.nodes.triangles, leaves, "leaves")?;
        reserve(&mut self.nodes.leaves, leaves, "leaves")?;
        reserve(&mut self.records, leaves, "triangle records")?;
        self.nodes.expand(tree, self.animation.triangles());
        self.records.resize(leaves, Record::default());
        Ok(())
    }

    pub(crate) fn interpolate(&mut self, pose: Pose) {
        interpolate(&self.animation, pose, &mut self.positions);
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
        };
        let without_leaf = self.animation.triangle_count() - self.animation.live_count();
        self.unhittable = preprocess::<T>(geometry, &mut self.nodes, &mut self.records);
        self.unhittable.inactive += without_leaf as u64;
    }

    pub(crate) fn refit(&mut self) {
        self.sah_cost = refit(&mut self.nodes, &mut self.sums);
    }

    /// See [`Tracer::closest`].
    pub(crate) fn closest(&self, rays: Rays<'_>, out: &mut [Hit]) -> u64 {
        with_test!(self.intersector, Exact, self.tracer(rays), closest(out))
    }

    /// See [`Tracer::any`].
    pub(crate) fn any(&self, rays: Rays<'_>, out: &mut [u8]) -> u64 {
        with_test!(self.intersector, Exact, self.tracer(rays), any(out))
    }

    /// See [`Tracer::shadow`].
    pub(crate) fn shadow(&self, rays: Rays<'_>, hits: &[Hit], light: Point, out: &mut [u8]) -> u64 {
        with_test!(
            self.intersector,
            Exact,
            self.tracer(rays),
            shadow(hits, light, out)
        )
    }

    /// Boxes and records, to trace through.
    pub(crate) fn target(&self) -> Target<'_> {
        Target {
            nodes: &self.nodes,
            records: &self.records,
        }
    }

    fn tracer<'a>(&'a self, rays: Rays<'a>) -> Tracer<'a> {
        Tracer {
            rays,
            target: self.target(),
            geometry: Geometry {
                positions: &self.positions,
                triangles: self.animation.triangles(),
                scale: self.scale,
            },
            settled: &self.settled,
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
        self.nodes.boxes().map(|b| self.scale.undo(b)).collect()
    }
}
