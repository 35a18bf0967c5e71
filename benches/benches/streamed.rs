//! Steps of the library: compares vertices that arrive in each step with key frames known in advance, for the same
//! motion.
//!
//! `cargo bench -p benches --bench streamed [-- DEVICE...]`, where a device is `auto`, `cpu`, `vulkan` or `wgpu`. Also
//! prints the slowest of many steps (`ABVH_STEPS=10000`), and steps while a mesh is replaced (`ABVH_REPLACEMENTS=5`).

use abvh::own_device::wgpu;
use abvh::{Device, Mesh, MeshId, Point, Query, Scene, Source, Tracer};
use benches::{
    Mesh as Motion, STEP_SCENES, camera, criterion, device, filled_buffer, own_device, print_table,
    setting, words,
};
use criterion::{BenchmarkId, Criterion, Throughput};
use std::time::{Duration, Instant};

/// Number of steps per key frame interval, and number of intervals that are played forwards and backwards.
const STEPS: usize = 64;
const KEYS: usize = 2;
/// Scene that is traced while a mesh is replaced, and that mesh: 1.6 million triangles together.
const LARGE: [&str; 2] = ["demo:collide:1350000", "demo:twist:250000"];
/// Number of steps measured after a mesh was replaced.
const AFTER: usize = 50;
/// Image size of a step's camera.
const SIZE: [u32; 2] = [640, 480];

fn main() {
    let mut criterion = criterion();
    let mut devices: Vec<Device> = words().map(|name| device(&name)).collect();
    if devices.is_empty() {
        devices.push(Device::Auto);
    }
    let mut worst = Vec::new();
    for scene in STEP_SCENES {
        let motion = Motion::open(scene).expect("demos open");
        for device in &devices {
            compare(&mut criterion, &motion, device);
            worst.extend(stalls(&motion, device));
        }
    }
    let header = "scene|device|vertices|median ms|99 %|worst";
    print_table("Single steps", header, worst);
    let rows = devices.iter().flat_map(replacements).collect();
    let header = "device|vertices|a mesh is|median ms|99 %|worst";
    print_table("Steps while a mesh is replaced", header, rows);
    criterion.final_summary();
}

/// A motion played forwards and backwards, and its tracer.
struct Player {
    tracer: Tracer,
    camera: abvh::Camera,
    /// Vertices of each step, unless key frames are used.
    streamed: Option<(MeshId, Vec<Vec<Point>>)>,
    /// The same vertices in buffers of wgpu, if they are passed there.
    buffers: Vec<wgpu::Buffer>,
    /// True if vertices are written directly to memory that the device reads. The write is the program's work and is
    /// not measured.
    in_place: bool,
    step: usize,
}

/// Source of a mesh's positions.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Keys,
    Streamed,
    InPlace,
    OnDevice,
}

impl Kind {
    /// Returns the kinds that a device supports.
    fn of(device: &Device) -> &'static [Self] {
        let all = &[Self::Keys, Self::Streamed, Self::InPlace, Self::OnDevice];
        match device {
            Device::Wgpu(_) => all,
            _ => &all[..3],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Keys => "key frames",
            Self::Streamed => "streamed",
            Self::InPlace => "in place",
            Self::OnDevice => "on the device",
        }
    }
}

impl Player {
    /// Adds the motion to `scene`, which may contain other meshes.
    fn new(mut scene: Scene, motion: &Motion, device: &Device, kind: Kind) -> Self {
        let animation = &motion.animation;
        let streamed = if kind != Kind::Keys {
            let times = (0..=STEPS * KEYS).map(|i| i as f64 / STEPS as f64);
            let frames: Vec<_> = times.map(|t| motion.positions(animation.pose(t))).collect();
            let mesh = Mesh::streamed(&frames[0], animation.triangles());
            Some((scene.add(mesh.expect("it is a mesh")), frames))
        } else {
            let keys = animation.all_keys().expect("a demo has them all");
            let keys = keys.iter().map(|key| key.to_vec()).collect();
            scene.add(Mesh::keyframes(keys, animation.triangles()).expect("it is a mesh"));
            None
        };
        let mut device = device.clone();
        let mut buffers = Vec::new();
        if let (Kind::OnDevice, Some((_, frames))) = (kind, &streamed) {
            let own = own_device(&scene, (SIZE[0] * SIZE[1]) as usize);
            let buffer = |points: &Vec<Point>| {
                let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::STORAGE;
                filled_buffer(&own, bytemuck::cast_slice(points), usage)
            };
            buffers = frames.iter().map(buffer).collect();
            device = Device::from(own);
        }
        let tracer = Tracer::builder().device(device).build(scene);
        Self {
            buffers,
            tracer: tracer.expect("the device is there"),
            camera: camera(motion, SIZE),
            streamed,
            in_place: kind == Kind::InPlace,
            step: 0,
        }
    }

    /// Advances by one step and returns the time it took.
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
                let vertices = match self.buffers.get(at) {
                    Some(buffer) => Source::Wgpu(buffer.slice(..)),
                    None => Source::Host(&frames[at]),
                };
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
    for &kind in Kind::of(device) {
        let mut player = Player::new(Scene::new(), motion, device, kind);
        let device = player.tracer.device().to_owned();
        group.bench_function(BenchmarkId::new(kind.name(), device), |b| {
            b.iter_custom(|steps| (0..steps).map(|_| player.advance()).sum())
        });
    }
    group.finish();
}

/// Returns the times of many single steps, after the first hundred.
fn stalls(motion: &Motion, device: &Device) -> Vec<Vec<String>> {
    let row = |&kind: &Kind| {
        let mut player = Player::new(Scene::new(), motion, device, kind);
        let mut times = Vec::new();
        for step in 0..100 + setting("ABVH_STEPS", 1000) {
            let took = player.advance();
            if step >= 100 {
                times.push(took.as_secs_f64() * 1e3);
            }
        }
        let mut row = vec![
            motion.label.clone(),
            player.tracer.device().to_owned(),
            kind.name().to_owned(),
        ];
        row.extend(shares(times));
        row
    };
    Kind::of(device).iter().map(row).collect()
}

/// Returns the median, the 99th percentile and the maximum of `times`.
fn shares(mut times: Vec<f64>) -> [String; 3] {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    [0.5, 0.99, 1.0].map(|share| format!("{:.3}", at(share)))
}

/// Measures steps of a large scene: normally, while a mesh replacement is prepared, the commits, and the steps after
/// them.
fn replacements(device: &Device) -> Vec<Vec<String>> {
    let rounds = setting("ABVH_REPLACEMENTS", 5);
    if rounds == 0 {
        return Vec::new();
    }
    let [motion, other] = LARGE.map(|scene| Motion::open(scene).expect("demos open"));
    let vertices = other.animation.first();
    let mesh = Mesh::fixed(vertices, other.animation.triangles()).expect("it is a mesh");
    let of_kind = |kind| {
        let mut scene = Scene::new();
        let id = scene.add(mesh.clone());
        let mut player = Player::new(scene, &motion, device, kind);
        let ms = |took: Duration| took.as_secs_f64() * 1e3;
        let steps = |player: &mut Player, count| -> Vec<f64> {
            (0..count).map(|_| ms(player.advance())).collect()
        };
        steps(&mut player, 100);
        let mut times = [(); 4].map(|()| Vec::new());
        for _ in 0..rounds {
            times[0].extend(steps(&mut player, 4 * AFTER));
            let replacement = player.tracer.replace(id, mesh.clone());
            let replacement = replacement.expect("it is begun");
            while !replacement.is_ready() {
                times[1].extend(steps(&mut player, 1));
            }
            let begun = Instant::now();
            player.tracer.commit(replacement).expect("it fits");
            times[2].push(ms(begun.elapsed()));
            times[3].extend(steps(&mut player, AFTER));
        }
        let device = player.tracer.device().to_owned();
        let row = move |(what, times): (&str, Vec<f64>)| {
            let mut row = vec![device.clone(), kind.name().to_owned(), what.to_owned()];
            row.extend(shares(times));
            row
        };
        let what = ["as it was", "prepared", "committed (the call)", "replaced"];
        what.into_iter().zip(times).map(row)
    };
    let kinds = [Kind::Keys, Kind::Streamed];
    kinds.into_iter().flat_map(of_kind).collect()
}
