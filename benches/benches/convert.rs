//! Trees to records, and back in. `bvh`'s `flatten` is the nearest any rival has:
//! depth-first to an array that is traversed without a stack, boxes included.

use benches::{Bvh, Mesh, Rival, built, criterion, meshes, pool, print_table, thread_counts};
use bvh_layout::{Lists, Topology};
use criterion::measurement::WallTime;
use criterion::{BatchSize, BenchmarkGroup, BenchmarkId, Throughput};

fn main() {
    let mut criterion = criterion();
    let mut sizes = Vec::new();
    for mesh in meshes() {
        let mut group = criterion.benchmark_group(format!("convert/{}", mesh.label));
        group.throughput(Throughput::Elements(mesh.triangle_count() as u64));
        for threads in thread_counts() {
            bench_record(&mut group, &mesh, threads);
        }
        sizes.push(size(&mesh));
        bench_flatten(&mut group, &mesh);
        group.finish();
    }
    let header = ["mesh", "bytes a triangle", "of 64", "as treelets"];
    print_table("records", &header, sizes);
    criterion.final_summary();
}

fn bench_record(group: &mut BenchmarkGroup<'_, WallTime>, mesh: &Mesh, threads: usize) {
    let pool = pool(threads);
    let mut ours = built(mesh, &pool);
    group.bench_function(BenchmarkId::new("convert", threads), |b| {
        pool.install(|| b.iter(|| ours.convert(mesh).bytes()));
    });
    group.bench_function(BenchmarkId::new("treelets", threads), |b| {
        pool.install(|| b.iter_with_large_drop(|| ours.treelets()));
    });
    let mut lists = Lists::default();
    group.bench_function(BenchmarkId::new("lists", threads), |b| {
        pool.install(|| b.iter(|| lists.fill(ours.record())));
    });
    let words = || ours.record().words().to_vec();
    group.bench_function(BenchmarkId::new("from_words", threads), |b| {
        pool.install(|| b.iter_batched(words, Topology::from_words, BatchSize::LargeInput));
    });
}

fn size(mesh: &Mesh) -> Vec<String> {
    let built = built(mesh, &pool(1));
    let each = |bytes: usize| bytes as f64 / mesh.triangle_count() as f64;
    let (record, treelets) = (each(built.record().bytes()), each(built.treelets().bytes()));
    vec![
        mesh.label.clone(),
        format!("{record:.3}"),
        format!("{:.1} %", record / 0.64),
        format!("{treelets:.3}"),
    ]
}

fn bench_flatten(group: &mut BenchmarkGroup<'_, WallTime>, mesh: &Mesh) {
    let mut soup = Bvh::soup(&mesh.triangles(mesh.start()));
    let mut tree = Bvh::default();
    tree.build(&mut soup);
    group.bench_function(BenchmarkId::new("bvh flatten", 1), |b| {
        b.iter_with_large_drop(|| tree.tree().flatten());
    });
}
