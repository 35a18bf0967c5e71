//! Charts of measured points: SVG pictures, HTML pages and tables.
//!
//! A [`Chart`] shows milliseconds per frame against wrong answers per million rays. Both axes are logarithmic, with a
//! separate position for points without wrong answers. A further panel shows the rates of wrong answers for hard rays.
//!
//! The caller measures all numbers. Values that may be unknown are `Option`s.
//!
//! This module draws with `plotters`. It measures nothing and accesses no files. Equal data give equal bytes, and no
//! data causes a panic. Points without a positive median time or without tested rays are not drawn, and the picture
//! states their number. Infinite values are drawn at the end of the axis.

#![expect(missing_docs, reason = "names are those of points.json")]

mod mark_style;
mod page;
mod panel;
mod table;
#[cfg(test)]
mod tests;

pub use page::{html, svg};
pub use table::{SCHEMA, csv, csv_table, format_count, json, row};

use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;

/// Result of drawing or formatting. Callers need not distinguish errors, so they are boxed.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Number of rays that error rates refer to.
const PER: f64 = 1e6;
/// Quantile of the normal distribution for two-sided 95 % intervals.
const Z: f64 = 1.959_964;

/// Contents of a chart.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Chart {
    pub machine: Machine,
    /// Traced scenes, with one panel each, in this order.
    pub scenes: Vec<ChartScene>,
    /// Measurements in any order.
    pub points: Vec<ChartPoint>,
    /// Measurements that failed.
    pub failures: Vec<Failure>,
}

/// A method and a scene whose measurement failed, in `abvh chart` or `abvh bench`. Names are those of [`ChartPoint`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Failure {
    pub scene: String,
    pub backend: String,
    pub intersector: String,
    pub update: String,
    /// Kind of rays. `None` for camera rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rays: Option<&'static str>,
    /// Reason for the failure.
    pub error: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = [&self.backend, &self.intersector, &self.update];
        let how = how.map(String::as_str).join(" ");
        let rays = self.rays.map_or(String::new(), |r| format!(" {r} rays"));
        write!(f, "{} {how}{rays} failed: {}", self.scene, self.error)
    }
}

/// Machine and program of the measurements.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Machine {
    /// Name of the host's processor.
    pub cpu: Option<String>,
    /// Version of the program.
    pub version: String,
    /// Date of the measurement, in the caller's format.
    pub date: String,
    pub adapters: Vec<Adapter>,
}

/// Device that a backend used.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Adapter {
    pub backend: String,
    pub adapter: String,
    /// Name and version of the driver. Empty if there is no driver.
    pub driver: String,
}

/// Traced scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ChartScene {
    pub name: String,
    pub triangles: u64,
    /// Width and height of a frame in pixels.
    pub size: [u32; 2],
    /// Number of frames per run.
    pub frames: u64,
}

/// Speed and accuracy of one method on one scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ChartPoint {
    /// Backend, shown by colour.
    pub backend: String,
    /// Intersector, shown by shape.
    pub intersector: String,
    /// Tree update policy, shown by fill.
    pub update: String,
    pub scene: String,
    pub ms_per_frame: TimeSpread,
    /// Million rays per second.
    pub mrays_per_s: Option<f64>,
    /// Number of rays whose answers were compared with exact arithmetic.
    pub rays_tested: u64,
    /// Number of tested rays whose closest hit was wrong.
    pub wrong: u64,
    /// Number of tested rays whose shadow answer was wrong.
    pub wrong_shadow: u64,
    /// Rays aimed at edges and vertices of the scene. [`Self::rays_tested`] does not include them.
    pub aimed: Aimed,
    /// Wrong answers in scenes of mixed range: sizes or positions of very different magnitude in one scene.
    pub mixed_range: Vec<FamilyCounts>,
    /// Memory of the backend in bytes.
    pub memory_bytes: Option<u64>,
    /// Number of timed frames.
    pub samples: u64,
    /// Warm-up time in seconds before the timed frames.
    pub warm_up_s: Option<f64>,
}

/// Distribution of a time over the frames: median, 5th and 95th percentile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TimeSpread {
    /// Median. A point whose median is not positive is not drawn.
    pub median: f64,
    pub p5: f64,
    pub p95: f64,
}

/// Results of rays at edges and vertices, whose closest hit is hardest to determine, compared with exact arithmetic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Aimed {
    pub rays: u64,
    pub wrong: u64,
}

/// Results of one family of rays in scenes of mixed range, as listed by `abvh stability`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FamilyCounts {
    pub family: String,
    pub rays: u64,
    pub wrong: u64,
}

impl ChartPoint {
    /// Returns the properties that distinguish the point from others of its scene.
    pub(crate) fn name(&self) -> String {
        let words = [&self.backend, &self.intersector, &self.update];
        words.map(String::as_str).join(" ")
    }
}

/// Wrong answers per million rays, with a 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rate {
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Rate {
    /// Returns the rate of `wrong` in `tested` answers, or `None` if `tested` is 0. The interval is Wilson's score
    /// interval (Wilson 1927). If `wrong` is 0, its upper bound is the rule of three, `3 / tested` (one-sided; Hanley,
    /// Lippman-Hand 1983).
    pub(crate) fn of(wrong: u64, tested: u64) -> Option<Self> {
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

/// Point that can be drawn.
#[derive(Clone, Copy)]
pub(crate) struct Dot<'a> {
    pub(crate) point: &'a ChartPoint,
    /// Index in [`Chart::points`].
    pub(crate) index: usize,
    /// Milliseconds per frame: median, and the lower and upper end of the interval.
    pub(crate) ms: [f64; 3],
    pub(crate) wrong: Rate,
}

impl<'a> Dot<'a> {
    /// Returns `None` if the median time is not positive, or if no ray was tested.
    fn of(index: usize, point: &'a ChartPoint) -> Option<Self> {
        let TimeSpread { median, p5, p95 } = point.ms_per_frame;
        let wrong = Rate::of(point.wrong, point.rays_tested)?;
        (median > 0.0).then_some(Self {
            index,
            point,
            ms: [median, p5, p95],
            wrong,
        })
    }
}

impl Chart {
    /// Returns the points of all scenes that can be drawn.
    pub(crate) fn dots(&self) -> impl Iterator<Item = Dot<'_>> {
        let points = self.points.iter().enumerate();
        points.filter_map(|(index, point)| Dot::of(index, point))
    }

    /// Returns the points of one scene that can be drawn.
    pub(crate) fn dots_of<'a>(&'a self, scene: &str) -> Vec<Dot<'a>> {
        self.dots().filter(|dot| dot.point.scene == scene).collect()
    }

    /// Returns the Pareto front, fastest first: the points of a scene for which no other point is at least as fast and
    /// as accurate, and better in one of the two. Of equal points it contains only the first.
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

    /// Returns whether a point is on the front of its scene.
    pub(crate) fn is_on_front(&self, index: usize) -> bool {
        let front = self.front(&self.points[index].scene);
        front.iter().any(|dot| dot.index == index)
    }

    /// Returns the names of all families in [`ChartPoint::mixed_range`].
    pub(crate) fn families(&self) -> BTreeSet<&str> {
        let all = self.points.iter().flat_map(|p| &p.mixed_range);
        all.map(|f| &*f.family).collect()
    }
}
