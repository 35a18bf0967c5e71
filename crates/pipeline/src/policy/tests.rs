//! The rule, held against measured runs.

use super::*;

/// A scene with its triangles and decay, frames, and seconds of all of them, the first tree included, by `refit`, `async`,
/// `t-sah`, and a tree a frame.
type Measured = (Scene, usize, [f64; 4]);
type Scene = (&'static str, usize, f64);

const GROVE: Scene = ("grove", 173_987, 1.06);
const COLLIDE: Scene = ("collide", 252_000, 1.74);
const SMALL_COLLIDE: Scene = ("collide:20000", 19_992, 1.5);
const TWIST: Scene = ("twist", 100_112, 1.05);
const LARGE_TWIST: Scene = ("twist:1600000", 1_600_098, 1.09);
const HUGE_TWIST: Scene = ("twist:20000000", 20_000_000, 1.1);
const SHATTER: Scene = ("shatter", 1_599_900, 15.01);
const SMALL_SHATTER: Scene = ("shatter:70000", 69_924, 13.01);

/// `abvh render demo:SCENE --no-images --layout fast --update POLICY --stats FILE`, sums of `wall_ms`, one run each,
/// commit efe1e7c. NVIDIA H100 80GB HBM3, driver 580, 16 cores, `vulkan`, 1920x1200; a tree a frame by `device-rebuild`.
const H100: [Measured; 12] = [
    (GROVE, 48, [0.05, 0.06, 0.16, 0.29]),
    (COLLIDE, 48, [0.05, 0.05, 0.27, 0.04]),
    (TWIST, 48, [0.02, 0.03, 0.10, 0.04]),
    (SHATTER, 48, [7.23, 0.47, 1.52, 0.09]),
    (SMALL_SHATTER, 48, [0.30, 0.05, 0.09, 0.04]),
    (LARGE_TWIST, 48, [0.18, 0.19, 1.49, 0.15]),
    (GROVE, 240, [0.15, 0.15, 0.29, 0.31]),
    (COLLIDE, 240, [0.16, 0.11, 0.36, 0.20]),
    (TWIST, 240, [0.07, 0.07, 0.15, 0.15]),
    (SHATTER, 240, [26.66, 0.55, 1.57, 0.35]),
    (SMALL_SHATTER, 240, [1.47, 0.08, 0.14, 0.15]),
    (LARGE_TWIST, 240, [0.34, 0.38, 1.60, 0.37]),
];

/// The same machine, `taskset -c 0,1`.
const H100_TWO_CORES: [Measured; 2] = [
    (SHATTER, 240, [f64::INFINITY, 2.70, 7.30, 0.36]),
    (COLLIDE, 240, [f64::INFINITY, 0.21, 1.29, 0.20]),
];

/// The same machine, `cpu` on its 16 cores, 960x600; a tree a frame by `rebuild`.
const SIXTEEN_CORES: [Measured; 6] = [
    (GROVE, 48, [0.84, 0.88, 0.99, 1.61]),
    (COLLIDE, 48, [0.62, 0.67, 0.80, 1.71]),
    (TWIST, 48, [0.45, 0.47, 0.45, 0.91]),
    (SHATTER, 48, [f64::INFINITY, 1.78, 2.13, 6.32]),
    (SMALL_SHATTER, 48, [2.05, 0.32, 0.39, 0.61]),
    (LARGE_TWIST, 48, [0.83, 1.51, 1.98, 6.27]),
];

/// AMD EPYC (Zen 5), 2 cores of a virtual machine, `cpu`, 640x360; a tree a frame by `rebuild`.
const TWO_CORES: [Measured; 6] = [
    (GROVE, 48, [1.01, 1.69, 1.39, 2.52]),
    (COLLIDE, 48, [0.81, 1.03, 1.12, 2.67]),
    (TWIST, 48, [0.38, 0.63, 0.55, 1.17]),
    (SHATTER, 48, [173.53, 4.84, 5.70, 18.58]),
    (SMALL_SHATTER, 48, [3.36, 0.60, 0.51, 0.97]),
    (SMALL_COLLIDE, 48, [0.29, 0.35, 0.31, 0.43]),
];

fn facts(measured: &Measured, device: DeviceKind, cores: usize, rays: usize) -> RunFacts {
    let ((_, triangles, decay), frames, _) = *measured;
    let is_gpu = device == DeviceKind::Gpu;
    let quarter = (cores / 4).max(1);
    RunFacts {
        frames,
        step: 23.0 / (frames - 1) as f64,
        moves: true,
        triangles,
        rays,
        decay: RefitDecay {
            mean: decay,
            worst: 2.0 * decay - 1.0,
        },
        device,
        rebuild_bytes: is_gpu.then_some(260 * triangles as u64),
        threads: match cores {
            _ if is_gpu => cores,
            4.. => cores - quarter,
            _ => cores,
        },
        builder_threads: if is_gpu { cores - 1 } else { quarter },
    }
}

#[test]
fn the_choice_takes_at_most_a_third_longer_than_the_best_measured() {
    use DeviceKind::{Cpu, Gpu};
    let tables: [(&[Measured], DeviceKind, usize, usize); 4] = [
        (&H100, Gpu, 16, 1920 * 1200),
        (&H100_TWO_CORES, Gpu, 2, 1920 * 1200),
        (&SIXTEEN_CORES, Cpu, 16, 960 * 600),
        (&TWO_CORES, Cpu, 2, 640 * 360),
    ];
    for (table, device, cores, rays) in tables {
        for measured in table {
            let ((name, ..), _, seconds) = *measured;
            let (update, why) = facts(measured, device, cores, rays).choose();
            let taken = seconds[match update {
                Update::Refit => 0,
                Update::Async(_) => 1,
                Update::TSah => 2,
                Update::Rebuild | Update::DeviceRebuild => 3,
            }];
            let best = seconds.into_iter().fold(f64::INFINITY, f64::min);
            let about =
                format!("{name} on {cores} cores of a {device:?}: {taken} s for {best}: {why}");
            // Times have two places.
            assert!(taken <= 1.34 * best + 0.01, "{about}");
        }
    }
}

#[test]
fn runs_of_a_kind_have_the_policy_that_suits_them() {
    use DeviceKind::{Cpu, Gpu};
    let moving = facts(&H100[1], Gpu, 16, 1 << 20);
    let apart = RunFacts {
        step: 3.0,
        ..moving
    };
    let on_host = RunFacts {
        rebuild_bytes: None,
        device: Cpu,
        ..apart
    };
    let [mut still, mut one, mut lasting] = [moving; 3];
    (still.moves, one.frames, lasting.decay) = (false, 1, RefitDecay::NONE);
    // Of trees that fade.
    let mut long = facts(&TWO_CORES[3], Cpu, 2, 640 * 360);
    long.frames = 20_000;
    let huge = facts(&(HUGE_TWIST, 120, [0.0; 4]), Gpu, 16, 1920 * 1200);
    let beside_others = RunFacts {
        rebuild_bytes: Some(1 << 30),
        ..huge
    };
    for (facts, update) in [
        (still, Update::Refit),
        (one, Update::Refit),
        (lasting, Update::Refit),
        (apart, Update::DeviceRebuild),
        (on_host, Update::Rebuild),
        (long, Update::TSah),
        (huge, Update::Refit),
        (beside_others, Update::DeviceRebuild),
    ] {
        assert_eq!(facts.choose().0, update, "{facts:?}");
    }
    assert!(long.choose().1.contains("20000 frames"));
    assert!(huge.choose().1.contains("5.2 GB"));
}
