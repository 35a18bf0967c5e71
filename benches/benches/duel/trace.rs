//! Rays to hits, on all threads.

use crate::{METHOD, Unit, report};
use backend::{Query, QueryKind, Rays};
use benches::{
    Contender, EmbreeScene, Mesh, Packet16, Tracer, camera, in_turn, light, pool, random_rays,
    shadow_rays, thread_counts,
};
use geom::{Camera, Ray};
use rayon::ThreadPool;
use rayon::prelude::*;
use serde_json::Value;

const ROUNDS: usize = 31;
/// Rays that one task of Embree's traces, a multiple of a packet's.
const TASK: usize = 512;

/// What contenders are made of.
struct Stage<'a> {
    mesh: &'a Mesh,
    threads: usize,
    pool: &'a ThreadPool,
    /// Embree's: fast, and robust.
    scenes: [&'a EmbreeScene; 2],
}

/// Rays, and what is asked of them.
struct Asked<'a> {
    rays: &'a [Ray],
    packets: &'a [Packet16],
    any: bool,
}

/// The groups of a mesh that are asked for.
pub(crate) fn all(mesh: &Mesh, is_asked: &dyn Fn(&str) -> bool) -> Vec<Value> {
    let threads = thread_counts().pop().unwrap_or(1);
    let pool = pool(threads);
    let triangles = mesh.triangles(mesh.start());
    let scenes = [false, true].map(|robust| EmbreeScene::new(&triangles, threads, robust));
    let stage = Stage {
        mesh,
        threads,
        pool: &pool,
        scenes: scenes.each_ref(),
    };
    let camera = camera(mesh);
    let primary = camera.rays().collect::<Vec<_>>();
    let shadow = shadow_rays(mesh, &primary, &mut stage.tracer());
    let random = random_rays(mesh);
    let asked = |rays, packets, any| Asked { rays, packets, any };
    let (squares, packets) = (squares(&primary, &camera), in_order(&shadow, true));
    let primary = asked(&primary, &squares, false);
    let shadow = asked(&shadow, &packets, true);
    let packets = in_order(&random, false);
    let closest = asked(&random, &packets, false);
    let any = asked(&random, &packets, true);
    let both = QueryKind::ClosestAndShadow { light: light(mesh) };
    let groups: [Group<'_>; 5] = [
        ("primary", &[&primary], Some(QueryKind::Closest)),
        ("shadow", &[&shadow], None),
        ("primary-and-shadow", &[&primary, &shadow], Some(both)),
        ("random", &[&closest], None),
        ("random-any", &[&any], None),
    ];
    let groups = groups.iter().filter(|(what, ..)| is_asked(what));
    groups
        .map(|(what, asked, seen)| stage.measure(what, asked, seen.map(|kind| (&camera, kind))))
        .collect()
}

/// Name, rays, and what is asked of the camera that makes the same ones.
type Group<'a> = (&'a str, &'a [&'a Asked<'a>], Option<QueryKind>);

impl Stage<'_> {
    /// Our own backend with a fresh tree.
    fn tracer(&self) -> Tracer {
        Tracer::ready(self.mesh, METHOD, self.threads)
    }

    /// All contenders trace all of `asked`; ours a camera's rays too, if there is one that sees the same.
    fn measure(
        &self,
        what: &str,
        asked: &[&Asked<'_>],
        camera: Option<(&Camera, QueryKind)>,
    ) -> Value {
        let [fast, robust] = self.scenes;
        let mut contenders = vec![
            self.singly("Embree 3, single rays", fast, asked),
            self.singly("Embree 3 robust, single rays", robust, asked),
            self.together("Embree 3, packets of 16", fast, asked),
            self.together("Embree 3 robust, packets of 16", robust, asked),
            self.listed(asked),
        ];
        contenders.extend(camera.map(|(camera, kind)| self.seen(camera, kind)));
        let samples = in_turn(contenders, ROUNDS);
        let rays = asked.iter().map(|asked| asked.rays.len()).sum();
        let title = format!("{}: {what} rays", self.mesh.label);
        report(&title, Unit::MillionsOf(rays), &samples)
    }

    fn listed<'b>(&self, asked: &'b [&Asked<'b>]) -> Contender<'b> {
        let mut tracer = self.tracer();
        let mut trace = move |asked: &Asked<'_>| {
            let rays = Rays::List(asked.rays);
            let kind = if asked.any {
                QueryKind::Any
            } else {
                QueryKind::Closest
            };
            tracer.trace(Query { rays, kind })
        };
        Contender::new("abvh, lists", self.threads, move || {
            asked.iter().map(|asked| trace(asked)).sum()
        })
    }

    fn seen<'b>(&self, camera: &'b Camera, kind: QueryKind) -> Contender<'b> {
        let mut tracer = self.tracer();
        let rays = Rays::Camera(camera);
        Contender::new("abvh, a camera", self.threads, move || {
            tracer.trace(Query { rays, kind })
        })
    }

    fn singly<'b>(
        &'b self,
        name: &str,
        scene: &'b EmbreeScene,
        asked: &'b [&Asked<'b>],
    ) -> Contender<'b> {
        self.in_tasks(name, asked, move |asked| {
            let hits = |ray: &Ray| match asked.any {
                true => scene.is_occluded(ray),
                false => scene.hits(ray),
            };
            let tasks = asked.rays.par_chunks(TASK);
            let count = |task: &[Ray]| task.iter().filter(|ray| hits(ray)).count() as u64;
            tasks.map(count).sum()
        })
    }

    fn together<'b>(
        &'b self,
        name: &str,
        scene: &'b EmbreeScene,
        asked: &'b [&Asked<'b>],
    ) -> Contender<'b> {
        self.in_tasks(name, asked, move |asked| {
            let hits = |p: &Packet16| u64::from(scene.packet_hits(p, asked.any));
            let tasks = asked.packets.par_chunks(TASK / 16);
            tasks.map(|task| task.iter().map(hits).sum::<u64>()).sum()
        })
    }

    fn in_tasks<'b>(
        &'b self,
        name: &str,
        asked: &'b [&Asked<'b>],
        trace: impl Fn(&Asked<'_>) -> u64 + Send + Sync + 'b,
    ) -> Contender<'b> {
        Contender::new(name, self.threads, move || {
            let all = || asked.iter().map(|asked| trace(asked)).sum();
            self.pool.install(all)
        })
    }
}

fn in_order(rays: &[Ray], coherent: bool) -> Vec<Packet16> {
    let packets = rays.chunks(16);
    packets.map(|rays| Packet16::new(rays, coherent)).collect()
}

/// Packets of four by four pixels of a camera's rays.
fn squares(rays: &[Ray], camera: &Camera) -> Vec<Packet16> {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let square = |[x, y]: [usize; 2]| {
        let rows = y..(y + 4).min(height);
        let rays: Vec<Ray> = rows
            .flat_map(|y| &rays[y * width + x..y * width + (x + 4).min(width)])
            .copied()
            .collect();
        Packet16::new(&rays, true)
    };
    let rows = (0..height).step_by(4);
    let corners = rows.flat_map(|y| (0..width).step_by(4).map(move |x| [x, y]));
    corners.map(square).collect()
}
