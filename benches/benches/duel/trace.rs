//! Ray tracing, with hits written to memory of the caller.

use crate::{INTERSECTOR, Unit, embree, group};
use backend::QueryKind::{Any, Closest};
use backend::{Query, QueryKind, Rays};
use benches::{
    Contender, EmbreeScene, Mesh, Packet16, SceneMode, Tracer, blocks, camera, diffuse_rays, light,
    pool, random_rays, setting, shadow_rays, thread_counts,
};
use geom::{Camera, Hit, Ray};
use rayon::ThreadPool;
use rayon::prelude::*;
use serde_json::Value;

/// Number of random rays.
const RANDOM: usize = 1 << 17;
/// Number of rays per Embree task, a multiple of the packet size.
const TASK: usize = 512;

/// Inputs of all contenders.
struct Stage<'a> {
    mesh: &'a Mesh,
    threads: usize,
    pool: ThreadPool,
    /// Embree's scenes: fast, and robust.
    scenes: [EmbreeScene; 2],
}

/// Rays and the kind of query.
struct Asked {
    rays: Vec<Ray>,
    packets: Vec<Packet16>,
    kind: QueryKind,
}

impl Asked {
    /// `coherent` states that each run of sixteen rays is close together.
    fn new(rays: Vec<Ray>, coherent: bool, kind: QueryKind) -> Self {
        let packets = rays.chunks(16);
        let packets = packets.map(|rays| Packet16::new(rays, coherent)).collect();
        Self {
            rays,
            packets,
            kind,
        }
    }
}

/// Measures the selected groups of a mesh.
pub(crate) fn all(mesh: &Mesh, is_asked: &dyn Fn(&str) -> bool) -> Vec<Value> {
    let most = thread_counts().into_iter().max().unwrap_or(1);
    let width = setting("ABVH_WIDTH", 1920) as u32;
    let camera = camera(mesh, [width, width * 5 / 8]);
    let primary = blocks(&camera, [4, 4]);
    let mut tracer = Tracer::ready(mesh, INTERSECTOR, most);
    let asked = |what| match what {
        "primary" => Asked::new(primary.clone(), true, Closest),
        "shadow" => Asked::new(shadow_rays(mesh, &primary, &mut tracer), true, Any),
        "diffuse" => Asked::new(diffuse_rays(mesh, &primary, &mut tracer), false, Closest),
        "random" => Asked::new(random_rays(mesh, RANDOM), false, Closest),
        _ => Asked::new(random_rays(mesh, RANDOM), false, Any),
    };
    let kinds = ["primary", "shadow", "diffuse", "random", "random-any"];
    let kinds = kinds.into_iter().filter(|what| is_asked(what));
    let asked: Vec<(&str, Asked)> = kinds.clone().zip(kinds.map(asked)).collect();
    let both = QueryKind::ClosestAndShadow { light: light(mesh) };
    let mut groups = Vec::new();
    for threads in thread_counts() {
        let stage = Stage::new(mesh, threads);
        for (what, asked) in &asked {
            let camera = (*what == "primary").then_some((&camera, Closest));
            groups.push(stage.measure(what, &[asked], camera));
        }
        if is_asked("primary-and-shadow") {
            let is_either = |what| ["primary", "shadow"].contains(what);
            let asked = asked.iter().filter(|(what, _)| is_either(what));
            let asked: Vec<_> = asked.map(|(_, asked)| asked).collect();
            groups.push(stage.measure("primary-and-shadow", &asked, Some((&camera, both))));
        }
    }
    groups
}

impl<'a> Stage<'a> {
    fn new(mesh: &'a Mesh, threads: usize) -> Self {
        Self {
            mesh,
            threads,
            pool: pool(threads),
            scenes: [SceneMode::Fast, SceneMode::Robust].map(|made| embree(mesh, threads, made)),
        }
    }

    /// Measures how long each contender takes to trace all of `asked`. If `camera` generates the same rays, it is
    /// measured too.
    fn measure(&self, what: &str, asked: &[&Asked], camera: Option<(&Camera, QueryKind)>) -> Value {
        let [fast, robust] = &self.scenes;
        let mut contenders = vec![
            self.embree("Embree 4, single rays", (fast, false), asked),
            self.embree("Embree 4 robust, single rays", (robust, false), asked),
            self.embree("Embree 4, packets of 16", (fast, true), asked),
            self.embree("Embree 4 robust, packets of 16", (robust, true), asked),
            self.listed(asked),
        ];
        contenders.extend(camera.map(|(camera, kind)| self.seen(camera, kind)));
        let rays = asked.iter().map(|asked| asked.rays.len()).sum();
        let title = format!("{}: {what} rays, {} threads", self.mesh.label, self.threads);
        group(&title, Unit::MillionsOf(rays), contenders)
    }

    fn listed<'b>(&self, asked: &'b [&Asked]) -> Contender<'b> {
        let mut tracer = Tracer::ready(self.mesh, INTERSECTOR, self.threads);
        let mut trace = move |asked: &Asked| {
            let (rays, kind) = (Rays::List(&asked.rays), asked.kind);
            tracer.trace(Query { rays, kind })
        };
        Contender::new("abvh, lists", self.threads, move || {
            asked.iter().map(|asked| trace(asked)).sum()
        })
    }

    fn seen<'b>(&self, camera: &'b Camera, kind: QueryKind) -> Contender<'b> {
        let mut tracer = Tracer::ready(self.mesh, INTERSECTOR, self.threads);
        let rays = Rays::Camera(camera);
        Contender::new("abvh, a camera", self.threads, move || {
            tracer.trace(Query { rays, kind })
        })
    }

    /// Returns an Embree contender that traces single rays or packets. Tasks write closest hits, or zeros and ones for
    /// any-hit queries.
    fn embree<'b>(
        &'b self,
        name: &str,
        (scene, by_packets): (&'b EmbreeScene, bool),
        asked: &'b [&Asked],
    ) -> Contender<'b> {
        let most = asked.iter().map(|asked| asked.rays.len()).max();
        let mut hits = vec![Hit::MISS; most.unwrap_or(0)];
        let mut met = vec![0; hits.len()];
        let mut trace = move |asked: &Asked| -> u64 {
            let count = asked.rays.len();
            let rays = |task: usize| &asked.rays[task * TASK..];
            let packets = |task: usize| &asked.packets[task * TASK / 16..];
            if asked.kind == Any {
                let tasks = met[..count].par_chunks_mut(TASK).enumerate();
                let task = |(task, out): (usize, &mut [u8])| {
                    match by_packets {
                        true => scene.occluded_packets(packets(task), out),
                        false => scene.occluded(rays(task), out),
                    }
                    out.iter().map(|&met| u64::from(met)).sum::<u64>()
                };
                return tasks.map(task).sum();
            }
            let tasks = hits[..count].par_chunks_mut(TASK).enumerate();
            let task = |(task, out): (usize, &mut [Hit])| {
                match by_packets {
                    true => scene.closest_packets(packets(task), out),
                    false => scene.closest(rays(task), out),
                }
                out.iter().filter(|hit| hit.is_hit()).count() as u64
            };
            tasks.map(task).sum()
        };
        Contender::new(name, self.threads, move || {
            self.pool
                .install(|| asked.iter().map(|asked| trace(asked)).sum())
        })
    }
}
