//! Tree builds and refits.

use crate::{INTERSECTOR, Unit, embree, group};
use benches::{Contender, Mesh, Ours, SceneMode, Tracer, pool, thread_counts};
use rayon::ThreadPool;
use serde_json::Value;

/// Measures builds on `threads` threads, and our builds on fewer threads, to show how they scale.
pub(crate) fn times(mesh: &Mesh, threads: usize) -> Value {
    let counts = thread_counts().into_iter().filter(|&n| n <= threads);
    let pools: Vec<_> = counts.map(|n| (n, pool(n))).collect();
    let mut embree = embree(mesh, threads, SceneMode::Fast);
    let mut contenders = vec![Contender::new("Embree 4, medium", threads, || {
        embree.rebuild();
        0
    })];
    for (threads, pool) in &pools {
        contenders.push(record(mesh, *threads, pool));
        contenders.push(traceable(mesh, *threads, pool));
    }
    let title = format!("{}: build, {threads} threads", mesh.label);
    group(&title, Unit::NsEach(mesh.triangle_count()), contenders)
}

/// Measures refits: from vertices in memory to a traceable tree of unchanged topology.
pub(crate) fn refits(mesh: &Mesh, threads: usize) -> Value {
    let mut embree = embree(mesh, threads, SceneMode::Refitted);
    let theirs = Contender::new("Embree 4", threads, || {
        embree.rebuild();
        0
    });
    let mut tracer = Tracer::ready(mesh, INTERSECTOR, threads);
    let ours = Contender::new("abvh", threads, || {
        tracer.refit();
        0
    });
    let title = format!("{}: refit, {threads} threads", mesh.label);
    let unit = Unit::NsEach(mesh.triangle_count());
    group(&title, unit, vec![theirs, ours])
}

/// Build and conversion: the work of the pipeline's builder thread.
fn record<'a>(mesh: &'a Mesh, threads: usize, pool: &'a ThreadPool) -> Contender<'a> {
    let positions = mesh.positions(mesh.start());
    let mut ours = Ours::default();
    Contender::new("abvh, build and convert", threads, move || {
        pool.install(|| ours.make(mesh, &positions).bytes());
        0
    })
}

/// All work until rays can be traced on this machine.
fn traceable<'a>(mesh: &'a Mesh, threads: usize, pool: &'a ThreadPool) -> Contender<'a> {
    let positions = mesh.positions(mesh.start());
    let mut ours = Ours::default();
    let mut tracer = Tracer::new(mesh, INTERSECTOR, threads);
    Contender::new("abvh, build to rays", threads, move || {
        let record = pool.install(|| ours.make_with_blocks(mesh, &positions));
        tracer.adopt(&record);
        tracer.refit();
        0
    })
}
