//! Chooses the update policy of a run: a pure function of facts that are known before the first frame.
//!
//! Some runs are decided by rules. For all others, the duration of the whole run, from the first build to the last
//! frame, is estimated for each policy that may win. The model has a few terms and was fitted to measurements (the
//! tables in this file's tests). The first estimate within 5 % of the lowest wins.

use crate::latency::LATER_BUILD;
use crate::motion::RefitDegradation;
use backend::DeviceKind;
use backend::Policy;

/// Facts that determine the policy of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunFacts {
    /// Number of frames.
    pub frames: usize,
    /// Mean step from one frame to the next, in key frames.
    pub step: f64,
    /// Whether any vertex moves.
    pub moves: bool,
    /// Number of triangles in the scene.
    pub triangles: usize,
    /// Number of primary rays per frame.
    pub rays: usize,
    /// Cost of the first tree, refitted, relative to fresh trees.
    pub degradation: RefitDegradation,
    /// Kind of the device that traces.
    pub device: DeviceKind,
    /// Device memory of the whole run in bytes, if the device builds the trees ([`Policy::DeviceRebuild`]). `None` if
    /// the device cannot build trees.
    pub rebuild_bytes: Option<u64>,
    /// Number of host threads that trace, if the host does.
    pub threads: usize,
    /// Number of threads that build.
    pub builder_threads: usize,
}

/// Step in key frames from which on the tree of one frame is useless for the next.
const FAR_APART: f64 = 2.0;
/// Cost ratio up to which the first tree is considered as good as a fresh one.
const LASTS: f64 = 1.05;
/// Estimates of at most this factor times the lowest one are considered equal. The first such estimate wins.
const TIE: f64 = 1.05;
/// The estimates leave out [`Policy::DeviceRebuild`] if the run would need at least this many bytes of device memory.
/// The memory is then worth more than the time saved. Common GPUs that also drive a desktop have this much free.
const LARGE_REBUILD_BYTES: u64 = 4_000_000_000;

impl RunFacts {
    /// Returns the policy that suits the run best, and the reason in one line. Device memory may outweigh speed.
    pub fn choose(&self) -> (Policy, String) {
        let (update, why) = if !self.moves {
            let why = "the scene does not move, so the first tree remains the best";
            (Policy::Refit, why)
        } else if self.frames <= 1 {
            (Policy::Refit, "one frame needs one tree")
        } else if self.step >= FAR_APART {
            let why = "consecutive frames are far apart, so each frame needs its own tree";
            (self.rebuild(), why)
        } else if self.degradation.worst <= LASTS {
            (Policy::Refit, "the first tree is as good as a fresh one")
        } else {
            return self.least();
        };
        (update, why.to_owned())
    }

    /// Returns the policy that builds a tree for each frame, on the device if possible.
    fn rebuild(&self) -> Policy {
        match self.rebuild_bytes {
            Some(_) => Policy::DeviceRebuild,
            None => Policy::Rebuild,
        }
    }

    /// Returns the first policy whose estimate is close to the lowest.
    fn least(&self) -> (Policy, String) {
        let all = self.estimates();
        let least = all.iter().map(|e| e.1).fold(f64::INFINITY, f64::min);
        let taken = all.iter().find(|e| e.1 <= TIE * least).unwrap_or(&all[0]);
        let words = all
            .iter()
            .map(|e| format!("{} {:.2}", e.0.name(), e.1 * 1e-3));
        let mut why = format!(
            "estimated seconds for {} frames: {}; the refitted first tree costs {:.2} times as much as a fresh one",
            self.frames,
            words.collect::<Vec<_>>().join(", "),
            self.degradation.mean
        );
        if let Some(bytes) = self.rebuild_bytes.filter(|&b| b >= LARGE_REBUILD_BYTES) {
            let gigabytes = bytes as f64 * 1e-9;
            why += &format!("; device-rebuild would take {gigabytes:.1} GB of device memory");
        }
        (taken.0, why)
    }

    /// Returns the estimated milliseconds of the whole run for each policy that may win.
    fn estimates(&self) -> Vec<(Policy, f64)> {
        let [build, frame, device_build, builder_slowdown] = self.times();
        let frames = self.frames as f64;
        let tracing = frames * frame;
        let slower = TREE_SHARE * (self.degradation.mean - 1.0);
        // Duration of a build, as a share of the run. The excess cost of a tree grows with the square of its age.
        let age = (LATER_BUILD * build / tracing).min(1.0);
        let aged = 1.0 + slower * age * age;
        let mut all = vec![
            (Policy::Refit, build + tracing * (1.0 + slower)),
            (Policy::Async, build + tracing * builder_slowdown * aged),
        ];
        match self.rebuild_bytes {
            Some(LARGE_REBUILD_BYTES..) => (),
            Some(_) => all.push((Policy::DeviceRebuild, frames * (frame + device_build))),
            None => all.push((Policy::Rebuild, frames * (frame + build))),
        }
        all
    }

    /// Returns the milliseconds of a host build, of a frame and of a build on the device. The last value is the factor
    /// by which frames take longer while the host builds.
    fn times(&self) -> [f64; 4] {
        let (triangles, rays) = (self.triangles as f64, self.rays as f64);
        let builders = self.builder_threads.max(1) as f64;
        match self.device {
            DeviceKind::Gpu => [
                triangles * GPU_BUILD / builders,
                GPU_FRAME + triangles * GPU_TRIANGLE,
                GPU_DEVICE_BUILD + triangles * GPU_DEVICE_BUILD_TRIANGLE,
                1.0,
            ],
            DeviceKind::Cpu | DeviceKind::Software => {
                let threads = self.threads.max(1) as f64;
                [
                    triangles * HOST_BUILD / threads,
                    (rays * HOST_RAY + triangles * HOST_TRIANGLE) / threads,
                    f64::INFINITY,
                    (threads + builders) / threads,
                ]
            }
        }
    }
}

/// Share of a frame's time that is proportional to its tree's cost.
const TREE_SHARE: f64 = 0.5;
/// Milliseconds per triangle on one thread: first build, conversion, and transfer to a GPU.
const GPU_BUILD: f64 = 1.5e-3;
/// Milliseconds of a frame on an H100: constant part, and per triangle.
const GPU_FRAME: f64 = 0.2;
const GPU_TRIANGLE: f64 = 0.25e-6;
/// Milliseconds of a build on an H100: constant part, and per triangle.
const GPU_DEVICE_BUILD: f64 = 0.4;
const GPU_DEVICE_BUILD_TRIANGLE: f64 = 0.28e-6;
/// Milliseconds on one host thread: a build per triangle, tracing per primary ray with its shadow ray, and a refit per
/// triangle.
const HOST_BUILD: f64 = 0.8e-3;
const HOST_RAY: f64 = 70e-6;
const HOST_TRIANGLE: f64 = 40e-6;

/// Compares the choice with measured runs.
#[cfg(test)]
mod tests {
    use super::*;

    /// A scene, the number of frames, and the seconds of the whole run, including the first tree. The seconds are those
    /// of `refit`, of `async` and of a tree per frame. Infinity means that no time was measured. The test fails if that
    /// policy is chosen.
    type Measured = (Scene, usize, [f64; 3]);
    /// Name, number of triangles, and mean degradation.
    type Scene = (&'static str, usize, f64);

    const GROVE: Scene = ("grove", 173_987, 1.06);
    const COLLIDE: Scene = ("collide", 252_000, 1.74);
    const SMALL_COLLIDE: Scene = ("collide:20000", 19_992, 1.5);
    const TWIST: Scene = ("twist", 100_112, 1.05);
    const LARGE_TWIST: Scene = ("twist:1600000", 1_600_098, 1.09);
    const HUGE_TWIST: Scene = ("twist:20000000", 20_000_000, 1.1);
    const SHATTER: Scene = ("shatter", 1_599_900, 15.01);
    const SMALL_SHATTER: Scene = ("shatter:70000", 69_924, 13.01);

    /// Sums of `wall_ms` of `abvh render demo:SCENE --no-images --update POLICY --stats FILE`, one run
    /// each, commit efe1e7c. NVIDIA H100 80GB HBM3, driver 580, 16 cores, `vulkan`, 1920x1200. Last column:
    /// `device-rebuild`.
    const H100: [Measured; 12] = [
        (GROVE, 48, [0.05, 0.06, 0.29]),
        (COLLIDE, 48, [0.05, 0.05, 0.04]),
        (TWIST, 48, [0.02, 0.03, 0.04]),
        (SHATTER, 48, [7.23, 0.47, 0.09]),
        (SMALL_SHATTER, 48, [0.30, 0.05, 0.04]),
        (LARGE_TWIST, 48, [0.18, 0.19, 0.15]),
        (GROVE, 240, [0.15, 0.15, 0.31]),
        (COLLIDE, 240, [0.16, 0.11, 0.20]),
        (TWIST, 240, [0.07, 0.07, 0.15]),
        (SHATTER, 240, [26.66, 0.55, 0.35]),
        (SMALL_SHATTER, 240, [1.47, 0.08, 0.15]),
        (LARGE_TWIST, 240, [0.34, 0.38, 0.37]),
    ];

    /// The same machine, limited to two cores by `taskset -c 0,1`.
    const H100_TWO_CORES: [Measured; 2] = [
        (SHATTER, 240, [f64::INFINITY, 2.70, 0.36]),
        (COLLIDE, 240, [f64::INFINITY, 0.21, 0.20]),
    ];

    /// The same machine, `cpu` on its 16 cores, 960x600. Last column: `rebuild`.
    const SIXTEEN_CORES: [Measured; 6] = [
        (GROVE, 48, [0.84, 0.88, 1.61]),
        (COLLIDE, 48, [0.62, 0.67, 1.71]),
        (TWIST, 48, [0.45, 0.47, 0.91]),
        (SHATTER, 48, [f64::INFINITY, 1.78, 6.32]),
        (SMALL_SHATTER, 48, [2.05, 0.32, 0.61]),
        (LARGE_TWIST, 48, [0.83, 1.51, 6.27]),
    ];

    /// AMD EPYC (Zen 5), 2 cores of a virtual machine, `cpu`, 640x360. Last column: `rebuild`.
    const TWO_CORES: [Measured; 6] = [
        (GROVE, 48, [1.01, 1.69, 2.52]),
        (COLLIDE, 48, [0.81, 1.03, 2.67]),
        (TWIST, 48, [0.38, 0.63, 1.17]),
        (SHATTER, 48, [173.53, 4.84, 18.58]),
        (SMALL_SHATTER, 48, [3.36, 0.60, 0.97]),
        (SMALL_COLLIDE, 48, [0.29, 0.35, 0.43]),
    ];

    fn facts(measured: &Measured, device: DeviceKind, cores: usize, rays: usize) -> RunFacts {
        let ((_, triangles, degradation), frames, _) = *measured;
        let is_gpu = device == DeviceKind::Gpu;
        let quarter = (cores / 4).max(1);
        RunFacts {
            frames,
            step: 23.0 / (frames - 1) as f64,
            moves: true,
            triangles,
            rays,
            degradation: RefitDegradation {
                mean: degradation,
                worst: 2.0 * degradation - 1.0,
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
    fn choice_is_near_the_measured_best() {
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
                    Policy::Refit => 0,
                    Policy::Async => 1,
                    Policy::Rebuild | Policy::DeviceRebuild => 2,
                    other => panic!("{other} is not measured"),
                }];
                let best = seconds.into_iter().fold(f64::INFINITY, f64::min);
                let about =
                    format!("{name} on {cores} cores of a {device:?}: {taken} s for {best}: {why}");
                // Measured times have two decimal places.
                assert!(taken <= 1.34 * best + 0.01, "{about}");
            }
        }
    }

    #[test]
    fn chooses_policy_by_kind_of_run() {
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
        (still.moves, one.frames, lasting.degradation) = (false, 1, RefitDegradation::NONE);
        // A long run of a scene whose trees degrade fast.
        let mut long = facts(&TWO_CORES[3], Cpu, 2, 640 * 360);
        long.frames = 20_000;
        let huge = facts(&(HUGE_TWIST, 120, [0.0; 3]), Gpu, 16, 1920 * 1200);
        let huge_in_little_memory = RunFacts {
            rebuild_bytes: Some(1 << 30),
            ..huge
        };
        for (facts, update) in [
            (still, Policy::Refit),
            (one, Policy::Refit),
            (lasting, Policy::Refit),
            (apart, Policy::DeviceRebuild),
            (on_host, Policy::Rebuild),
            (long, Policy::Async),
            (huge, Policy::Refit),
            (huge_in_little_memory, Policy::DeviceRebuild),
        ] {
            assert_eq!(facts.choose().0, update, "{facts:?}");
        }
        assert!(long.choose().1.contains("20000 frames"));
        assert!(huge.choose().1.contains("5.2 GB"));
    }
}
