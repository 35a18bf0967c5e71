//! The stages of abvh, in the order of crate `pipeline`: build, conversion, `adopt`, `preprocess`, `refit`, `trace`.

use crate::{Mesh, pool};
use backend::{Backend, Generation, Hits, Intersector, Query, QueryKind, Rays};
use bvh_build::{AnimationBoxes, BinaryTree, BlockSize, Boxes, Cancel, SahBuilder};
use bvh_layout::{CollapseOptions, Converter, FirstVisited, Topology};
use cpu_ref::CpuBackend;
use geom::{Aabb, Point, Ray};
use rayon::ThreadPool;
use rayon::prelude::*;
use std::sync::Arc;

/// Builds trees and converts them, in memory that is reused.
#[derive(Default)]
pub struct Ours {
    builder: SahBuilder,
    /// The last tree built, and the one before.
    trees: [Arc<BinaryTree>; 2],
    converter: Converter,
    topology: Topology,
}

impl Ours {
    /// Builds a tree for a GPU, in the caller's pool: a binary tree with treelets.
    ///
    /// A GPU reads the tree as treelets: groups of subtrees that fit the memory of a workgroup. They have no boxes.
    pub fn make(&mut self, mesh: &Mesh, positions: &[Point]) -> &Topology {
        self.build(&boxes(mesh, positions));
        self.convert(mesh)
    }

    /// Builds a binary tree, in the caller's pool. Reuses the memory of the tree before the last, unless a backend still
    /// shares that tree.
    fn build(&mut self, boxes: &AnimationBoxes<'_>) {
        self.trees.swap(0, 1);
        let tree = &mut self.trees[0];
        if Arc::get_mut(tree).is_none() {
            *tree = Arc::default();
        }
        let tree = Arc::make_mut(tree);
        let built = self.builder.build(boxes, &Cancel::new(), tree);
        built.expect("the build is not cancelled");
    }

    /// Converts the last tree built to treelets, in the caller's pool.
    pub fn convert(&mut self, mesh: &Mesh) -> &Topology {
        // Memory of the last topology, which the converter reuses.
        let spare = std::mem::take(&mut self.topology).into_spare();
        let (tree, triangles) = (Arc::clone(&self.trees[0]), mesh.triangle_count());
        self.topology = self.converter.convert(tree, triangles, spare);
        &self.topology
    }

    /// Returns the last tree made by [`Self::make`] or [`Self::convert`].
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// Builds a tree for backend `cpu`, in the caller's pool: a binary tree, collapsed to nodes of eight
    /// children.
    pub fn make_eight_wide(&mut self, mesh: &Mesh, positions: &[Point]) -> Topology {
        self.builder.block_size = BlockSize::Eight;
        let boxes = boxes(mesh, positions);
        self.build(&boxes);
        let triangles = (0..mesh.triangle_count() as u32).into_par_iter();
        let boxes: Vec<Aabb> = triangles.map(|t| boxes.get(t)).collect();
        let options = CollapseOptions {
            boxes: &boxes,
            // Any-hit rays visit the child of larger area first.
            first_visited: FirstVisited::Larger,
        };
        let topology = Topology::new(Arc::clone(&self.trees[0]), mesh.triangle_count());
        topology.with_blocks(mesh.animation.triangles(), options)
    }

    /// Returns the cost by the surface area heuristic (traversal 1, intersection 1) over `positions`.
    pub fn sah_cost(&self, mesh: &Mesh, positions: &[Point]) -> f64 {
        bvh_build::sah_cost(&self.trees[0], &boxes(mesh, positions))
    }
}

fn boxes<'a>(mesh: &'a Mesh, vertices: &'a [Point]) -> AnimationBoxes<'a> {
    AnimationBoxes {
        animation: &mesh.animation,
        vertices,
    }
}

/// The `cpu` backend with a loaded mesh at one pose.
pub struct Tracer {
    backend: CpuBackend,
    hits: Hits,
    generation: Generation,
}

impl Tracer {
    /// Loads `mesh` and interpolates its vertices at its start.
    pub fn new(mesh: &Mesh, intersector: Intersector, threads: usize) -> Self {
        let mut backend = done(cpu_simd::open(Some(threads)));
        done(backend.load(mesh.animation.clone(), intersector));
        let mut tracer = Self {
            backend,
            hits: Hits::default(),
            generation: Generation::default(),
        };
        tracer.pose(mesh.start());
        tracer
    }

    /// Loads `mesh`, builds a tree at its start, and computes the tree's boxes.
    pub fn ready(mesh: &Mesh, intersector: Intersector, threads: usize) -> Self {
        let (pool, positions) = (pool(threads), mesh.positions(mesh.start()));
        let mut tracer = Self::new(mesh, intersector, threads);
        tracer.adopt(&pool.install(|| Ours::default().make_eight_wide(mesh, &positions)));
        tracer.refit();
        tracer
    }

    /// Interpolates vertices at `pose`.
    pub fn pose(&mut self, pose: geom::Pose) {
        done(self.backend.interpolate(pose));
        self.finish();
    }

    /// Makes `tree` the tree that `refit` and `trace` use, under a new generation number.
    pub fn adopt(&mut self, tree: &Topology) {
        self.generation.0 += 1;
        done(self.backend.adopt(tree, self.generation));
    }

    /// Runs `preprocess` and `refit`: computes triangle records and boxes, which must precede `trace`. A new tree
    /// has no boxes.
    pub fn refit(&mut self) {
        done(self.backend.preprocess());
        done(self.backend.refit());
        self.finish();
    }

    /// Traces rays and returns the number of hits.
    pub fn trace(&mut self, query: Query<'_>) -> u64 {
        done(self.backend.trace(&[query]));
        self.finish()
    }

    /// Traces a list of rays and returns their hits.
    pub fn list(&mut self, rays: &[Ray], kind: QueryKind) -> &Hits {
        let rays = Rays::List(rays);
        done(self.backend.trace(&[Query { rays, kind }]));
        let ticket = done(self.backend.submit());
        done(self.backend.take_hits(ticket, 0, &mut self.hits));
        &self.hits
    }

    fn finish(&mut self) -> u64 {
        let ticket = done(self.backend.submit());
        done(self.backend.wait(ticket)).hits
    }
}

/// Unwraps a result of the backend, which fails only if memory or threads are missing.
fn done<T, E: std::fmt::Debug>(result: Result<T, E>) -> T {
    result.expect("the mesh fits the machine")
}

/// Builds and converts a tree of the mesh at its start, in `pool`.
pub fn built(mesh: &Mesh, pool: &ThreadPool) -> Ours {
    let mut ours = Ours::default();
    let positions = mesh.positions(mesh.start());
    // Returns a number only to end the borrow of `ours`.
    pool.install(|| ours.make(mesh, &positions).upload_bytes());
    ours
}
