//! Rays to hits, on all threads: through the pixels of a picture, and from what they hit to a light.
//!
//! A table of hits follows each group: trees that answer differently do not do the same work.

use backend::{Intersector, Layout, Method, Query, QueryKind, Rays};
use benches::{
    Bvh, Mesh, Obvhs, Parry, Rival, Tracer, built, camera, criterion, meshes, pool, print_table,
    shadow_rays, thread_counts,
};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput};
use geom::Ray;
use rayon::prelude::*;

/// Rays that one task of a rival traces.
const TASK: usize = 512;

/// Our own ways. A camera's rays run together where the layout can; a list's run one by one.
const OURS: [(Intersector, Layout); 3] = [
    (Intersector::Watertight, Layout::Fast),
    (Intersector::Watertight, Layout::Bvh2),
    (Intersector::MollerTrumbore, Layout::Bvh2),
];

/// What one group traces.
struct Work<'a> {
    mesh: &'a Mesh,
    rays: &'a [Ray],
    any: bool,
    threads: usize,
}

fn main() {
    let mut criterion = criterion();
    let threads = thread_counts().pop().unwrap_or(1);
    for mesh in meshes() {
        let camera = camera(&mesh);
        let mut watertight = ready(&mesh, Method::default(), threads);
        let primary = camera.rays().collect::<Vec<_>>();
        let shadow = shadow_rays(&mesh, &primary, &mut watertight);
        drop(watertight);
        for (kind, rays, any) in [("primary", &primary, false), ("shadow", &shadow, true)] {
            let work = Work {
                mesh: &mesh,
                rays,
                any,
                threads,
            };
            bench_all(&mut criterion, kind, &work, Rays::Camera(&camera));
        }
    }
    criterion.final_summary();
}

fn bench_all(criterion: &mut Criterion, kind: &str, work: &Work<'_>, camera: Rays<'_>) {
    let name = format!("trace {kind}/{}", work.mesh.label);
    let mut group = criterion.benchmark_group(&name);
    group.throughput(Throughput::Elements(work.rays.len() as u64));
    let list = Rays::List(work.rays);
    let rays = if work.any { list } else { camera };
    let mut hits = Vec::new();
    for (intersector, layout) in OURS {
        let method = Method {
            intersector,
            layout,
        };
        hits.push(bench_ours(&mut group, work, method, rays));
        if layout == Layout::Fast && !work.any {
            hits.push(bench_ours(&mut group, work, method, list));
        }
    }
    #[cfg(feature = "embree")]
    hits.push(bench_rival::<benches::Embree>(&mut group, work));
    hits.push(bench_rival::<Obvhs<false>>(&mut group, work));
    hits.push(bench_rival::<Obvhs<true>>(&mut group, work));
    hits.push(bench_rival::<Bvh>(&mut group, work));
    hits.push(bench_rival::<Parry>(&mut group, work));
    group.finish();
    print_table(&name, &["tree", "rays", "hits"], hits);
}

/// A backend with a fresh tree.
fn ready(mesh: &Mesh, method: Method, threads: usize) -> Tracer {
    let pool = pool(threads);
    let ours = built(mesh, &pool);
    let positions = mesh.positions(mesh.start());
    let mut tracer = Tracer::with(mesh, method, threads);
    tracer.adopt(&pool.install(|| ours.record_with_blocks(mesh, &positions)));
    tracer.refit();
    tracer
}

fn bench_ours(
    group: &mut BenchmarkGroup<'_, WallTime>,
    work: &Work<'_>,
    method: Method,
    rays: Rays<'_>,
) -> Vec<String> {
    let kind = if work.any {
        QueryKind::Any
    } else {
        QueryKind::Closest
    };
    let mut tracer = ready(work.mesh, method, work.threads);
    let from = match rays {
        Rays::Camera(_) => "a camera",
        Rays::List(_) => "a list",
    };
    let name = format!("abvh {} {}, {from}", method.layout, method.intersector);
    group.bench_function(&name, |b| b.iter(|| tracer.trace(Query { rays, kind })));
    row(&name, work, tracer.trace(Query { rays, kind }))
}

fn bench_rival<R: Rival>(group: &mut BenchmarkGroup<'_, WallTime>, work: &Work<'_>) -> Vec<String> {
    let mut soup = R::soup(&work.mesh.triangles(work.mesh.start()));
    let mut tree = R::default();
    let pool = pool(work.threads);
    pool.install(|| tree.build(&mut soup));
    let is_hit = |ray: &Ray| match work.any {
        true => tree.blocked(&soup, ray),
        false => tree.closest(&soup, ray).is_some(),
    };
    let hits = || {
        let tasks = work.rays.par_chunks(TASK);
        let count = |task: &[Ray]| task.iter().filter(|ray| is_hit(ray)).count() as u64;
        tasks.map(count).sum::<u64>()
    };
    group.bench_function(R::NAME, |b| pool.install(|| b.iter(hits)));
    row(R::NAME, work, pool.install(hits))
}

fn row(name: &str, work: &Work<'_>, hits: u64) -> Vec<String> {
    vec![
        name.to_owned(),
        work.rays.len().to_string(),
        hits.to_string(),
    ]
}
