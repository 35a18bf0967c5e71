//! Charts: measured points in, pictures and tables out.
//!
//! A [`Chart`] shows milliseconds a frame against wrong answers per million rays, both logarithmic, with a place of their
//! own for points that had none wrong. Further panels show hard rays, and leaks and double hits by offset.
//!
//! What is charted are numbers that somebody else measured: what may be unknown is an `Option`, numbers are finite.
//!
//! `plotters` draws. Nothing is measured here and no file is touched. Equal data give equal bytes. No data panics:
//! what is missing, not finite or absurd is left out, and where that hides a point the picture says so.

#![expect(missing_docs, reason = "names are those of points.json")]

mod look;
mod page;
mod panel;
mod table;
#[cfg(test)]
mod tests;

pub use page::{html, svg};
pub use table::{SCHEMA, count, csv, csv_table, json, row};

use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;

/// What nobody tells apart: a picture that cannot be drawn, or a number that a format does not know.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Rays that wrong answers are counted per.
const PER: f64 = 1e6;
/// Two-sided 95 % of the normal distribution.
const Z: f64 = 1.959_964;

/// All that one chart shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Chart {
    pub machine: Machine,
    /// What was traced; one panel each, in this order.
    pub scenes: Vec<Scene>,
    /// What was measured, in any order.
    pub points: Vec<Point>,
    /// What could not be measured.
    pub failures: Vec<Failure>,
}

/// One way of tracing one scene that could not be measured. Names are those of [`Point`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Failure {
    pub scene: String,
    pub backend: String,
    pub layout: String,
    pub intersector: String,
    pub update: String,
    /// The reason.
    pub error: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = [&self.backend, &self.layout, &self.intersector, &self.update];
        let how = how.map(String::as_str).join(" ");
        write!(f, "{} {how} failed: {}", self.scene, self.error)
    }
}

/// What did the work.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Machine {
    /// Name of the host's processor.
    pub cpu: Option<String>,
    /// Of the program.
    pub version: String,
    /// The day of the measurement, as the caller wants it read.
    pub date: String,
    pub adapters: Vec<Adapter>,
}

/// Who stands behind a backend's name.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Adapter {
    pub backend: String,
    pub adapter: String,
    /// With its version; empty where there is none.
    pub driver: String,
}

/// What was traced.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Scene {
    pub name: String,
    pub triangles: u64,
    /// Pixels of a frame: width, height.
    pub size: [u32; 2],
    /// That each run traced.
    pub frames: u64,
}

/// One way of tracing one scene: how fast it was, and how often wrong.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Point {
    /// Shown by colour.
    pub backend: String,
    /// Shown by size.
    pub layout: String,
    /// Shown by shape.
    pub intersector: String,
    /// Shown by fill.
    pub update: String,
    pub scene: String,
    pub ms_per_frame: Spread,
    /// Million rays a second.
    pub mrays_per_s: Option<f64>,
    /// Rays whose answers were compared with those of exact arithmetic.
    pub rays_tested: u64,
    /// How many of them got another closest hit.
    pub wrong: u64,
    /// How many of them got another answer to whether the hit is in shadow.
    pub wrong_shadow: u64,
    /// Rays aimed at edges and vertices of the scene itself, which [`Self::rays_tested`] leaves out.
    pub aimed: Aimed,
    /// How far `t` was off where the hit was right.
    pub t_error_ulp: Option<TError>,
    /// What became of rays aimed at edges and vertices of a closed mesh.
    pub leaks: Vec<Leaks>,
    /// Answers in scenes of mixed range: sizes or places of very different magnitude in one scene.
    pub mixed_range: Vec<FamilyCounts>,
    /// That the backend held.
    pub memory_bytes: Option<u64>,
    /// Frames that were timed.
    pub samples: u64,
    /// Seconds that the device was warmed up before them.
    pub warm_up_s: Option<f64>,
    /// Measures this point again.
    pub command: String,
}

/// How a time was spread over the frames: the middle one, and what 5 and 95 of 100 were less than.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Without it, or if it is not above zero, a point is not drawn.
    pub median: Option<f64>,
    pub p5: Option<f64>,
    pub p95: Option<f64>,
}

/// Errors of `t`, in units in the last place of the exact `t` rounded to f32. The middle one, what 999 of 1000 were less
/// than, and the largest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TError {
    pub median: Option<f64>,
    pub p999: Option<f64>,
    pub worst: Option<f64>,
}

/// Rays for which a hit is hardest to tell, counted apart from all others. How many, and how many of them got another
/// closest hit than by exact arithmetic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Aimed {
    pub rays: u64,
    pub wrong: u64,
}

/// Likewise of a family, as `abvh stability` lists it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FamilyCounts {
    pub family: String,
    pub rays: u64,
    pub wrong: u64,
}

/// Rays aimed from inside at edges and vertices of a closed mesh that was moved away from the origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Leaks {
    /// How far the mesh was moved, in units of its size.
    pub offset: f64,
    pub rays: u64,
    /// How many met nothing.
    pub leaks: u64,
    /// Rays of those whose crossings were counted.
    pub counted: u64,
    /// How many of the counted met two triangles where a generic ray meets one.
    pub double_hits: u64,
}

impl Point {
    /// Everything that tells it from others of its scene.
    pub(crate) fn name(&self) -> String {
        let words = [&self.backend, &self.layout, &self.intersector, &self.update];
        words.map(String::as_str).join(" ")
    }
}

/// Wrong answers per million rays, with an interval that covers the true rate in 95 of 100 cases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

impl Rate {
    /// `wrong` of `tested`; `None` if nothing was tested. For none wrong the bound is the rule of three, `3 / tested`
    /// (one-sided; Hanley, Lippman-Hand 1983); otherwise Wilson's score interval (Wilson 1927).
    #[must_use]
    pub fn of(wrong: u64, tested: u64) -> Option<Self> {
        if tested == 0 {
            return None;
        }
        let n = tested as f64;
        let p = wrong.min(tested) as f64 / n;
        let scale = 1.0 / (1.0 + Z * Z / n);
        let middle = (p + Z * Z / (2.0 * n)) * scale;
        let half = Z * scale * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        let [low, high] = match wrong {
            0 => [0.0, (3.0 / n).min(1.0)],
            _ => [(middle - half).clamp(0.0, p), (middle + half).clamp(p, 1.0)],
        };
        let [value, low, high] = [p, low, high].map(|x| x * PER);
        Some(Self { value, low, high })
    }
}

/// A point that can be drawn.
#[derive(Clone, Copy)]
pub(crate) struct Dot<'a> {
    pub(crate) point: &'a Point,
    /// Its place in [`Chart::points`].
    pub(crate) index: usize,
    /// Median milliseconds a frame; then where its interval begins and ends.
    pub(crate) ms: [f64; 3],
    pub(crate) wrong: Rate,
}

impl<'a> Dot<'a> {
    /// `None` if there is no time above zero, or no ray was tested.
    fn of((index, point): (usize, &'a Point)) -> Option<Self> {
        let Spread { median, p5, p95 } = point.ms_per_frame;
        let ms = median.filter(|&ms| ms > 0.0)?;
        Some(Self {
            index,
            point,
            ms: [ms, p5.unwrap_or(ms), p95.unwrap_or(ms)],
            wrong: Rate::of(point.wrong, point.rays_tested)?,
        })
    }
}

impl Chart {
    /// The points of all scenes that can be drawn.
    pub(crate) fn dots(&self) -> impl Iterator<Item = Dot<'_>> {
        self.points.iter().enumerate().filter_map(Dot::of)
    }

    /// Those of one scene.
    pub(crate) fn dots_of<'a>(&'a self, scene: &str) -> Vec<Dot<'a>> {
        self.dots().filter(|dot| dot.point.scene == scene).collect()
    }

    /// The Pareto front: points of a scene that no other beats in both speed and accuracy, fastest first. Of equal points
    /// only the first is in it.
    pub(crate) fn front<'a>(&'a self, scene: &str) -> Vec<Dot<'a>> {
        let mut dots = self.dots_of(scene);
        dots.sort_by(|a, b| {
            let by_rate = a.wrong.value.total_cmp(&b.wrong.value);
            a.ms[0].total_cmp(&b.ms[0]).then(by_rate)
        });
        let mut least = f64::INFINITY;
        dots.retain(|dot| {
            let is_better = dot.wrong.value < least;
            least = least.min(dot.wrong.value);
            is_better
        });
        dots
    }

    /// Whether a point is on the front of its scene.
    pub(crate) fn is_on_front(&self, index: usize) -> bool {
        let front = self.front(&self.points[index].scene);
        front.iter().any(|dot| dot.index == index)
    }

    /// Offsets that any point was measured at.
    pub(crate) fn offsets(&self) -> Vec<f64> {
        let leaks = self.points.iter().flat_map(|p| &p.leaks);
        let mut offsets: Vec<f64> = leaks.map(|l| l.offset).collect();
        offsets.sort_by(f64::total_cmp);
        offsets.dedup();
        offsets
    }

    /// Families of mixed range that any point was measured in.
    pub(crate) fn families(&self) -> BTreeSet<&str> {
        let all = self.points.iter().flat_map(|p| &p.mixed_range);
        all.map(|f| &*f.family).collect()
    }
}
