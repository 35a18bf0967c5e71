//! Key frames in; the fewest of them that stand for all within a bound out.
//!
//! Piecewise linear approximation with free knots, solved exactly. The first and
//! the last frame are kept, others may go; a frame that went is played back as
//! the blend of the two kept frames around it, by [`geom::Pose::blend`] itself at
//! the weight that its own time has between theirs. A set is *within* a tolerance
//! if at every frame every vertex is finite or not as it was, and no finite one
//! is further than that from where it was (distance in f64 of the f32 positions).
//! So a triangle comes and goes when it did. Where one frame stands for all
//! (nothing moves), it is kept alone.
//!
//! Of all sets within the tolerance, the answer is one of the fewest frames, of
//! those one of the least maximum error, of those the lexicographically first.
//! Feasible pairs of frames are the edges of a graph; a set is a path through it
//! (Imai, Iri 1988: Polygonal approximations of a curve). Being feasible is not
//! inherited by shorter intervals, so no greedy walk will do.
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
            let found = self.alone(frame, limit);
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
                    && self.within(here, **j, worst).is_some()
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
                before.any(|&i| self.within(i, to, limit).is_some())
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
            let error = self.within(from, to, best.unwrap_or(limit));
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
mod tests;
