//! Rays through a tree in use beside rays through a fresh one at the very same moments.

use super::{Row, mean, rivals};
use crate::table::table;
use report::{FrameStats, Summary};
use serde::Serialize;
use std::collections::HashMap;

/// Times of rays over those with a tree built for the frame alone, frame by frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct FreshRatio {
    /// Frames that both runs traced, first frames left out.
    pairs: usize,
    median: f64,
    mean: f64,
    p95: f64,
    worst: f64,
    /// The mean once the first tree is no longer in use; `None` if it always was.
    mean_after_first_tree: Option<f64>,
}

/// Sets each run beside that with a fresh tree a frame on which somebody dwelt, where there is one: of the same scene,
/// device, method and rays.
pub(super) fn note(rows: &mut [Row]) {
    let ratios: Vec<_> = rows
        .iter()
        .map(|row| {
            let fresh = rows.iter().find(|r| is_fresh(r) && alike(r, row))?;
            (!is_fresh(row)).then(|| over(&row.per_frame, &fresh.per_frame))?
        })
        .collect();
    for (row, ratio) in rows.iter_mut().zip(ratios) {
        row.over_fresh = ratio;
    }
}

fn is_fresh(row: &Row) -> bool {
    row.update == "rebuild" && row.dwell.is_some()
}

fn alike(a: &Row, b: &Row) -> bool {
    let of = |r: &'_ Row| (r.backend, r.intersector, r.layout, r.rays);
    (of(a), &a.scene, &a.adapter) == (of(b), &b.scene, &b.adapter)
}

/// Ratios of the frames of `used` that `fresh` holds too: of the same number and the same time.
fn over(used: &[FrameStats], fresh: &[FrameStats]) -> Option<FreshRatio> {
    let known = fresh.iter().skip(1);
    let known = known.filter_map(|f| Some((key(f), rays(f).filter(|&ms| ms > 0.0)?)));
    let known: HashMap<_, _> = known.collect();
    let first = used.first()?.tree_generation;
    let pairs: Vec<(bool, f64)> = used[1..]
        .iter()
        .filter_map(|f| Some((f.tree_generation > first, rays(f)? / known.get(&key(f))?)))
        .collect();
    let all = || pairs.iter().map(|p| p.1);
    let summary = Summary::of(all())?;
    Some(FreshRatio {
        pairs: pairs.len(),
        median: summary.median,
        mean: mean(all())?,
        p95: summary.p95,
        worst: summary.worst,
        mean_after_first_tree: mean(pairs.iter().filter(|p| p.0).map(|p| p.1)),
    })
}

fn key(frame: &FrameStats) -> (usize, u64) {
    (frame.frame, frame.time.to_bits())
}

/// Milliseconds of all rays of a frame.
fn rays(frame: &FrameStats) -> Option<f64> {
    Some(frame.trace_primary_ms? + frame.trace_shadow_ms.unwrap_or(0.0))
}

/// A line for every run that stands beside a fresh tree.
pub(super) fn text(rows: &[Row]) -> String {
    let show = |x: f64| format!("{x:.3}");
    let line = |r: &Row| {
        let o = r.over_fresh?;
        let after = o.mean_after_first_tree.map_or("-".to_owned(), show);
        let numbers = [o.median, o.mean, o.p95, o.worst].map(show);
        let mut cells = vec![r.scene.clone(), rivals::name(r), o.pairs.to_string()];
        cells.extend(numbers);
        cells.push(after);
        Some(cells)
    };
    let lines: Vec<_> = rows.iter().filter_map(line).collect();
    if lines.is_empty() {
        return String::new();
    }
    let head = [
        "scene",
        "run",
        "frames",
        "median",
        "mean",
        "p95",
        "worst",
        "mean after the first tree",
    ];
    format!(
        "rays over those with a fresh tree, frame by frame\n{}",
        table(&head, &lines, 2)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(frame: usize, tree_generation: u64, ms: f64) -> FrameStats {
        FrameStats {
            frame,
            time: frame as f64 / 7.0,
            tree_generation,
            trace_primary_ms: Some(0.75 * ms),
            trace_shadow_ms: Some(0.25 * ms),
            ..FrameStats::default()
        }
    }

    #[test]
    fn frames_are_paired_by_number_and_time_and_first_frames_left_out() {
        let used: Vec<_> = (0..9)
            .map(|i| frame(i, if i < 3 { 1 } else { 2 + i as u64 / 5 }, 1.0 + i as f64))
            .collect();
        let fresh: Vec<_> = [0, 2, 4, 6, 8].map(|i| frame(i, 1 + i as u64, 2.0)).into();
        let o = over(&used, &fresh).unwrap();
        // 3, 5, 7 and 9 over 2.
        assert_eq!((o.pairs, o.median, o.mean), (4, 3.0, 3.0));
        assert_eq!(o.worst, 4.5);
        assert_eq!(o.mean_after_first_tree, Some(3.5));
        // Other moments are no pairs.
        let mut other = fresh.clone();
        other.iter_mut().for_each(|f| f.time += 1e-9);
        assert_eq!(over(&used, &other), None);
        let still: Vec<_> = (0..9).map(|i| frame(i, 1, 1.0)).collect();
        let o = over(&still, &fresh).unwrap();
        assert_eq!((o.mean, o.mean_after_first_tree), (0.5, None));
    }
}
