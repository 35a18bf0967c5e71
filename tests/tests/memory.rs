//! Memory of a process that traces step after step. It must not grow, whether steps are submitted, dropped or refused.
//!
//! Tests run one at a time, because they share the process. `ABVH_FULL=1` takes 20,000 steps of all kinds.

use abvh::{Device, Mesh, MeshId, Query, Ray, Scene, Source, Tracer};
use integration::stage::vast_camera;
use integration::{device_trial, ignored_if, is_full};
use libtest_mimic::Arguments;
use std::io::Write;

/// Bytes by which the process may grow, because allocators and drivers keep some memory for reuse.
const SLACK: usize = 12 << 20;
/// Rays of a query. A leaked result would take 16 bytes per ray.
const RAYS: usize = 4_000;
const SHEET: [[f32; 3]; 3] = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]];

/// How a step ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Read,
    Unread,
    Dropped,
    Begun,
    Refused,
}

const ALL: [End; 6] = [
    End::Read,
    End::Dropped,
    End::Refused,
    End::Begun,
    End::Unread,
    End::Dropped,
];

const ENDS: [(&str, &[End]); 5] = [
    ("submitted_steps", &[End::Read, End::Unread]),
    ("steps_dropped_after_queries", &[End::Dropped]),
    ("steps_begun_and_dropped", &[End::Begun]),
    ("steps_with_refused_queries", &[End::Refused]),
    ("steps_of_all_kinds", &ALL),
];

struct Moving {
    tracer: Tracer,
    mesh: MeshId,
    rays: Vec<Ray>,
}

impl Moving {
    fn new(device: &Device) -> abvh::Result<Self> {
        let mut scene = Scene::new();
        let mesh = scene.add(Mesh::streamed(&SHEET, &[[0, 1, 2]])?);
        let ray = |i: usize| Ray::new([i as f32 / RAYS as f32 - 0.5, 9.0, 0.0], [0.0, -1.0, 0.0]);
        Ok(Self {
            tracer: Tracer::builder()
                .device(device.clone())
                .threads(2)
                .build(scene)?,
            mesh,
            rays: (0..RAYS).map(ray).collect(),
        })
    }

    fn step(&mut self, i: usize, end: End) -> abvh::Result<()> {
        let mut step = self.tracer.step(0.0);
        let sheet = SHEET.map(|[x, _, z]| [x, (i % 8) as f32 / 8.0, z]);
        step.vertices(self.mesh, Source::Host(&sheet))?;
        if end == End::Begun {
            return Ok(());
        }
        if end == End::Refused {
            step.trace(&vast_camera(), Query::Closest)?;
            assert!(step.submit().is_err());
            return Ok(());
        }
        let closest = step.trace(&self.rays, Query::Closest)?;
        step.trace(&self.rays, Query::Any)?;
        if end != End::Dropped {
            let done = step.submit()?;
            if end == End::Read {
                assert!(self.tracer.hits(done, closest)?.is_hit(RAYS / 2));
            }
        }
        Ok(())
    }
}

/// Returns the resident bytes of the process, or `None` if the operating system does not report them.
fn resident() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: usize = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kilobytes << 10)
}

fn stays_flat(device: &Device, ends: &[End]) {
    let mut live = Moving::new(device).unwrap();
    let is_long = is_full() && ends.len() == ALL.len();
    let steps = if is_long { 20_000 } else { 600 };
    let mut before = None;
    for i in 0..steps + 200 {
        if i == 200 {
            before = resident();
        }
        live.step(i, ends[i % ends.len()]).unwrap();
    }
    let (before, after) = before.zip(resident()).unwrap_or_default();
    let mut out = std::io::stdout();
    let course = format!("{before} bytes, {after} after {steps} steps");
    writeln!(out, "{device:?}, {ends:?}: {course}").unwrap();
    assert!(after <= before + SLACK, "{course}");
}

fn main() {
    let unknown = match resident() {
        Some(_) => None,
        None => Some("the operating system does not report memory"),
    };
    let mut trials = Vec::new();
    for (name, device, absent) in integration::devices() {
        for (kind, ends) in ENDS {
            let device = device.clone();
            let full_name = format!("{name}::{kind}_do_not_leak_memory");
            let trial = device_trial(full_name, name, absent.clone(), move || {
                stays_flat(&device, ends);
            });
            trials.push(ignored_if(trial, unknown));
        }
    }
    let arguments = Arguments {
        test_threads: Some(1),
        ..integration::arguments()
    };
    libtest_mimic::run(&arguments, trials).exit();
}
