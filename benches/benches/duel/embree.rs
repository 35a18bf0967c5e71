//! Embree 4 as a contender.

use crate::trace::{Asked, TASK};
use backend::QueryKind;
use benches::{Contender, EmbreeScene, Made, Packet16, pool};
use geom::{Hit, Ray, Triangle};
use rayon::ThreadPool;
use rayon::prelude::*;
use std::borrow::Cow;

pub(crate) fn builds(triangles: &[Triangle], threads: usize) -> Vec<Contender<'static>> {
    vec![commits("Embree 4, medium", triangles, threads, Made::Fast)]
}

pub(crate) fn refits(triangles: &[Triangle], threads: usize) -> Vec<Contender<'static>> {
    vec![commits("Embree 4", triangles, threads, Made::Refitted)]
}

fn commits(name: &str, triangles: &[Triangle], threads: usize, made: Made) -> Contender<'static> {
    let mut scene = EmbreeScene::new(triangles, threads, made);
    Contender::new(name, threads, move || {
        scene.rebuild();
        0
    })
}

/// What rays are traced through.
pub(crate) struct Others {
    fast: EmbreeScene,
    robust: EmbreeScene,
    threads: usize,
    pool: ThreadPool,
}

impl Others {
    pub(crate) fn new(triangles: &[Triangle], threads: usize) -> Self {
        Self {
            fast: EmbreeScene::new(triangles, threads, Made::Fast),
            robust: EmbreeScene::new(triangles, threads, Made::Robust),
            threads,
            pool: pool(threads),
        }
    }

    pub(crate) fn contenders<'a>(&'a self, asked: &'a [&Asked]) -> Vec<Contender<'a>> {
        vec![
            self.singly("Embree 4, single rays", &self.fast, asked),
            self.singly("Embree 4 robust, single rays", &self.robust, asked),
            self.together("Embree 4, packets of 16", &self.fast, asked),
            self.together("Embree 4 robust, packets of 16", &self.robust, asked),
        ]
    }

    fn singly<'a>(
        &'a self,
        name: &str,
        scene: &'a EmbreeScene,
        asked: &'a [&Asked],
    ) -> Contender<'a> {
        let work = |asked: &&'a Asked| (Cow::Borrowed(&asked.rays[..]), asked.kind);
        let closest = move |ray: &Ray, out: &mut [Hit]| out[0] = scene.closest(ray);
        let any = move |ray: &Ray, out: &mut [u8]| out[0] = u8::from(scene.is_occluded(ray));
        let work = asked.iter().map(work).collect();
        self.in_tasks::<_, 1>(name, work, (closest, any))
    }

    fn together<'a>(
        &'a self,
        name: &str,
        scene: &'a EmbreeScene,
        asked: &'a [&Asked],
    ) -> Contender<'a> {
        let work = |asked: &&Asked| {
            let packets = asked.rays.chunks(16);
            let packets = packets.map(|rays| Packet16::new(rays, asked.is_coherent()));
            (Cow::Owned(packets.collect()), asked.kind)
        };
        let closest = move |packet: &Packet16, out: &mut [Hit]| scene.packet_closest(packet, out);
        let any = move |packet: &Packet16, out: &mut [u8]| scene.packet_occluded(packet, out);
        let work = asked.iter().map(work).collect();
        self.in_tasks::<_, 16>(name, work, (closest, any))
    }

    /// Tasks write what they find, `closest` hits or by `any` ones and zeros, of `LANES` rays at a time.
    fn in_tasks<'a, T: Clone + Sync, const LANES: usize>(
        &'a self,
        name: &str,
        work: Vec<(Cow<'a, [T]>, QueryKind)>,
        (closest, any): (
            impl Fn(&T, &mut [Hit]) + Send + Sync + 'a,
            impl Fn(&T, &mut [u8]) + Send + Sync + 'a,
        ),
    ) -> Contender<'a> {
        let most = work.iter().map(|(items, _)| items.len() * LANES).max();
        let mut hits = vec![Hit::MISS; most.unwrap_or(0)];
        let mut met = vec![0_u8; hits.len()];
        Contender::new(name, self.threads, move || {
            let mut trace = |(items, kind): &(Cow<'_, [T]>, QueryKind)| match kind {
                QueryKind::Any => trace::<_, _, LANES>(items, &mut met, &any, |&met| met != 0),
                _ => trace::<_, _, LANES>(items, &mut hits, &closest, Hit::is_hit),
            };
            self.pool.install(|| work.iter().map(&mut trace).sum())
        })
    }
}

/// The number of hits.
fn trace<T: Sync, O: Send, const LANES: usize>(
    items: &[T],
    out: &mut [O],
    ask: impl Fn(&T, &mut [O]) + Sync,
    is_hit: impl Fn(&O) -> bool + Sync,
) -> u64 {
    let out = out[..items.len() * LANES].par_chunks_mut(TASK);
    let task = |(items, out): (&[T], &mut [O])| {
        for (item, out) in items.iter().zip(out.chunks_mut(LANES)) {
            ask(item, out);
        }
        out.iter().filter(|out| is_hit(out)).count() as u64
    };
    items.par_chunks(TASK / LANES).zip(out).map(task).sum()
}
