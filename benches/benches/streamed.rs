//! Steps of the library: vertices that arrive each step beside key frames known beforehand, over the same motion.
//!
//! `cargo bench -p benches --bench streamed [-- DEVICE...]`, a device being `auto`, `cpu`, `vulkan` or `wgpu`. A table of the worst of
//! many steps follows (`ABVH_STEPS=10000`).

use abvh::{Device, Mesh, MeshId, Point, Query, Scene, Source, Tracer};
use benches::{Mesh as Motion, camera, criterion, print_table, setting};
use criterion::{BenchmarkId, Criterion, Throughput};
use std::time::{Duration, Instant};

const SCENES: [&str; 3] = ["demo:collide:70000", "demo:collide:250000", "demo:shatter"];
/// Steps from one key frame to the next, and key frames that are gone through, to and fro.
const STEPS: usize = 8;
const KEYS: usize = 6;
/// Rays of a step's camera.
const SIZE: [u32; 2] = [640, 480];

fn main() {
    let mut criterion = criterion();
    let asked: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .collect();
    let devices = match asked.is_empty() {
        true => vec!["auto".to_owned()],
        false => asked,
    };
    let mut worst = Vec::new();
    for scene in SCENES {
        let motion = Motion::open(scene).expect("demos open");
        for name in &devices {
            let device = match &name[..] {
                "cpu" => Device::Cpu,
                "vulkan" => Device::Vulkan(None),
                "wgpu" => Device::Wgpu(None),
                _ => Device::Auto,
            };
            compare(&mut criterion, &motion, &device);
            worst.extend(stalls(&motion, &device));
        }
    }
    let header = ["scene", "device", "vertices", "median ms", "99 %", "worst"];
    print_table("Single steps", &header, worst);
    criterion.final_summary();
}

/// A motion to and fro, and a tracer that follows it.
struct Player {
    tracer: Tracer,
    camera: abvh::Camera,
    /// What arrives each step, if anything does.
    streamed: Option<(MeshId, Vec<Vec<Point>>)>,
    /// Whether it is written where the device reads it; that is the program's own work and is not counted.
    in_place: bool,
    step: usize,
}

/// How a mesh moves.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Keys,
    Streamed,
    InPlace,
}

impl Kind {
    const ALL: [Self; 3] = [Self::Keys, Self::Streamed, Self::InPlace];

    fn name(self) -> &'static str {
        match self {
            Self::Keys => "key frames",
            Self::Streamed => "streamed",
            Self::InPlace => "in place",
        }
    }
}

impl Player {
    fn new(motion: &Motion, device: &Device, kind: Kind) -> Self {
        let animation = &motion.animation;
        let mut scene = Scene::new();
        let streamed = if kind != Kind::Keys {
            let times = (0..=STEPS * KEYS).map(|i| i as f64 / STEPS as f64);
            let frames: Vec<_> = times.map(|t| motion.positions(animation.pose(t))).collect();
            let mesh = Mesh::streamed(&frames[0], animation.triangles());
            Some((scene.add(mesh.expect("it is a mesh")), frames))
        } else {
            let keys = animation
                .all_keys()
                .expect("a demo has them all")
                .into_iter();
            let keys = keys.map(|key| key.to_vec()).collect();
            scene.add(Mesh::keyframes(keys, animation.triangles()).expect("it is a mesh"));
            None
        };
        let tracer = Tracer::builder().device(device.clone()).build(scene);
        Self {
            tracer: tracer.expect("the device is there"),
            camera: camera(motion, SIZE),
            streamed,
            in_place: kind == Kind::InPlace,
            step: 0,
        }
    }

    /// Goes on by a step, and says how long it took.
    fn advance(&mut self) -> Duration {
        let turn = 2 * STEPS * KEYS;
        let at = self.step % turn;
        let at = at.min(turn - at);
        self.step += 1;
        let (begun, mut written) = (Instant::now(), Duration::ZERO);
        let mut step = self.tracer.step(at as f64 / STEPS as f64);
        match &self.streamed {
            Some((mesh, frames)) if self.in_place => {
                let to = step.vertices_mut(*mesh).expect("it is streamed");
                let writes = Instant::now();
                to.copy_from_slice(&frames[at]);
                written = writes.elapsed();
            }
            Some((mesh, frames)) => {
                let vertices = Source::Host(&frames[at]);
                step.vertices(*mesh, vertices).expect("all are there");
            }
            None => {}
        }
        step.trace(&self.camera, Query::Closest).expect("it traces");
        step.submit().expect("it traces");
        begun.elapsed() - written
    }
}

fn compare(criterion: &mut Criterion, motion: &Motion, device: &Device) {
    let mut group = criterion.benchmark_group(format!("step/{}", motion.label));
    group.throughput(Throughput::Elements(motion.triangle_count() as u64));
    for kind in Kind::ALL {
        let mut player = Player::new(motion, device, kind);
        let device = player.tracer.device().to_owned();
        group.bench_function(BenchmarkId::new(kind.name(), device), |b| {
            b.iter_custom(|steps| (0..steps).map(|_| player.advance()).sum())
        });
    }
    group.finish();
}

/// The times of many steps one by one, after the first hundred.
fn stalls(motion: &Motion, device: &Device) -> Vec<Vec<String>> {
    let row = |kind: Kind| {
        let mut player = Player::new(motion, device, kind);
        let mut times = Vec::new();
        for step in 0..100 + setting("ABVH_STEPS", 1000) {
            let took = player.advance();
            if step >= 100 {
                times.push(took.as_secs_f64() * 1e3);
            }
        }
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
        let mut row = vec![
            motion.label.clone(),
            player.tracer.device().to_owned(),
            kind.name().to_owned(),
        ];
        row.extend([0.5, 0.99, 1.0].map(|share| format!("{:.3}", at(share))));
        row
    };
    Kind::ALL.map(row).to_vec()
}
