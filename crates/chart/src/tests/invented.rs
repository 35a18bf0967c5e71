//! Invented numbers, for tests and for looking at the picture only. Nothing here was measured.

use crate::{
    Adapter, Chart, Companions, KeyFrameStep, KeyFrames, Leaks, Machine, Point, Scene, Spread,
    TError,
};

const BACKENDS: [(&str, f64); 3] = [("cpu", 60.0), ("vulkan", 1.1), ("wgpu", 1.5)];
const LAYOUTS: [(&str, f64); 2] = [("bvh2", 1.0), ("fast", 0.62)];
/// Name, cost, wrong answers per million, worst error of `t`.
const INTERSECTORS: [(&str, f64, f64, f64); 4] = [
    ("moller-trumbore", 1.0, 820.0, 900.0),
    ("woop", 0.93, 2600.0, 30_000.0),
    ("watertight", 1.12, 11.0, 6.0),
    ("exact", 1.31, 0.0, 0.0),
];
const UPDATES: [(&str, f64); 3] = [("rebuild", 9.0), ("refit", 1.5), ("async", 1.0)];
const RAYS: u64 = 2_304_000;

/// A full set: every method on every backend, on each of so many scenes.
pub(super) fn chart(scenes: usize) -> Chart {
    let names = ["demo:grove", "demo:collide", "demo:shatter", "demo:twist"];
    let scenes: Vec<Scene> = names[..scenes].iter().map(|name| scene(name)).collect();
    let points = scenes
        .iter()
        .enumerate()
        .flat_map(|(i, s)| points(s, 1.0 + i as f64))
        .collect();
    Chart {
        title: "Speed against accuracy (invented numbers)".to_owned(),
        machine: machine(),
        scenes,
        points,
        companions: Companions {
            key_frames: vec![curve("demo:grove", 1.0), curve("horse", 3.0)],
        },
    }
}

/// The methods that a person would compare: one layout, two updates, two backends.
pub(super) fn small() -> Chart {
    let mut chart = chart(1);
    chart
        .points
        .retain(|p| p.layout == "fast" && p.update != "rebuild" && p.backend != "wgpu");
    chart
}

fn machine() -> Machine {
    Machine {
        cpu: Some("Invented CPU 9000, 64 cores".to_owned()),
        version: "0.1.0".to_owned(),
        date: "2026-01-01".to_owned(),
        adapters: vec![
            adapter("cpu", "Invented CPU 9000", ""),
            adapter("vulkan", "Invented GPU X200", "driver 1.2.3"),
            adapter("wgpu", "Invented GPU X200", "driver 1.2.3"),
        ],
    }
}

fn adapter(backend: &str, adapter: &str, driver: &str) -> Adapter {
    Adapter {
        backend: backend.to_owned(),
        adapter: adapter.to_owned(),
        driver: driver.to_owned(),
    }
}

fn scene(name: &str) -> Scene {
    Scene {
        name: name.to_owned(),
        triangles: 174_312,
        size: [1280, 800],
        frames: 32,
    }
}

fn points(scene: &Scene, weight: f64) -> Vec<Point> {
    let mut points = Vec::new();
    for (b, backend) in BACKENDS.iter().enumerate() {
        for layout in LAYOUTS {
            for intersector in INTERSECTORS {
                for update in UPDATES {
                    let seed = points.len() + 7 * b;
                    let wobble = 1.0 + 0.05 * (seed as f64 * 2.4).sin();
                    let ms = weight * wobble * backend.1 * layout.1 * intersector.1 * update.1;
                    points.push(Point {
                        layout: layout.0.to_owned(),
                        update: update.0.to_owned(),
                        command: format!(
                            "abvh bench {} --backend {} --layout {} --intersector {} --update {}",
                            scene.name, backend.0, layout.0, intersector.0, update.0
                        ),
                        ..point(scene, backend.0, intersector, (ms, wobble))
                    });
                }
            }
        }
    }
    points
}

fn point(
    scene: &Scene,
    backend: &str,
    method: (&str, f64, f64, f64),
    (ms, wobble): (f64, f64),
) -> Point {
    let (intersector, _, ppm, worst) = method;
    Point {
        backend: backend.to_owned(),
        intersector: intersector.to_owned(),
        scene: scene.name.clone(),
        ms_per_frame: Spread {
            median: Some(ms),
            p5: Some(ms * 0.93),
            p95: Some(ms * 1.2 * wobble),
        },
        mrays_per_s: Some(2.304 / ms * 1e3),
        rays_tested: RAYS,
        wrong: (ppm * wobble * RAYS as f64 * 1e-6) as u64,
        wrong_shadow: (ppm * 0.1 * RAYS as f64 * 1e-6) as u64,
        t_error_ulp: Some(TError {
            median: Some(if worst > 0.0 { 0.4 } else { 0.0 }),
            p999: Some(worst * 0.2),
            worst: Some(worst * wobble),
        }),
        leaks: [0.0, 10.0, 1e3, 1e5]
            .map(|offset| leaks(offset, ppm))
            .to_vec(),
        memory_bytes: Some(((90.0 + 30.0 * wobble) * 1e6) as u64),
        samples: 32,
        ..Point::default()
    }
}

fn leaks(offset: f64, ppm: f64) -> Leaks {
    let faulty = ppm > 100.0;
    let grown = ppm * 150.0 / (1.0 + offset.sqrt());
    Leaks {
        offset: Some(offset),
        rays: 134_217_728,
        counted: 134_217_728,
        leaks: if faulty { grown as u64 } else { 0 },
        double_hits: if faulty {
            (grown * 2.0 + offset) as u64
        } else {
            0
        },
    }
}

fn curve(name: &str, weight: f64) -> KeyFrames {
    let step = |i: i32| {
        let tolerance = 10f64.powi(-i);
        KeyFrameStep {
            tolerance: Some(tolerance),
            key_frames: (weight * 4.0 * f64::from(i * i)) as u64,
            max_error: Some(tolerance * (0.97 - 0.1 / weight)),
            ms: Some(1.0 + 0.06 * weight * f64::from(i)),
        }
    };
    KeyFrames {
        scene: name.to_owned(),
        steps: (1..=6).map(step).collect(),
    }
}
