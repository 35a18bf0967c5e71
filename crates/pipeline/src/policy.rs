//! Which update policy suits a run: a pure function of what is known before its first frame.
//!
//! The time of a whole run is estimated for each policy, from the first build to the last frame, by a model
//! of a few terms that was fitted to measurements (the table in this file's tests). The least estimate wins.

use crate::motion::RefitDecay;
use crate::schedule::{Pace, Update};
use backend::DeviceKind;

/// What a policy is chosen by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunFacts {
    /// Frames to come.
    pub frames: usize,
    /// Key frames from one frame to the next, in the mean.
    pub step: f64,
    /// Whether any vertex moves.
    pub moves: bool,
    /// Triangles of the scene.
    pub triangles: usize,
    /// Primary rays of a frame.
    pub rays: usize,
    /// What refitting does to the first tree.
    pub decay: RefitDecay,
    /// Who traces.
    pub device: DeviceKind,
    /// Bytes of the device's memory where it builds trees itself ([`Update::DeviceRebuild`]), if it can.
    pub rebuild_bytes: Option<u64>,
    /// Threads of the host that trace, where it does.
    pub threads: usize,
    /// Threads that build.
    pub builder_threads: usize,
}

/// Key frames between frames from which on the tree of an earlier frame is of no use.
const FAR_APART: f64 = 2.0;
/// The first tree is as good as a fresh one up to so many times its cost.
const LASTS: f64 = 1.05;
/// An estimate this many times the least is as good.
const TIE: f64 = 1.05;
/// Bytes of a device's memory from which on less memory is worth more than the seconds that trees built there save: what
/// common GPUs have left beside a desktop.
const LARGE_REBUILD_BYTES: u64 = 4_000_000_000;

impl RunFacts {
    /// The policy that is expected to finish the run first, and why, in one line.
    pub fn choose(&self) -> (Update, String) {
        let (update, why) = if !self.moves {
            let why = "the scene does not move, so its first tree stays the best";
            (Update::Refit, why)
        } else if self.frames <= 1 {
            (Update::Refit, "one frame needs one tree")
        } else if self.step >= FAR_APART {
            let why = "the frames lie key frames apart: the tree of one is of no use to the next";
            (self.rebuild(), why)
        } else if self.decay.worst <= LASTS {
            (Update::Refit, "the first tree stays as good as a fresh one")
        } else {
            return self.least();
        };
        (update, why.to_owned())
    }

    /// A new tree for each frame.
    fn rebuild(&self) -> Update {
        match self.rebuild_bytes {
            Some(_) => Update::DeviceRebuild,
            None => Update::Rebuild,
        }
    }

    /// The first policy whose estimate is about the least.
    fn least(&self) -> (Update, String) {
        let all = self.estimates();
        let least = all.iter().map(|e| e.1).fold(f64::INFINITY, f64::min);
        let taken = all.iter().find(|e| e.1 <= TIE * least).unwrap_or(&all[0]);
        let words = all
            .iter()
            .map(|e| format!("{} {:.2}", e.0.name(), e.1 * 1e-3));
        let mut why = format!(
            "estimated seconds for {} frames: {}; refitted, the first tree costs {:.2} times a fresh one",
            self.frames,
            words.collect::<Vec<_>>().join(", "),
            self.decay.mean
        );
        if let Some(bytes) = self.rebuild_bytes.filter(|&b| b >= LARGE_REBUILD_BYTES) {
            let gigabytes = bytes as f64 * 1e-9;
            why +=
                &format!("; trees built on the device would take {gigabytes:.1} GB of its memory");
        }
        (taken.0, why)
    }

    /// Milliseconds of the whole run by each policy that may win.
    fn estimates(&self) -> Vec<(Update, f64)> {
        let times = self.times();
        let frames = self.frames as f64;
        let tracing = frames * times.frame;
        let slower = TREE_SHARE * (self.decay.mean - 1.0);
        // Share of the run that passes while a tree is built.
        let age = (LATER_BUILD * times.build / tracing).min(1.0);
        let aged = 1.0 + slower * age * age;
        let mut all = vec![
            (Update::Refit, times.build + tracing * (1.0 + slower)),
            (
                Update::Async(Pace::Free),
                times.build + tracing * times.beside_builder * aged,
            ),
            (Update::TSah, TSAH_BUILDS * times.build + tracing),
        ];
        match self.rebuild_bytes {
            Some(LARGE_REBUILD_BYTES..) => (),
            Some(_) => {
                let each = times.frame + times.device_build;
                all.push((Update::DeviceRebuild, frames * each));
            }
            None => all.push((Update::Rebuild, frames * (times.frame + times.build))),
        }
        all
    }

    fn times(&self) -> Times {
        let (triangles, rays) = (self.triangles as f64, self.rays as f64);
        let builders = self.builder_threads.max(1) as f64;
        match self.device {
            DeviceKind::Gpu => Times {
                build: triangles * GPU_BUILD / builders,
                frame: GPU_FRAME + triangles * GPU_TRIANGLE,
                device_build: GPU_FRAME_BUILD + triangles * GPU_TRIANGLE_BUILD,
                beside_builder: 1.0,
            },
            DeviceKind::Cpu | DeviceKind::Software => {
                let threads = self.threads.max(1) as f64;
                Times {
                    build: triangles * HOST_BUILD / threads,
                    frame: (rays * HOST_RAY + triangles * HOST_TRIANGLE) / threads,
                    device_build: f64::INFINITY,
                    beside_builder: (threads + builders) / threads,
                }
            }
        }
    }
}

/// Milliseconds, and how much slower frames are while the host builds.
struct Times {
    build: f64,
    frame: f64,
    device_build: f64,
    beside_builder: f64,
}

/// Share of a frame that grows with its tree's cost.
const TREE_SHARE: f64 = 0.5;
/// A later build takes so much of the first one's time, as it finds its memory ready.
const LATER_BUILD: f64 = 0.4;
/// A tree for the whole time range takes as long as so many others.
const TSAH_BUILDS: f64 = 9.0;
/// Milliseconds of one thread a triangle: a first build, its conversion and its transfer to a GPU.
const GPU_BUILD: f64 = 1.5e-3;
/// Of an H100: milliseconds of any frame, and more a triangle; then of a tree made on the device.
const GPU_FRAME: f64 = 0.2;
const GPU_TRIANGLE: f64 = 0.25e-6;
const GPU_FRAME_BUILD: f64 = 0.4;
const GPU_TRIANGLE_BUILD: f64 = 0.28e-6;
/// Milliseconds of one thread of the host: a build a triangle, a primary ray with its shadow, a triangle's refit.
const HOST_BUILD: f64 = 0.8e-3;
const HOST_RAY: f64 = 70e-6;
const HOST_TRIANGLE: f64 = 40e-6;

#[cfg(test)]
mod tests;
