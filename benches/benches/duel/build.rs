//! Triangles to trees that rays can be traced by.

use crate::{METHOD, Unit, measure, others};
use benches::{
    Contender, Mesh, Ours, Tracer, built, built_rivals, pool, print_table, sah_cost, thread_counts,
};
use geom::Triangle;
use serde_json::Value;

type Group = fn(&Mesh, usize) -> Vec<Contender<'_>>;

const GROUPS: [(&str, Group); 3] = [
    ("build", builds),
    ("convert", conversions),
    ("refit", refits),
];

/// The groups of a mesh that are asked for.
pub(crate) fn all(mesh: &Mesh, is_asked: &dyn Fn(&str) -> bool) -> Vec<Value> {
    let mut all = Vec::new();
    for threads in thread_counts() {
        for (what, group) in GROUPS.iter().filter(|(what, _)| is_asked(what)) {
            let title = format!("{}: {what}, {threads} threads", mesh.label);
            let unit = Unit::NsEach(mesh.triangle_count());
            all.push(measure(&title, unit, group(mesh, threads)));
        }
    }
    if is_asked("build") {
        print_costs(mesh);
    }
    all
}

fn triangles(mesh: &Mesh) -> Vec<Triangle> {
    mesh.triangles(mesh.start())
}

/// Builds on `threads`; beside those ours on fewer, of which the scaling follows.
fn builds(mesh: &Mesh, threads: usize) -> Vec<Contender<'_>> {
    let mut contenders = others::builds(&triangles(mesh), threads);
    for threads in thread_counts().into_iter().filter(|&n| n <= threads) {
        contenders.push(record(mesh, threads));
        contenders.push(traceable(mesh, threads));
    }
    contenders
}

/// Vertices at hand to a tree that rays can be traced by, of the same shape as before.
fn refits(mesh: &Mesh, threads: usize) -> Vec<Contender<'_>> {
    let mut contenders = others::refits(&triangles(mesh), threads);
    let mut tracer = Tracer::ready(mesh, METHOD, threads);
    contenders.push(Contender::new("abvh", threads, move || {
        tracer.refit();
        0
    }));
    contenders
}

/// Trees to what devices take.
fn conversions(mesh: &Mesh, threads: usize) -> Vec<Contender<'_>> {
    let contender = |name, convert: fn(&mut Ours, &Mesh) -> usize| {
        let pool = pool(threads);
        let mut ours = built(mesh, &pool);
        Contender::new(name, threads, move || {
            pool.install(|| convert(&mut ours, mesh));
            0
        })
    };
    vec![
        contender("abvh, a record", |ours, mesh| ours.convert(mesh).bytes()),
        contender("abvh, treelets", |ours, _| ours.treelets().bytes()),
    ]
}

/// Build and conversion: what the pipeline's builder thread hands over.
fn record(mesh: &Mesh, threads: usize) -> Contender<'_> {
    let positions = mesh.positions(mesh.start());
    let (mut ours, pool) = (Ours::default(), pool(threads));
    Contender::new("abvh, build and convert", threads, move || {
        pool.install(|| ours.make(mesh, &positions).bytes());
        0
    })
}

/// All that is done until rays can be asked on this machine.
fn traceable(mesh: &Mesh, threads: usize) -> Contender<'_> {
    let positions = mesh.positions(mesh.start());
    let (mut ours, pool) = (Ours::default(), pool(threads));
    let mut tracer = Tracer::new(mesh, METHOD, threads);
    Contender::new("abvh, build to rays", threads, move || {
        let record = pool.install(|| {
            ours.make(mesh, &positions);
            ours.take_record_with_blocks(mesh, &positions)
        });
        tracer.adopt(&record);
        tracer.refit();
        0
    })
}

/// What the trees are worth, and the bytes of ours.
fn print_costs(mesh: &Mesh) {
    let ours = built(mesh, &pool(1));
    let own = ours.sah_cost(mesh, &mesh.positions(mesh.start()));
    let row = |name: &str, cost: f64, nodes: usize| {
        let [cost, ratio] = [format!("{cost:.2}"), format!("{:.3}", cost / own)];
        vec![name.to_owned(), cost, ratio, nodes.to_string()]
    };
    let mut rows = vec![row("abvh", own, ours.record().node_count())];
    for tree in built_rivals(&triangles(mesh), &pool(1)) {
        let nodes = tree.nodes();
        rows.push(row(tree.name(), sah_cost(&nodes), nodes.len()));
    }
    let each = |bytes: usize| bytes as f64 / mesh.triangle_count() as f64;
    let (record, treelets) = (each(ours.record().bytes()), each(ours.treelets().bytes()));
    let title = format!(
        "{}: surface area cost (traversal 1, intersection 1); a record of abvh has {record:.3} bytes a triangle, treelets {treelets:.3}",
        mesh.label
    );
    print_table(&title, "tree|cost|to abvh's|nodes", rows);
}
