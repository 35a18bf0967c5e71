//! Triangles to trees.

use crate::{METHOD, Unit, report};
use benches::{
    Contender, EmbreeScene, Mesh, Ours, Parry, Rival, Tracer, built, in_turn, pool, print_table,
    sah_cost, thread_counts,
};
use rayon::ThreadPool;
use serde_json::{Value, json};

const ROUNDS: usize = 15;

/// All of a mesh.
pub(crate) fn all(mesh: &Mesh) -> Vec<Value> {
    let mut groups: Vec<Value> = thread_counts()
        .into_iter()
        .rev()
        .map(|threads| times(mesh, threads))
        .collect();
    groups.push(costs(mesh));
    groups
}

/// Builds on `threads`; beside those ours on one, of which the scaling follows.
fn times(mesh: &Mesh, threads: usize) -> Value {
    let triangles = mesh.triangles(mesh.start());
    let pools: Vec<_> = thread_counts()
        .into_iter()
        .filter(|&n| n <= threads)
        .map(|n| (n, pool(n)))
        .collect();
    #[cfg(feature = "tinybvh")]
    let corners = benches::TinyBvh::soup(&triangles);
    let mut embree = EmbreeScene::new(&triangles, threads, false);
    let mut contenders = vec![Contender::new("Embree 3, medium", threads, || {
        embree.rebuild();
        0
    })];
    for (threads, pool) in &pools {
        contenders.push(record(mesh, *threads, pool));
        contenders.push(traceable(mesh, *threads, pool));
    }
    #[cfg(feature = "tinybvh")]
    contenders.push(tinybvh(&corners));
    let samples = in_turn(contenders, ROUNDS);
    let title = format!("{}: build, {threads} threads", mesh.label);
    report(&title, Unit::NsEach(mesh.triangle_count()), &samples, 0)
}

/// Build and conversion: what the pipeline's builder thread hands over.
fn record<'a>(mesh: &'a Mesh, threads: usize, pool: &'a ThreadPool) -> Contender<'a> {
    let positions = mesh.positions(mesh.start());
    let mut ours = Ours::default();
    Contender::new("abvh, build and convert", threads, move || {
        pool.install(|| {
            ours.build(mesh, &positions);
            ours.convert(mesh);
        });
        0
    })
}

/// All that is done until rays can be asked on this machine.
fn traceable<'a>(mesh: &'a Mesh, threads: usize, pool: &'a ThreadPool) -> Contender<'a> {
    let positions = mesh.positions(mesh.start());
    let mut ours = Ours::default();
    let mut tracer = Tracer::with(mesh, METHOD, threads);
    Contender::new("abvh, build to rays", threads, move || {
        let record = pool.install(|| {
            ours.build(mesh, &positions);
            ours.convert(mesh);
            ours.take_record_with_blocks(mesh, &positions)
        });
        tracer.adopt(&record);
        tracer.refit();
        0
    })
}

#[cfg(feature = "tinybvh")]
fn tinybvh(corners: &[[f32; 4]]) -> Contender<'_> {
    let mut tree = benches::TinyBvh::new(corners);
    let threads = thread_counts().pop().unwrap_or(1);
    Contender::new("tinybvh, with threads of its own", threads, move || {
        tree.rebuild();
        0
    })
}

/// What trees are worth. tinybvh joins triangles in a leaf where that costs less: as it is, and with leaves split.
fn costs(mesh: &Mesh) -> Value {
    let ours = built(mesh, &pool(1)).nodes(mesh, &mesh.positions(mesh.start()));
    let mut costs = vec![("abvh, one triangle a leaf", sah_cost(&ours))];
    #[cfg(feature = "tinybvh")]
    {
        let corners = benches::TinyBvh::soup(&mesh.triangles(mesh.start()));
        let mut tree = benches::TinyBvh::new(&corners);
        costs.push(("tinybvh", sah_cost(&tree.nodes())));
        tree.split_leaves();
        costs.push(("tinybvh, one triangle a leaf", sah_cost(&tree.nodes())));
    }
    costs.push(("parry3d, one triangle a leaf", rival_cost::<Parry>(mesh)));
    costs.push((benches::Bvh::NAME, rival_cost::<benches::Bvh>(mesh)));
    let rows = costs.iter().map(|(name, cost)| {
        let ratio = cost / costs[0].1;
        vec![
            (*name).to_owned(),
            format!("{cost:.2}"),
            format!("{ratio:.3}"),
        ]
    });
    let title = format!(
        "{}: surface area cost (traversal 1, intersection 1)",
        mesh.label
    );
    print_table(&title, &["tree", "cost", "to abvh's"], rows.collect());
    json!({ "title": title, "costs": costs })
}

fn rival_cost<R: Rival>(mesh: &Mesh) -> f64 {
    let mut soup = R::soup(&mesh.triangles(mesh.start()));
    let mut tree = R::default();
    pool(1).install(|| tree.build(&mut soup));
    sah_cost(&tree.nodes(&soup))
}
