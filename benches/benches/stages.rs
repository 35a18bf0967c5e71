//! Measures builds, conversions, refits and rays. Compares all but conversions with other crates.
//!
//! `cargo bench -p benches --bench stages [-- STAGE]`, where a stage is `build`, `convert`, `refit` or `trace`.

use backend::{Intersector, Query, QueryKind, Rays};
use benches::{
    CrateTree, Mesh, Ours, Tracer, built, camera, criterion, meshes, pool, print_table, sah_cost,
    selected_stage, shadow_rays, thread_counts, trees,
};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput};
use geom::Ray;
use rayon::prelude::*;

type Group<'a> = BenchmarkGroup<'a, WallTime>;
type Stage = fn(&mut Criterion, &Mesh);

fn main() {
    let mut criterion = criterion();
    let stages: [(&str, Stage); 4] = [
        ("build", build),
        ("convert", convert),
        ("refit", refit),
        ("trace", trace),
    ];
    let selected = selected_stage(&stages.map(|(name, _)| name), std::env::args().skip(1));
    for mesh in meshes() {
        for (name, stage) in stages {
            if selected.is_none_or(|selected| selected == name) {
                stage(&mut criterion, &mesh);
            }
        }
    }
    criterion.final_summary();
}

fn group<'a>(criterion: &'a mut Criterion, stage: &str, mesh: &Mesh) -> Group<'a> {
    let mut group = criterion.benchmark_group(format!("{stage}/{}", mesh.label));
    group.throughput(Throughput::Elements(mesh.triangle_count() as u64));
    group
}

/// Measures builds with each of `thread_counts`, and reports the surface area cost of the trees.
fn build(criterion: &mut Criterion, mesh: &Mesh) {
    let mut group = group(criterion, "build", mesh);
    for threads in thread_counts() {
        build_ours(&mut group, mesh, threads);
        for mut tree in trees(&mesh.triangles(mesh.start())) {
            group.bench_function(BenchmarkId::new(tree.name(), threads), |b| {
                pool(threads).install(|| b.iter(|| tree.build()));
            });
        }
    }
    group.finish();
    let ours = built(mesh, &pool(1));
    let cost = ours.sah_cost(mesh, &mesh.positions(mesh.start()));
    let nodes = 2 * ours.topology().binary().leaf_count() - 1;
    let mut rows = vec![cost_row("abvh", [cost, cost], nodes)];
    rows.extend(trees_of(mesh, 1).iter().map(|tree| {
        let nodes = tree.nodes();
        cost_row(tree.name(), [sah_cost(&nodes), cost], nodes.len())
    }));
    let label = &mesh.label;
    let title = format!("{label}: surface area cost (traversal 1, intersection 1)");
    print_table(&title, "tree|cost|relative to abvh|nodes", rows);
}

/// Measures our builds.
///
/// Row `abvh` is the build and the conversion to treelets, for a GPU. With policy `async`, both run on other threads
/// while frames are rendered. Row `abvh and refit` is the build, the conversion to nodes of eight children, and the
/// work of the backend before rays can be traced. Compare the other crates with this row, because their trees can be
/// traced directly after the build.
fn build_ours(group: &mut Group<'_>, mesh: &Mesh, threads: usize) {
    let pool = pool(threads);
    let positions = mesh.positions(mesh.start());
    let mut ours = Ours::default();
    group.bench_function(BenchmarkId::new("abvh", threads), |b| {
        // Returns a number, because the closure cannot return a borrow of `ours`.
        pool.install(|| b.iter(|| ours.make(mesh, &positions).upload_bytes()));
    });
    let mut tracer = Tracer::new(mesh, Intersector::Watertight, threads);
    group.bench_function(BenchmarkId::new("abvh and refit", threads), |b| {
        b.iter(|| {
            tracer.adopt(&pool.install(|| ours.make_eight_wide(mesh, &positions)));
            tracer.refit();
        });
    });
}

/// Builds the other crates' trees at the start of a mesh.
fn trees_of(mesh: &Mesh, threads: usize) -> Vec<Box<dyn CrateTree>> {
    let mut all = trees(&mesh.triangles(mesh.start()));
    pool(threads).install(|| all.iter_mut().for_each(|tree| tree.build()));
    all
}

fn cost_row(name: &str, [cost, ours]: [f64; 2], nodes: usize) -> Vec<String> {
    let [cost, ratio] = [format!("{cost:.2}"), format!("{:.3}", cost / ours)];
    vec![name.to_owned(), cost, ratio, nodes.to_string()]
}

/// Bytes per triangle of a binary tree whose nodes store boxes, for comparison: two nodes of 32 bytes. Treelets contain
/// no boxes.
const BYTES_WITH_BOXES: f64 = 64.0;

/// Measures conversions of binary trees to treelets.
fn convert(criterion: &mut Criterion, mesh: &Mesh) {
    let mut group = group(criterion, "convert", mesh);
    for threads in thread_counts() {
        let pool = pool(threads);
        let mut ours = built(mesh, &pool);
        group.bench_function(BenchmarkId::new("convert", threads), |b| {
            pool.install(|| b.iter(|| ours.convert(mesh).upload_bytes()));
        });
    }
    group.finish();
    let built = built(mesh, &pool(1));
    let bytes = built.topology().upload_bytes() as f64 / mesh.triangle_count() as f64;
    let row = vec![
        mesh.label.clone(),
        format!("{bytes:.3}"),
        format!("{:.1} %", 100.0 * bytes / BYTES_WITH_BOXES),
    ];
    print_table(
        "treelets",
        "mesh|bytes/triangle|relative to 64-byte tree with boxes",
        vec![row],
    );
}

/// Measures refits: from new positions to boxes of an unchanged tree.
///
/// For `abvh` this is `preprocess` and `refit`: triangle records for the intersector, boxes of leaves, boxes of inner
/// nodes. The other crates compute only the boxes. They intersect the vertices directly, so they have no triangle
/// records to update. `bvh` has no refit.
fn refit(criterion: &mut Criterion, mesh: &Mesh) {
    let mut group = group(criterion, "refit", mesh);
    for threads in thread_counts() {
        let mut tracer = Tracer::ready(mesh, Intersector::Watertight, threads);
        tracer.pose(mesh.middle());
        group.bench_function(BenchmarkId::new("abvh", threads), |b| {
            b.iter(|| tracer.refit());
        });
        for mut tree in trees_of(mesh, threads) {
            if tree.can_refit() && threads == 1 {
                tree.set_triangles(&mesh.triangles(mesh.middle()));
                group.bench_function(BenchmarkId::new(tree.name(), threads), |b| {
                    b.iter(|| tree.refit());
                });
            }
        }
    }
    group.finish();
}

/// Number of rays in a rayon task, when another crate's tree is traced.
const TASK: usize = 512;

/// Intersectors of abvh to measure.
const INTERSECTORS: [Intersector; 2] = [Intersector::Watertight, Intersector::MollerTrumbore];

/// Rays of a group.
struct Work<'a> {
    mesh: &'a Mesh,
    rays: &'a [Ray],
    any: bool,
    threads: usize,
}

/// Measures rays with the last of `thread_counts`: through the pixels of an image, and from their hits to a light.
///
/// A table of hits follows each group, because trees with different hits do not do the same work.
fn trace(criterion: &mut Criterion, mesh: &Mesh) {
    let threads = thread_counts().pop().unwrap_or(1);
    let camera = camera(mesh, [512, 320]);
    let primary = camera.rays().collect::<Vec<_>>();
    let mut watertight = Tracer::ready(mesh, Intersector::Watertight, threads);
    let shadow = shadow_rays(mesh, &primary, &mut watertight);
    drop(watertight);
    for (kind, rays, any) in [("primary", &primary, false), ("shadow", &shadow, true)] {
        let work = Work {
            mesh,
            rays,
            any,
            threads,
        };
        let name = format!("trace {kind}");
        let mut group = group(criterion, &name, mesh);
        group.throughput(Throughput::Elements(rays.len() as u64));
        let hits = trace_all(&mut group, &work, Rays::Camera(&camera));
        group.finish();
        print_table(&name, "tree|rays|hits", hits);
    }
}

/// Measures all trees, and returns the rows of the table of hits.
///
/// Traces primary rays both as a camera and as a list, because abvh forms packets of neighbouring pixels or of
/// neighbours in the list.
fn trace_all(group: &mut Group<'_>, work: &Work<'_>, camera: Rays<'_>) -> Vec<Vec<String>> {
    let list = Rays::List(work.rays);
    let rays = if work.any { list } else { camera };
    let mut hits = Vec::new();
    for intersector in INTERSECTORS {
        hits.push(trace_ours(group, work, intersector, rays));
        if !work.any {
            hits.push(trace_ours(group, work, intersector, list));
        }
    }
    for tree in trees_of(work.mesh, work.threads) {
        let tasks = || work.rays.par_chunks(TASK);
        let count = || tasks().map(|task| tree.count(task, work.any)).sum();
        let pool = pool(work.threads);
        group.bench_function(tree.name(), |b| pool.install(|| b.iter(count)));
        hits.push(hit_row(tree.name(), work, pool.install(count)));
    }
    hits
}

fn trace_ours(
    group: &mut Group<'_>,
    work: &Work<'_>,
    intersector: Intersector,
    rays: Rays<'_>,
) -> Vec<String> {
    let kind = match work.any {
        true => QueryKind::Any,
        false => QueryKind::Closest,
    };
    let mut tracer = Tracer::ready(work.mesh, intersector, work.threads);
    let from = match rays {
        Rays::Camera(_) => "a camera",
        Rays::List(_) | Rays::OnDevice(_) => "a list",
    };
    let name = format!("abvh {intersector}, {from}");
    group.bench_function(&name, |b| b.iter(|| tracer.trace(Query { rays, kind })));
    hit_row(&name, work, tracer.trace(Query { rays, kind }))
}

fn hit_row(name: &str, work: &Work<'_>, hits: u64) -> Vec<String> {
    let rays = work.rays.len();
    vec![name.to_owned(), rays.to_string(), hits.to_string()]
}
