//! Key frames in; the fewest of them that stand for all within a bound out.
//!
//! Piecewise linear approximation with free knots, solved exactly. The first and the last frame are kept, others may
//! go; a frame that went is played back as the blend of the two kept frames around it, by [`geom::Pose::blend`] itself
//! at the weight that its own time has between theirs. A set is *within* a tolerance if at every frame every vertex is
//! finite or not as it was, and no finite one is further than that from where it was (distance in f64 of the f32
//! positions). So a triangle comes and goes when it did. Where one frame stands for all (nothing moves), it is kept
//! alone.
//!
//! Of all sets within the tolerance, the answer is one of the fewest frames, of those one of the least maximum error,
//! of those the lexicographically first. Feasible pairs of frames are the edges of a graph; a set is a path through it
//! (Imai, Iri 1988: Polygonal approximations of a curve). Being feasible is not inherited by shorter intervals, so no
//! greedy walk will do.
//!
//! Both motions are linear between neighbouring original frames, so between
//! frames the error is at most the larger of both ends', up to rounding.

mod fit;

pub use fit::{Fit, Reducer, measure};

impl Reducer<'_> {
    /// The frames to keep, ascending, for an error of `tolerance` at most, in scene units.
    ///
    /// Equal on every machine and for every number of threads.
    ///
    /// # Panics
    /// If `tolerance` is negative or not a number.
    #[must_use]
    pub fn fewest(&mut self, tolerance: f64) -> Vec<usize> {
        assert!(tolerance >= 0.0, "a tolerance is a number from 0 on");
        let limit = largest_square(tolerance);
        match self.best_single(limit) {
            Some(frame) => vec![frame],
            None => self.path(limit),
        }
    }

    /// The frame that alone stands best for all of them, if one does.
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

    /// The path from frame 0 to the last over intervals no worse than `limit`: of the fewest edges, among those of the least
    /// maximum error, among those the lexicographically first. Both ends included.
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

    /// Frames by the least number of edges from frame 0, ascending; up to the layer that holds the last frame, alone.
    ///
    /// A path of the fewest edges has its n-th frame in layer n.
    fn layers(&mut self, limit: f64) -> Vec<Vec<usize>> {
        let mut layers = vec![vec![0]];
        let mut waiting: Vec<usize> = (1..self.frames()).collect();
        while let Some(&last) = waiting.last() {
            let from = &layers[layers.len() - 1];
            let mut reaches = |to: usize| {
                // Near ones first: they are likelier to be within the limit.
                let mut before = from.iter().rev().filter(|&&i| i < to);
                before.any(|&i| self.within([i, to], limit).is_some())
            };
            if reaches(last) {
                layers.push(vec![last]);
                break;
            }
            // Edges between neighbours cost 0, so that some frame is reached.
            let (layer, rest): (Vec<_>, _) = waiting.iter().partition(|&&to| reaches(to));
            layers.push(layer);
            waiting = rest;
        }
        layers
    }

    /// For each frame, the least maximum error of a path to the last frame, one layer an edge; nothing if there is none.
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

    /// The least maximum error of a path on from a frame, over the next layer's frames by rising costs.
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

/// The largest square whose root, rounded, is at most `tolerance`.
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
    //! Against the definition, written out again in plain f64 loops that share no code with what they judge.

    use super::*;
    use geom::{KeyFrame, Point};
    use proptest::prelude::*;
    use std::sync::Arc;

    /// Where `vertex` is at the time of `frame` if `kept` is played, from the words alone.
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

    /// The largest distance of any vertex of any frame if `kept` is played.
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

    /// Every admissible subset, the best by count, error and order.
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

    /// Whole coordinates, so that motion is often exactly linear or still; now and then none, or one too large to blend.
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
        fn the_answer_is_the_best_of_all_subsets(
            keys in key_frames(coordinate()),
            tolerances in prop::collection::vec(prop_oneof![Just(0.0), 0.0..6.0_f64, Just(1.0)], 3),
        ) {
            // In any order: what is remembered must not change what is answered.
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
        fn a_tolerance_equal_to_an_error_admits_it_and_the_next_smaller_does_not(
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
        fn the_limit_on_squares_is_the_tolerance_itself(tolerance in 0.0..1e38_f64, power in -60_i32..1) {
            let tolerance = tolerance * 10.0_f64.powi(power);
            let square = largest_square(tolerance);
            prop_assert!(square.sqrt() <= tolerance && square.next_up().sqrt() > tolerance);
        }
    }

    /// Vertices of a long wave, of several blocks, the last of them partly filled and one at rest.
    fn wave(frames: usize, vertices: usize) -> Vec<KeyFrame> {
        let place = |frame: usize, v: usize| {
            let moving = if (600..1400).contains(&v) { 0.0 } else { 1.0 };
            let phase = frame as f32 * 0.37 + v as f32 * 0.01;
            [v as f32, moving * phase.sin(), moving * phase.cos()]
        };
        let frame = |f| (0..vertices).map(|v| place(f, v)).collect::<Vec<_>>();
        (0..frames).map(|f| Arc::new(frame(f).into())).collect()
    }

    #[test]
    fn meshes_of_many_blocks_are_judged_to_the_last_vertex() {
        let mut keys = wave(9, 2100);
        for spike in [0, 1023, 1400, 2099] {
            Arc::get_mut(&mut keys[4]).unwrap()[spike][1] += 100.0;
            for tolerance in [0.0, 0.01, 0.1, 1.0, 3.0] {
                let kept = Reducer::new(&keys).fewest(tolerance);
                assert_eq!(kept, best_by_hand(&keys, tolerance), "at {tolerance}");
                assert!(kept.contains(&4), "frame 4 alone has the spike");
            }
            Arc::get_mut(&mut keys[4]).unwrap()[spike][1] -= 100.0;
        }
    }

    #[test]
    fn the_answer_is_the_same_for_every_number_of_threads() {
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
    fn the_worst_place_is_the_first_and_the_mean_counts_every_finite_vertex() {
        let at = |x: f32| Arc::new(vec![[x, 0.0, 0.0], [-x, 0.0, 0.0], [f32::NAN; 3]].into());
        let keys = vec![at(0.0), at(3.0), at(0.0), at(3.0), at(0.0)];
        let fit = measure(&keys, &[0, 4]);
        assert_eq!((fit.max_error, fit.worst), (3.0, Some((1, 0))));
        // Four of ten finite vertices are off by 3.
        assert_eq!(fit.rms, (36.0_f64 / 10.0).sqrt());
        let exact = measure(&keys, &[0, 1, 2, 3, 4]);
        assert_eq!((exact.max_error, exact.worst, exact.rms), (0.0, None, 0.0));
    }
}
