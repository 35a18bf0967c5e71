//! Rays to hits, written where the caller wants them.

use crate::others::Others;
use crate::{METHOD, Unit, measure};
use backend::QueryKind::{Any, Closest};
use backend::{Query, QueryKind, Rays};
use benches::{
    Contender, Mesh, Tracer, blocks, camera, diffuse_rays, light, random_rays, setting,
    shadow_rays, thread_counts,
};
use geom::{Camera, Ray};
use serde_json::Value;

/// Rays in no order.
const RANDOM: usize = 1 << 17;
/// Rays that one task of others traces, a multiple of a packet's.
pub(crate) const TASK: usize = 512;
/// Other crates take long.
const WIDTH: usize = if cfg!(feature = "embree") { 1920 } else { 512 };

/// Rays, and what is asked of them.
pub(crate) struct Asked {
    what: &'static str,
    pub(crate) rays: Vec<Ray>,
    pub(crate) kind: QueryKind,
}

impl Asked {
    /// Whether they lie close together, sixteen by sixteen.
    pub(crate) fn is_coherent(&self) -> bool {
        matches!(self.what, "primary" | "shadow")
    }
}

/// The groups of a mesh that are asked for.
pub(crate) fn all(mesh: &Mesh, is_asked: &dyn Fn(&str) -> bool) -> Vec<Value> {
    let most = thread_counts().into_iter().max().unwrap_or(1);
    let width = setting("ABVH_WIDTH", WIDTH) as u32;
    let camera = camera(mesh, [width, width * 5 / 8]);
    let primary = blocks(&camera, [4, 4]);
    let mut tracer = Tracer::ready(mesh, METHOD, most);
    let asked = |what| {
        let (rays, kind) = match what {
            "primary" => (primary.clone(), Closest),
            "shadow" => (shadow_rays(mesh, &primary, &mut tracer), Any),
            "diffuse" => (diffuse_rays(mesh, &primary, &mut tracer), Closest),
            "random" => (random_rays(mesh, RANDOM), Closest),
            _ => (random_rays(mesh, RANDOM), Any),
        };
        Asked { what, rays, kind }
    };
    let kinds = ["primary", "shadow", "diffuse", "random", "random-any"].into_iter();
    let asked: Vec<Asked> = kinds.filter(|what| is_asked(what)).map(asked).collect();
    let both = QueryKind::ClosestAndShadow { light: light(mesh) };
    let mut groups = Vec::new();
    for threads in thread_counts() {
        let others = Others::new(&mesh.triangles(mesh.start()), threads);
        let group = |what: &str, asked: &[&Asked], camera: Option<(&Camera, QueryKind)>| {
            let mut contenders = others.contenders(asked);
            contenders.push(listed(mesh, threads, asked));
            contenders.extend(camera.map(|camera| seen(mesh, threads, camera)));
            let rays = asked.iter().map(|asked| asked.rays.len()).sum();
            let title = format!("{}: {what} rays, {threads} threads", mesh.label);
            measure(&title, Unit::MillionsOf(rays), contenders)
        };
        for one in &asked {
            let camera = (one.what == "primary").then_some((&camera, Closest));
            groups.push(group(one.what, &[one], camera));
        }
        if is_asked("primary-and-shadow") {
            let both_of: Vec<_> = asked.iter().filter(|one| one.is_coherent()).collect();
            groups.push(group("primary-and-shadow", &both_of, Some((&camera, both))));
        }
    }
    groups
}

fn listed<'a>(mesh: &Mesh, threads: usize, asked: &'a [&Asked]) -> Contender<'a> {
    let mut tracer = Tracer::ready(mesh, METHOD, threads);
    let mut trace = move |asked: &Asked| {
        let (rays, kind) = (Rays::List(&asked.rays), asked.kind);
        tracer.trace(Query { rays, kind })
    };
    Contender::new("abvh, lists", threads, move || {
        asked.iter().map(|asked| trace(asked)).sum()
    })
}

/// A camera that sees the same.
fn seen<'a>(mesh: &Mesh, threads: usize, (camera, kind): (&'a Camera, QueryKind)) -> Contender<'a> {
    let mut tracer = Tracer::ready(mesh, METHOD, threads);
    let rays = Rays::Camera(camera);
    Contender::new("abvh, a camera", threads, move || {
        tracer.trace(Query { rays, kind })
    })
}
