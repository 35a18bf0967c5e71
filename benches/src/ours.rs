//! This program's own stages, put together as the pipeline does.

use crate::{Mesh, Node};
use backend::{Backend, Generation, Hits, Intersector, Method, Query, QueryKind, Rays};
use bvh_build::{BinaryTree, Boxes, Builder, Cancel};
use bvh_layout::{Converter, First, Lists, Topology, Treelets};
use cpu_ref::CpuBackend;
use geom::{Aabb, Point, Ray};
use rayon::ThreadPool;
use rayon::prelude::*;

/// From positions to a record, in memory that is reused.
#[derive(Default)]
pub struct Ours {
    builder: Builder,
    tree: BinaryTree,
    converter: Converter,
    record: Topology,
}

impl Ours {
    /// Builds a tree, in the caller's pool.
    ///
    /// # Panics
    /// Never: nobody cancels.
    pub fn build(&mut self, mesh: &Mesh, positions: &[Point]) {
        let boxes = (&*mesh.animation, positions);
        let built = self.builder.build(&boxes, &Cancel::new(), &mut self.tree);
        built.expect("nobody cancels");
    }

    /// Converts the tree last built, in the caller's pool.
    pub fn convert(&mut self, mesh: &Mesh) -> &Topology {
        let words = std::mem::take(&mut self.record).into_words();
        let triangles = mesh.triangle_count();
        self.record = self.converter.convert(&self.tree, triangles, words);
        &self.record
    }

    /// The tree last built, as treelets, in the caller's pool.
    #[must_use]
    pub fn treelets(&self) -> Treelets {
        Treelets::of_tree(&self.tree)
    }

    /// The tree last built.
    #[must_use]
    pub fn tree(&self) -> &BinaryTree {
        &self.tree
    }

    /// The record last made.
    #[must_use]
    pub fn record(&self) -> &Topology {
        &self.record
    }

    /// The record with its eight-wide form, as a builder hands it to layout `fast`; in the caller's pool.
    #[must_use]
    pub fn record_with_blocks(&self, mesh: &Mesh, positions: &[Point]) -> Topology {
        self.with_blocks(self.record.clone(), mesh, positions)
    }

    /// Likewise, and leaves no record behind.
    #[must_use]
    pub fn take_record_with_blocks(&mut self, mesh: &Mesh, positions: &[Point]) -> Topology {
        let record = std::mem::take(&mut self.record);
        self.with_blocks(record, mesh, positions)
    }

    fn with_blocks(&self, record: Topology, mesh: &Mesh, positions: &[Point]) -> Topology {
        let boxes = self.boxes(mesh, positions);
        record.with_blocks(mesh.animation.triangles(), (&boxes, First::Larger))
    }

    fn boxes(&self, mesh: &Mesh, positions: &[Point]) -> Vec<Aabb> {
        let boxes = (&*mesh.animation, positions);
        let triangles = (0..mesh.triangle_count() as u32).into_par_iter();
        triangles.map(|triangle| boxes.get(triangle)).collect()
    }

    /// The record's nodes, with boxes over `positions`.
    #[must_use]
    pub fn nodes(&self, mesh: &Mesh, positions: &[Point]) -> Vec<Node> {
        let empty = Node {
            bounds: Aabb::EMPTY,
            triangles: 0,
        };
        let mut lists = Lists::default();
        lists.fill(&self.record);
        let mut nodes = vec![empty; self.record.node_count()];
        let boxes = (&*mesh.animation, positions);
        for (&node, &triangle) in lists.leaf_nodes.iter().zip(self.record.leaf_triangles()) {
            nodes[node as usize] = Node {
                bounds: boxes.get(triangle),
                triangles: 1,
            };
        }
        for (k, &node) in lists.inner_nodes.iter().enumerate().rev() {
            let [a, b] = Topology::children_of_inner(k as u32).map(|c| nodes[c as usize].bounds);
            nodes[node as usize].bounds = a.union(b);
        }
        nodes
    }
}

/// The `cpu` backend, loaded with a mesh and standing at a pose.
pub struct Tracer {
    backend: CpuBackend,
    generation: Generation,
}

impl Tracer {
    /// Loads `mesh` and takes its vertices at its start.
    ///
    /// # Panics
    /// If the machine has no room or threads; likewise for the other methods.
    #[must_use]
    pub fn new(mesh: &Mesh, intersector: Intersector, threads: usize) -> Self {
        let method = Method {
            intersector,
            ..Method::default()
        };
        Self::with(mesh, method, threads)
    }

    /// Likewise, by any method.
    ///
    /// # Panics
    /// See [`Tracer::new`].
    #[must_use]
    pub fn with(mesh: &Mesh, method: Method, threads: usize) -> Self {
        let mut backend = cpu_simd::open(Some(threads)).expect("threads can start");
        let loaded = backend.load(mesh.animation.clone(), method);
        loaded.expect("the mesh fits the machine");
        let mut tracer = Self {
            backend,
            generation: Generation::default(),
        };
        tracer.pose(mesh.start());
        tracer
    }

    /// Takes vertices at `pose`.
    ///
    /// # Panics
    /// See [`Tracer::new`].
    pub fn pose(&mut self, pose: geom::Pose) {
        self.backend.interpolate(pose).expect("a stage is recorded");
        self.finish();
    }

    /// Takes a tree.
    ///
    /// # Panics
    /// See [`Tracer::new`].
    pub fn adopt(&mut self, record: &Topology) {
        self.generation.0 += 1;
        let adopted = self.backend.adopt(record, self.generation);
        adopted.expect("the tree is the mesh's");
    }

    /// Positions to records and boxes: what rays need of a tree.
    ///
    /// # Panics
    /// See [`Tracer::new`].
    pub fn refit(&mut self) {
        self.backend.preprocess().expect("a stage is recorded");
        self.backend.refit().expect("a stage is recorded");
        self.finish();
    }

    /// Traces rays; the number of hits.
    ///
    /// # Panics
    /// See [`Tracer::new`].
    pub fn trace(&mut self, query: Query<'_>) -> u64 {
        self.backend.trace(query).expect("a stage is recorded");
        self.finish()
    }

    /// Traces a list of rays and fetches what they hit.
    ///
    /// # Panics
    /// See [`Tracer::new`].
    #[must_use]
    pub fn list(&mut self, rays: &[Ray], kind: QueryKind) -> Hits {
        let rays = Rays::List(rays);
        self.hits(Query { rays, kind })
    }

    /// Traces any rays and fetches what they hit.
    ///
    /// # Panics
    /// See [`Tracer::new`].
    #[must_use]
    pub fn hits(&mut self, query: Query<'_>) -> Hits {
        self.backend.trace(query).expect("a stage is recorded");
        let ticket = self.backend.submit().expect("work is submitted");
        let mut hits = Hits::default();
        self.backend.hits(ticket, &mut hits).expect("work is done");
        hits
    }

    fn finish(&mut self) -> u64 {
        let ticket = self.backend.submit().expect("work is submitted");
        self.backend.wait(ticket).expect("work is done").hits
    }
}

/// A tree of the mesh at its start, built and converted in `pool`.
#[must_use]
pub fn built(mesh: &Mesh, pool: &ThreadPool) -> Ours {
    let mut ours = Ours::default();
    let positions = mesh.positions(mesh.start());
    pool.install(|| {
        ours.build(mesh, &positions);
        ours.convert(mesh);
    });
    ours
}
