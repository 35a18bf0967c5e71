//! Trees of other crates as contenders.

use crate::trace::{Asked, TASK};
use backend::QueryKind;
use benches::{Contender, Rival, built_rivals, pool, rivals};
use geom::Triangle;
use rayon::ThreadPool;
use rayon::prelude::*;

pub(crate) fn builds(triangles: &[Triangle], threads: usize) -> Vec<Contender<'static>> {
    let mut trees = rivals(triangles);
    trees.retain(|tree| threads == 1 || tree.builds_in_parallel());
    at_work(trees, threads, |tree| tree.build())
}

pub(crate) fn refits(triangles: &[Triangle], threads: usize) -> Vec<Contender<'static>> {
    let mut trees = built_rivals(triangles, &pool(threads));
    trees.retain(|tree| {
        let in_parallel = tree.refits_in_parallel();
        in_parallel.is_some_and(|in_parallel| threads == 1 || in_parallel)
    });
    at_work(trees, threads, |tree| tree.refit())
}

fn at_work(
    trees: Vec<Box<dyn Rival>>,
    threads: usize,
    work: fn(&mut dyn Rival),
) -> Vec<Contender<'static>> {
    let contender = |mut tree: Box<dyn Rival>| {
        let pool = pool(threads);
        Contender::new(tree.name(), threads, move || {
            pool.install(|| work(tree.as_mut()));
            0
        })
    };
    trees.into_iter().map(contender).collect()
}

/// What rays are traced through.
pub(crate) struct Others {
    trees: Vec<Box<dyn Rival>>,
    threads: usize,
    pool: ThreadPool,
}

impl Others {
    pub(crate) fn new(triangles: &[Triangle], threads: usize) -> Self {
        let pool = pool(threads);
        Self {
            trees: built_rivals(triangles, &pool),
            threads,
            pool,
        }
    }

    pub(crate) fn contenders<'a>(&'a self, asked: &'a [&Asked]) -> Vec<Contender<'a>> {
        let contenders = self.trees.iter().map(|tree| {
            let hits = move |asked: &&Asked| {
                let tasks = asked.rays.par_chunks(TASK);
                let any = asked.kind == QueryKind::Any;
                tasks.map(|rays| tree.count(rays, any)).sum::<u64>()
            };
            Contender::new(tree.name(), self.threads, move || {
                self.pool.install(|| asked.iter().map(hits).sum())
            })
        });
        contenders.collect()
    }
}
