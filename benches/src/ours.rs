//! This program's stages, combined as in the pipeline.

use crate::{Mesh, pool};
use backend::{Backend, Generation, Hits, Intersector, Query, QueryKind, Rays};
use bvh_build::{AnimationBoxes, BinaryTree, BlockSize, Boxes, Cancel, SahBuilder};
use bvh_layout::{CollapseOptions, Converter, First, Topology};
use cpu_ref::CpuBackend;
use geom::{Aabb, Point, Ray};
use rayon::ThreadPool;
use rayon::prelude::*;

/// Builds trees and converts them to topologies, in memory that is reused.
#[derive(Default)]
pub struct Ours {
    builder: SahBuilder,
    tree: BinaryTree,
    converter: Converter,
    record: Topology,
}

impl Ours {
    /// Builds a tree and converts it, in the caller's pool.
    pub fn make(&mut self, mesh: &Mesh, positions: &[Point]) -> &Topology {
        let boxes = boxes(mesh, positions);
        let built = self.builder.build(&boxes, &Cancel::new(), &mut self.tree);
        built.expect("the build is not cancelled");
        self.convert(mesh)
    }

    /// Converts the last tree built, in the caller's pool.
    pub fn convert(&mut self, mesh: &Mesh) -> &Topology {
        let spare = std::mem::take(&mut self.record).into_spare();
        let triangles = mesh.triangle_count();
        self.record = self.converter.convert(&self.tree, triangles, spare);
        &self.record
    }

    /// Returns the last topology.
    pub fn record(&self) -> &Topology {
        &self.record
    }

    /// Builds a tree for backend `cpu`, in the caller's pool: a topology with eight-wide blocks.
    ///
    /// Afterwards [`Self::record`] is empty.
    pub fn make_with_blocks(&mut self, mesh: &Mesh, positions: &[Point]) -> Topology {
        self.builder.block_size = BlockSize::Eight;
        self.make(mesh, positions);
        let boxes = boxes(mesh, positions);
        let triangles = (0..mesh.triangle_count() as u32).into_par_iter();
        let boxes: Vec<Aabb> = triangles.map(|t| boxes.get(t)).collect();
        let record = std::mem::take(&mut self.record);
        let options = CollapseOptions {
            boxes: &boxes,
            first: First::Larger,
        };
        record.with_blocks(mesh.animation.triangles(), options)
    }

    /// Returns the cost by the surface area heuristic (traversal 1, intersection 1) over `positions`.
    pub fn sah_cost(&self, mesh: &Mesh, positions: &[Point]) -> f64 {
        bvh_build::sah_cost(&self.tree, &boxes(mesh, positions))
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

    /// Loads `mesh`, and builds and refits a tree at its start.
    pub fn ready(mesh: &Mesh, intersector: Intersector, threads: usize) -> Self {
        let (pool, positions) = (pool(threads), mesh.positions(mesh.start()));
        let mut tracer = Self::new(mesh, intersector, threads);
        tracer.adopt(&pool.install(|| Ours::default().make_with_blocks(mesh, &positions)));
        tracer.refit();
        tracer
    }

    /// Interpolates vertices at `pose`.
    pub fn pose(&mut self, pose: geom::Pose) {
        done(self.backend.interpolate(pose));
        self.finish();
    }

    /// Adopts a tree.
    pub fn adopt(&mut self, record: &Topology) {
        self.generation.0 += 1;
        done(self.backend.adopt(record, self.generation));
    }

    /// Computes triangle data and boxes from positions, as rays require.
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
    pool.install(|| ours.make(mesh, &positions).bytes());
    ours
}
