//! New positions to boxes, in trees that keep their shape.
//!
//! For `abvh` this is `preprocess` and `refit`: records for the intersector,
//! boxes of leaves, boxes of inner nodes. For the others it is boxes of leaves
//! and of inner nodes; they trace the triangles as they are. `bvh` has no refit.

use backend::Intersector;
use benches::{
    Bvh, Mesh, Obvhs, Parry, Rival, Tracer, built, criterion, meshes, pool, thread_counts,
};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Throughput};

fn main() {
    let mut criterion = criterion();
    for mesh in meshes() {
        let mut group = criterion.benchmark_group(format!("refit/{}", mesh.label));
        group.throughput(Throughput::Elements(mesh.triangle_count() as u64));
        for threads in thread_counts() {
            bench_ours(&mut group, &mesh, threads);
            bench_rival::<Obvhs<false>>(&mut group, &mesh, threads);
            bench_rival::<Obvhs<true>>(&mut group, &mesh, threads);
            bench_rival::<Parry>(&mut group, &mesh, threads);
            bench_rival::<Bvh>(&mut group, &mesh, threads);
        }
        group.finish();
    }
    criterion.final_summary();
}

fn bench_ours(group: &mut BenchmarkGroup<'_, WallTime>, mesh: &Mesh, threads: usize) {
    let ours = built(mesh, &pool(threads));
    let mut tracer = Tracer::new(mesh, Intersector::Watertight, threads);
    tracer.adopt(ours.record());
    tracer.pose(mesh.middle());
    group.bench_function(BenchmarkId::new("abvh", threads), |b| {
        b.iter(|| tracer.refit());
    });
}

fn bench_rival<R: Rival>(group: &mut BenchmarkGroup<'_, WallTime>, mesh: &Mesh, threads: usize) {
    if !R::REFITS || (threads > 1 && !R::REFITS_IN_PARALLEL) {
        return;
    }
    let mut tree = R::default();
    let pool = pool(threads);
    pool.install(|| tree.build(&mut R::soup(&mesh.triangles(mesh.start()))));
    let soup = R::soup(&mesh.triangles(mesh.middle()));
    group.bench_function(BenchmarkId::new(R::NAME, threads), |b| {
        pool.install(|| b.iter(|| tree.refit(&soup)));
    });
}
