//! Memory of a process that traces step after step. It must not grow, whether steps are submitted, dropped or refused.
//!
//! Tests run one at a time, because they share the process. `ABVH_FULL=1` takes 20,000 steps.

use abvh::{Device, Mesh, MeshId, Query, Ray, Scene, Source, Tracer};
use host::resident;
use integration::stage::vast_camera;
use integration::{device_trial, ignored_if, is_full};
use libtest_mimic::Arguments;

/// Bytes by which the process may grow, because allocators and drivers keep some memory for reuse.
const SLACK: u64 = 12 << 20;
/// Rays of a query. A leaked result would take 16 bytes per ray.
const RAYS: usize = 4_000;
const SHEET: [[f32; 3]; 3] = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]];

/// How a step ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Read,
    Unread,
    DroppedAfterQueries,
    DroppedBeforeQueries,
    Refused,
}

/// How steps end, one after the other.
const ENDS: [End; 6] = [
    End::Read,
    End::DroppedAfterQueries,
    End::Refused,
    End::DroppedBeforeQueries,
    End::Unread,
    End::DroppedAfterQueries,
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
        if end == End::DroppedBeforeQueries {
            return Ok(());
        }
        if end == End::Refused {
            step.trace(&vast_camera(), Query::Closest)?;
            assert!(step.submit().is_err());
            return Ok(());
        }
        let closest = step.trace(&self.rays, Query::Closest)?;
        step.trace(&self.rays, Query::Any)?;
        if end != End::DroppedAfterQueries {
            let done = step.submit()?;
            if end == End::Read {
                assert!(self.tracer.hits(done, closest)?.is_hit(RAYS / 2));
            }
        }
        Ok(())
    }
}

fn stays_flat(device: &Device) {
    let mut live = Moving::new(device).unwrap();
    let steps = if is_full() { 20_000 } else { 1500 };
    let mut before = None;
    for i in 0..steps + 200 {
        if i == 200 {
            before = resident();
        }
        live.step(i, ENDS[i % ENDS.len()]).unwrap();
    }
    let (before, after) = before.zip(resident()).unwrap_or_default();
    assert!(
        after <= before + SLACK,
        "{before} bytes, {after} after {steps} steps"
    );
}

fn main() {
    let unknown = match resident() {
        Some(_) => None,
        None => Some("the operating system does not report memory"),
    };
    let trial = |(name, device, absent): (&'static str, Device, Option<String>)| {
        let full_name = format!("{name}::steps_do_not_leak_memory");
        let trial = device_trial(full_name, name, absent, move || stays_flat(&device));
        ignored_if(trial, unknown)
    };
    let trials = integration::devices().map(trial).into();
    let arguments = Arguments {
        test_threads: Some(1),
        ..integration::arguments()
    };
    libtest_mimic::run(&arguments, trials).exit();
}
