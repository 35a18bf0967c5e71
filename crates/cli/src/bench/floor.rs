//! The byte floor: what a frame has to move through memory at least, over the bandwidth of a plain copy.
//!
//! Counted is what no implementation of the stages can do without if nothing stays in a cache between them: numbers
//! of a triangle and a vertex, each read or written once. Tracing reads nodes and records
//! as rays meet them; what it must move is unknown, so that only its hits count.

use super::{Row, rivals};
use crate::args::BackendName;
use crate::open::{self, Want};
use crate::stop::Stop;
use crate::table::{ms, table};
use crate::warm_up;
use backend::{DeviceKind, Intersector, Method};
use clap::ValueEnum;
use geom::Animation;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;

/// Bytes of a point.
const POINT: u64 = 12;
/// Bytes of a box.
const BOX: u64 = 24;
/// Bytes of a triangle's vertex numbers.
const CORNERS: u64 = 12;
/// Bytes of a hit and whether it is in shadow.
const HIT: u64 = 17;
/// Bytes of a tree's record, in half bytes a triangle.
const HALVES_OF_TREE: u64 = 9;
/// Bytes of one copy on the host: more than any cache holds.
const COPY: usize = 256 << 20;
/// Vertices of a stream on a device: 300 MB read and written.
const STREAM: usize = 1 << 23;
/// Copies, of which the fastest counts.
const COPIES: usize = 5;

/// Bytes that each stage of a frame has to move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Bytes {
    interpolate: u64,
    preprocess: u64,
    refit: u64,
    hits: u64,
}

/// The floor of one run.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Floor {
    scene: String,
    run: String,
    bytes: Bytes,
    /// Bytes a second, read and written together, of a plain copy on the device; `None` where nobody measured it.
    copy_bytes_per_s: Option<f64>,
    interpolate_ms: Option<f64>,
    preprocess_ms: Option<f64>,
    refit_ms: Option<f64>,
    geometry_ms: Option<f64>,
    /// Geometry as measured, over its floor.
    geometry_over_floor: Option<f64>,
    hits_ms: Option<f64>,
}

impl Bytes {
    /// Of a frame between two key frames, of so many pixels.
    pub(super) fn of(animation: &Animation, intersector: Intersector, pixels: usize) -> Self {
        let still = animation.static_parts();
        let vertices = (animation.vertex_count() - still.vertex_count()) as u64;
        let moving = (animation.triangle_count() - still.triangle_count()) as u64;
        let live = animation.live_count() as u64;
        // An affine transform, or three vertices as they are.
        let record = if intersector == Intersector::Woop {
            48
        } else {
            3 * POINT
        };
        Self {
            // Two key frames in, one out.
            interpolate: 3 * POINT * vertices,
            // Vertices are shared: each is read once.
            preprocess: POINT * vertices + (CORNERS + record + BOX) * moving,
            // Boxes of leaves in, of inner nodes out; and the tree's record.
            refit: BOX * live + BOX * live.saturating_sub(1) + live * HALVES_OF_TREE / 2,
            hits: HIT * pixels as u64,
        }
    }

    fn over(self, row: &Row, copy_bytes_per_s: Option<f64>) -> Floor {
        let ms = |bytes: u64| copy_bytes_per_s.map(|rate| bytes as f64 / rate * 1e3);
        let geometry_ms = ms(self.interpolate + self.preprocess + self.refit);
        let above = geometry_ms.filter(|&ms| ms > 0.0).zip(row.geometry_ms);
        Floor {
            scene: row.scene.clone(),
            run: rivals::name(row),
            bytes: self,
            copy_bytes_per_s,
            interpolate_ms: ms(self.interpolate),
            preprocess_ms: ms(self.preprocess),
            refit_ms: ms(self.refit),
            geometry_ms,
            geometry_over_floor: above.map(|(floor, measured)| measured / floor),
            hits_ms: ms(self.hits),
        }
    }
}

/// The bandwidth of every backend among `rows`, each measured once.
#[derive(Default)]
pub(super) struct Bandwidths(Vec<(&'static str, Option<f64>)>);

impl Bandwidths {
    /// The floor of a run.
    pub(super) fn floor(&mut self, row: &Row, adapter: Option<&str>) -> Result<Floor, Stop> {
        let known = self.0.iter().find(|(backend, _)| *backend == row.backend);
        let rate = match known {
            Some(&(_, rate)) => rate,
            None if row.backend == "cpu" => Some(on_host(row.threads)),
            None => on_device(row.backend, adapter)?,
        };
        if known.is_none() {
            self.0.push((row.backend, rate));
        }
        Ok(row.bytes.over(row, rate))
    }
}

/// Bytes a second, read and written together, that so many threads copy.
fn on_host(threads: usize) -> f64 {
    let from = vec![1_u8; COPY];
    let mut to = vec![2_u8; COPY];
    let part = COPY.div_ceil(threads.max(1));
    let mut best = 0.0_f64;
    for _ in 0..COPIES {
        let begun = Instant::now();
        let parts = to.par_chunks_mut(part).zip(from.par_chunks(part));
        parts.for_each(|(to, from)| to.copy_from_slice(from));
        std::hint::black_box(&mut to);
        best = best.max(2.0 * COPY as f64 / begun.elapsed().as_secs_f64());
    }
    best
}

/// The same of a device, by the plainest stage there is: vertices that all move, interpolated.
fn on_device(backend: &str, adapter: Option<&str>) -> Result<Option<f64>, Stop> {
    let Ok(name) = BackendName::from_str(backend, true) else {
        return Ok(None);
    };
    let want = Want {
        backend: name,
        adapter,
        method: Method::default(),
        threads: 1,
    };
    let mut backend = open::open(&want, Ok)?.value;
    let on_gpu = backend.device().kind == DeviceKind::Gpu;
    let count = if on_gpu { STREAM } else { STREAM / 16 };
    let key = |x: f32| vec![[x, 1.0, 2.0]; count];
    let animation = Animation::new(vec![key(0.0), key(1.0)], vec![[0, 1, 2]]);
    let animation = Arc::new(animation.map_err(Stop::failed)?);
    backend.load(Arc::clone(&animation), Method::default())?;
    let mut best: Option<f64> = None;
    let begun = Instant::now();
    // A device that idled while the vertices were made is slow at first.
    let enough = |i| i >= 4 * COPIES && (!on_gpu || begun.elapsed() >= warm_up::USUAL);
    for i in (0..).take_while(|&i| !enough(i)) {
        backend.interpolate(animation.pose(0.01 + 0.04 * (i % 20) as f64))?;
        let ticket = backend.submit()?;
        let ms = backend.wait(ticket)?.times.interpolate_ms;
        let rate = ms
            .filter(|&ms| ms > 0.0)
            .map(|ms| (3 * POINT) as f64 * count as f64 / ms * 1e3);
        best = [best, rate].into_iter().flatten().reduce(f64::max);
    }
    Ok(best)
}

/// Every run's floor beside what it takes.
pub(super) fn text(floors: &[Floor]) -> String {
    let show = |t: Option<f64>| t.map_or("-".to_owned(), ms);
    let line = |f: &Floor| {
        let gigabytes = f
            .copy_bytes_per_s
            .map_or("-".to_owned(), |b| format!("{:.1}", b * 1e-9));
        let bytes = f.bytes.interpolate + f.bytes.preprocess + f.bytes.refit;
        let times = f
            .geometry_over_floor
            .map_or("-".to_owned(), |r| format!("{r:.2}"));
        vec![
            f.scene.clone(),
            f.run.clone(),
            gigabytes,
            format!("{:.2}", bytes as f64 * 1e-6),
            show(f.interpolate_ms),
            show(f.preprocess_ms),
            show(f.refit_ms),
            show(f.geometry_ms),
            times,
            show(f.hits_ms),
        ]
    };
    let lines: Vec<_> = floors.iter().map(line).collect();
    let head = [
        "scene",
        "run",
        "copy GB/s",
        "geometry MB",
        "interp",
        "preproc",
        "refit",
        "geometry",
        "measured",
        "hits",
    ];
    format!(
        "the least a frame must move through memory, in ms of a plain copy; geometry as measured, over that\n{}",
        table(&head, &lines, 2)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_those_of_what_moves() {
        let key = |x: f32| {
            vec![
                [x, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
            ]
        };
        let triangles = vec![[0, 1, 2], [1, 2, 3]];
        let of = |keys| Animation::new(keys, triangles.clone()).unwrap();
        let moving = of(vec![key(0.0), key(1.0)]);
        let bytes = Bytes::of(&moving, Intersector::Watertight, 100);
        let expected = Bytes {
            interpolate: 36,
            preprocess: 12 + (12 + 36 + 24),
            refit: 2 * 24 + 24 + 9,
            hits: 1700,
        };
        assert_eq!(bytes, expected);
        let still = Bytes::of(&of(vec![key(0.0)]), Intersector::Watertight, 100);
        assert_eq!((still.interpolate, still.preprocess), (0, 0));
    }

    #[test]
    fn a_copy_on_the_host_takes_time() {
        let rate = on_host(2);
        assert!(rate > 1e6 && rate < 1e14, "{rate}");
    }
}
