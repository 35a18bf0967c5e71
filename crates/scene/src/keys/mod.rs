//! Reduction of key frames to the smallest subset that reproduces all frames within a tolerance.
//!
//! This is piecewise linear approximation with free knots, solved exactly. The first and the last frame are always
//! kept. A removed frame is replaced by the blend of the two kept frames around it, computed by [`geom::Pose::blend`]
//! with the weight of its own time. A subset is *within* a tolerance if both conditions hold at every frame:
//!
//! - Each vertex is finite exactly if it was finite originally, so triangles appear and disappear at the same frames.
//! - No finite vertex is farther from its original position than the tolerance. Distances are in f64, of f32 positions.
//!
//! If one frame can replace all others, for example because nothing moves, the result is that frame alone.
//!
//! Among all subsets within the tolerance, the result has the fewest frames, then the least maximum error, then the
//! lexicographically smallest list. Feasible pairs of frames are the edges of a graph, and a subset is a path through
//! it (Imai, Iri 1988: Polygonal approximations of a curve). A subinterval of a feasible interval may be infeasible, so
//! a greedy search is not exact.
//!
//! Both motions are linear between neighbouring original frames. So between frames the error is at most the larger
//! error of the two ends, up to rounding.

mod fit;

pub use fit::{Reducer, ReductionError, measure};

impl Reducer<'_> {
    /// Returns the frames to keep, in ascending order, for a maximum error of `tolerance` scene units.
    ///
    /// The result does not depend on the machine or the number of threads.
    ///
    /// # Panics
    /// If `tolerance` is negative or NaN.
    #[must_use]
    pub fn fewest(&mut self, tolerance: f64) -> Vec<usize> {
        assert!(tolerance >= 0.0, "a tolerance is a number from 0 on");
        let limit = largest_square(tolerance);
        match self.best_single(limit) {
            Some(frame) => vec![frame],
            None => self.path(limit),
        }
    }

    /// Returns the frame that replaces all others with the least error, or `None` if no frame is within `limit`.
    fn best_single(&mut self, mut limit: f64) -> Option<usize> {
        let mut best = None;
        for frame in 0..self.frames() {
            let found = self.within([frame, frame], limit);
            if let Some(error) = found.filter(|&e| best.is_none() || e < limit) {
                (best, limit) = (Some(frame), error);
            }
        }
        best
    }

    /// Returns the best path from frame 0 to the last frame over intervals within `limit`, including both ends. The
    /// order of preference is: fewest edges, least maximum error, lexicographically first.
    fn path(&mut self, limit: f64) -> Vec<usize> {
        let layers = self.layers(limit);
        let costs = self.costs(&layers, limit);
        let worst = costs[0].unwrap_or(limit);
        let mut path = vec![0];
        for layer in &layers[1..] {
            let here = path[path.len() - 1];
            let is_best = |j: &&usize| {
                **j > here
                    && costs[**j].is_some_and(|c| c <= worst)
                    && self.within([here, **j], worst).is_some()
            };
            path.extend(layer.iter().find(is_best));
        }
        path
    }

    /// Returns the frames grouped by their least number of edges from frame 0, in ascending order. The last layer holds
    /// only the last frame.
    ///
    /// The n-th frame of a shortest path is in layer n.
    fn layers(&mut self, limit: f64) -> Vec<Vec<usize>> {
        let mut layers = vec![vec![0]];
        let mut waiting: Vec<usize> = (1..self.frames()).collect();
        while let Some(&last) = waiting.last() {
            let from = &layers[layers.len() - 1];
            let mut reaches = |to: usize| {
                // Tries near frames first, because they are more likely to be within the limit.
                let mut before = from.iter().rev().filter(|&&i| i < to);
                before.any(|&i| self.within([i, to], limit).is_some())
            };
            if reaches(last) {
                layers.push(vec![last]);
                break;
            }
            // Edges between neighbours have no error, so each layer reaches at least one frame.
            let (layer, rest): (Vec<_>, _) = waiting.iter().partition(|&&to| reaches(to));
            layers.push(layer);
            waiting = rest;
        }
        layers
    }

    /// Returns, for each frame, the least maximum error of a path to the last frame with one edge per layer. `None` if
    /// no such path exists.
    fn costs(&mut self, layers: &[Vec<usize>], limit: f64) -> Vec<Option<f64>> {
        let mut costs = vec![None; self.frames()];
        costs[self.frames() - 1] = Some(0.0);
        for pair in layers.windows(2).rev() {
            let cost = |&j: &usize| Some((costs[j]?, j));
            let mut onward: Vec<(f64, usize)> = pair[1].iter().filter_map(cost).collect();
            onward.sort_by(|a, b| a.0.total_cmp(&b.0));
            for &from in &pair[0] {
                costs[from] = self.cost(from, &onward, limit);
            }
        }
        costs
    }

    /// Returns the least maximum error of a path from a frame onward. `onward` holds the next layer's frames by
    /// ascending cost.
    fn cost(&mut self, from: usize, onward: &[(f64, usize)], limit: f64) -> Option<f64> {
        let mut best: Option<f64> = None;
        for &(cost, to) in onward.iter().filter(|&&(_, to)| to > from) {
            if best.is_some_and(|b| cost >= b) {
                break;
            }
            let error = self.within([from, to], best.unwrap_or(limit));
            best = error.map(|e| e.max(cost)).or(best);
        }
        best
    }
}

/// Returns the largest square whose rounded root is at most `tolerance`.
fn largest_square(tolerance: f64) -> f64 {
    let mut square = (tolerance * tolerance).min(f64::MAX);
    while square.sqrt() > tolerance {
        square = square.next_down();
    }
    while square < f64::MAX && square.next_up().sqrt() <= tolerance {
        square = square.next_up();
    }
    square
}

#[cfg(test)]
mod tests {
    //! Tests against the definition, in plain f64 loops that share no code with the implementation.

    use super::*;
    use geom::{KeyFrame, Point};
    use proptest::prelude::*;
    use std::sync::Arc;

    /// Returns the position of `vertex` at the time of `frame` if `kept` is played. Follows the definition directly.
    fn played_by_hand(keys: &[KeyFrame], kept: &[usize], frame: usize, vertex: usize) -> Point {
        let mut found = keys[kept[0]][vertex];
        for pair in kept.windows(2) {
            let (i, j) = (pair[0], pair[1]);
            let (a, b) = (keys[i][vertex], keys[j][vertex]);
            let alpha = ((frame as f64 - i as f64) / (j as f64 - i as f64)) as f32;
            if i < frame && frame < j {
                for axis in 0..3 {
                    found[axis] = a[axis] + (b[axis] - a[axis]) * alpha;
                }
            } else if frame == j {
                found = b;
            }
        }
        found
    }

    /// Returns the largest distance of any vertex in any frame if `kept` is played.
    fn error_by_hand(keys: &[KeyFrame], kept: &[usize]) -> f64 {
        let lost = |p: Point| p.iter().any(|x| !x.is_finite());
        let mut worst = 0.0;
        for (frame, points) in keys.iter().enumerate() {
            for (vertex, &wanted) in points.iter().enumerate() {
                let found = played_by_hand(keys, kept, frame, vertex);
                let way = |axis| f64::from(found[axis]) - f64::from(wanted[axis]);
                let distance = match (lost(found), lost(wanted)) {
                    (true, true) => 0.0,
                    (false, false) => (way(0).powi(2) + way(1).powi(2) + way(2).powi(2)).sqrt(),
                    _ => f64::INFINITY,
                };
                worst = f64::max(worst, distance);
            }
        }
        worst
    }

    /// Returns the best of all admissible subsets by count, error and order.
    fn best_by_hand(keys: &[KeyFrame], tolerance: f64) -> Vec<usize> {
        let mut all: Vec<(usize, f64, Vec<usize>)> = Vec::new();
        for set in 1_u32..1 << keys.len() {
            let kept: Vec<usize> = (0..keys.len()).filter(|i| set & (1 << i) != 0).collect();
            let ends = kept[0] == 0 && kept[kept.len() - 1] == keys.len() - 1;
            if ends || kept.len() == 1 {
                let error = error_by_hand(keys, &kept);
                all.push((kept.len(), error, kept));
            }
        }
        all.retain(|(_, error, _)| *error <= tolerance);
        all.sort_by(|a, b| a.partial_cmp(b).unwrap());
        all.swap_remove(0).2
    }

    /// Generates mostly integers, so that motion is often exactly linear or static. Some values are not finite or
    /// overflow when blended.
    fn coordinate() -> impl Strategy<Value = f32> + Clone {
        prop_oneof![
            20 => (-3_i8..=3).prop_map(f32::from),
            2 => -1.0_f32..1.0,
            1 => Just(f32::NAN),
            1 => Just(f32::INFINITY),
            1 => prop_oneof![Just(f32::MAX), Just(f32::MIN)],
        ]
    }

    fn key_frames(
        coordinate: impl Strategy<Value = f32> + Clone,
    ) -> impl Strategy<Value = Vec<KeyFrame>> {
        (1_usize..=7, 1_usize..=2).prop_flat_map(move |(frames, vertices)| {
            let point = prop::array::uniform3(coordinate.clone());
            prop::collection::vec(
                prop::collection::vec(point, vertices).prop_map(|k| Arc::new(k.into())),
                frames,
            )
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn reduction_keeps_the_smallest_subset(
            keys in key_frames(coordinate()),
            tolerances in prop::collection::vec(prop_oneof![Just(0.0), 0.0..6.0_f64, Just(1.0)], 3),
        ) {
            // The order of tolerances is random, because cached results must not change the answer.
            let mut reducer = Reducer::new(&keys);
            for tolerance in tolerances {
                let kept = reducer.fewest(tolerance);
                prop_assert_eq!(&kept, &best_by_hand(&keys, tolerance), "at {}", tolerance);
                let fit = measure(&keys, &kept);
                prop_assert_eq!(fit.max_error, error_by_hand(&keys, &kept));
                prop_assert!(fit.max_error <= tolerance && fit.rms <= fit.max_error);
            }
        }

        #[test]
        fn tolerance_bound_is_inclusive(
            keys in key_frames(-9.0_f32..9.0),
        ) {
            let ends = if keys.len() > 1 { vec![0, keys.len() - 1] } else { vec![0] };
            let error = error_by_hand(&keys, &ends);
            prop_assume!(error > 0.0);
            prop_assert!(Reducer::new(&keys).fewest(error).len() <= 2);
            let tighter = error.next_down();
            let kept = Reducer::new(&keys).fewest(tighter);
            prop_assert!(error_by_hand(&keys, &kept) <= tighter);
        }

        #[test]
        fn largest_square_matches_the_tolerance(tolerance in 0.0..1e38_f64, power in -60_i32..1) {
            let tolerance = tolerance * 10.0_f64.powi(power);
            let square = largest_square(tolerance);
            prop_assert!(square.sqrt() <= tolerance && square.next_up().sqrt() > tolerance);
        }
    }

    /// Returns vertices on a long wave. They span several blocks, of which the last is partly filled. The vertices of the
    /// second block are static.
    fn wave(frames: usize, vertices: usize) -> Vec<KeyFrame> {
        let place = |frame: usize, v: usize| {
            let is_static = (512..1024).contains(&v);
            let phase = if is_static { 0.0 } else { frame as f32 * 0.37 } + v as f32 * 0.01;
            [v as f32, phase.sin(), phase.cos()]
        };
        let frame = |f| (0..vertices).map(|v| place(f, v)).collect::<Vec<_>>();
        (0..frames).map(|f| Arc::new(frame(f).into())).collect()
    }

    #[test]
    fn reduction_checks_every_vertex_block() {
        let is_static = |keys: &[KeyFrame]| !Reducer::new(keys).blocks.contains(&(512..1024));
        assert!(is_static(&wave(9, 2100)));
        for spike in [0, 1023, 1400, 2099] {
            let mut keys = wave(9, 2100);
            Arc::get_mut(&mut keys[4]).unwrap()[spike][1] += 100.0;
            assert_eq!(is_static(&keys), spike != 1023);
            for tolerance in [0.0, 0.01, 0.1, 1.0, 3.0] {
                let kept = Reducer::new(&keys).fewest(tolerance);
                assert_eq!(kept, best_by_hand(&keys, tolerance), "at {tolerance}");
                assert!(kept.contains(&4), "frame 4 alone has the spike");
            }
        }
    }

    #[test]
    fn reduction_is_deterministic_across_thread_counts() {
        let keys = wave(12, 1500);
        let found = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                let mut reducer = Reducer::new(&keys);
                let kept = [1.0, 0.1, 0.03, 0.0].map(|t| reducer.fewest(t));
                let fits = kept.each_ref().map(|k| measure(&keys, k));
                (kept, fits.map(|f| (f.rms.to_bits(), f.worst)))
            })
        };
        assert_eq!(found(1), found(3));
    }

    #[test]
    fn fit_reports_worst_vertex_and_mean() {
        let at = |x: f32| Arc::new(vec![[x, 0.0, 0.0], [-x, 0.0, 0.0], [f32::NAN; 3]].into());
        let keys = vec![at(0.0), at(3.0), at(0.0), at(3.0), at(0.0)];
        let fit = measure(&keys, &[0, 4]);
        assert_eq!((fit.max_error, fit.worst), (3.0, Some((1, 0))));
        // Four of the ten finite vertices are off by 3.
        assert_eq!(fit.rms, (36.0_f64 / 10.0).sqrt());
        let exact = measure(&keys, &[0, 1, 2, 3, 4]);
        assert_eq!((exact.max_error, exact.worst, exact.rms), (0.0, None, 0.0));
    }
}
