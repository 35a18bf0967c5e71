//! Triangles to trees, with one thread and with all; and what the trees are worth.

use backend::Intersector;
use benches::{
    Bvh, Mesh, Node, Obvhs, Ours, Parry, Rival, Tracer, built, criterion, meshes, pool,
    print_table, sah_cost, thread_counts,
};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Throughput};

fn main() {
    let mut criterion = criterion();
    for mesh in meshes() {
        let mut group = criterion.benchmark_group(format!("build/{}", mesh.label));
        group.throughput(Throughput::Elements(mesh.triangle_count() as u64));
        for threads in thread_counts() {
            bench_ours(&mut group, &mesh, threads);
            bench_rival::<Obvhs<false>>(&mut group, &mesh, threads);
            bench_rival::<Obvhs<true>>(&mut group, &mesh, threads);
            bench_rival::<Bvh>(&mut group, &mesh, threads);
            bench_rival::<Parry>(&mut group, &mesh, threads);
        }
        group.finish();
        compare_costs(&mesh);
    }
    criterion.final_summary();
}

/// `abvh` is build and convert, off the frame's path; `abvh and refit` adds what the
/// backend does before rays can use the record, as the rivals' builds do.
fn bench_ours(group: &mut BenchmarkGroup<'_, WallTime>, mesh: &Mesh, threads: usize) {
    let pool = pool(threads);
    let positions = mesh.positions(mesh.start());
    let mut ours = Ours::default();
    group.bench_function(BenchmarkId::new("abvh", threads), |b| {
        pool.install(|| {
            b.iter(|| {
                ours.build(mesh, &positions);
                ours.convert(mesh).bytes()
            });
        });
    });
    let mut tracer = Tracer::new(mesh, Intersector::Watertight, threads);
    group.bench_function(BenchmarkId::new("abvh and refit", threads), |b| {
        b.iter(|| {
            pool.install(|| {
                ours.build(mesh, &positions);
                ours.convert(mesh);
            });
            tracer.adopt(ours.record());
            tracer.refit();
        });
    });
}

fn bench_rival<R: Rival>(group: &mut BenchmarkGroup<'_, WallTime>, mesh: &Mesh, threads: usize) {
    if threads > 1 && !R::BUILDS_IN_PARALLEL {
        return;
    }
    let mut soup = R::soup(&mesh.triangles(mesh.start()));
    let mut tree = R::default();
    group.bench_function(BenchmarkId::new(R::NAME, threads), |b| {
        pool(threads).install(|| b.iter(|| tree.build(&mut soup)));
    });
}

fn compare_costs(mesh: &Mesh) {
    let ours = built(mesh, &pool(1)).nodes(mesh, &mesh.positions(mesh.start()));
    let rows = vec![
        row("abvh", &ours, &ours),
        rival_row::<Obvhs<false>>(mesh, &ours),
        rival_row::<Obvhs<true>>(mesh, &ours),
        rival_row::<Bvh>(mesh, &ours),
        rival_row::<Parry>(mesh, &ours),
    ];
    let title = format!(
        "{}: surface area cost (traversal 1, intersection 1)",
        mesh.label
    );
    print_table(&title, &["tree", "cost", "to abvh's", "nodes"], rows);
}

fn rival_row<R: Rival>(mesh: &Mesh, ours: &[Node]) -> Vec<String> {
    let mut soup = R::soup(&mesh.triangles(mesh.start()));
    let mut tree = R::default();
    pool(1).install(|| tree.build(&mut soup));
    row(R::NAME, &tree.nodes(&soup), ours)
}

fn row(name: &str, nodes: &[Node], ours: &[Node]) -> Vec<String> {
    let cost = sah_cost(nodes);
    vec![
        name.to_owned(),
        format!("{cost:.2}"),
        format!("{:.3}", cost / sah_cost(ours)),
        nodes.len().to_string(),
    ]
}
