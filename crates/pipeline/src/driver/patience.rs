//! Pauses requests after trees were rejected.
//!
//! Builds take cores and memory bandwidth from frames. If motion is periodic, the current tree may be as good as any
//! other, so that builds gain nothing. Each further rejection therefore doubles the pause before the next request. The
//! unit is the time from request to rejection. An adopted tree that saves little counts as a rejection. The pauses end
//! when a tree saves more, or when the current tree's cost exceeds its previous maximum by [`DEARER`].

/// Number of rejections in a row after which pauses stop growing. Builds then take a thirty-second of the time.
const MOST: u32 = 6;
/// Largest cost of an adopted tree, divided by the replaced tree's, that ends the pauses.
const WORTHWHILE: f64 = 0.9;
/// Factor by which a cost must exceed the previous maximum to end the pauses.
const DEARER: f64 = 1.1;

/// Counts rejections and sets the pause.
#[derive(Debug, Default)]
pub(super) struct Patience {
    /// Number of rejections, and of adoptions that save little, since the last adoption that saved more.
    rejections: u32,
    /// Frame from which on trees may be requested.
    until: u64,
    /// Largest cost of the current tree since that adoption.
    dearest: f64,
}

impl Patience {
    /// Records that frame `now` rejects a tree. Its request, build and evaluation took `frames` frames.
    pub(super) fn rejected(&mut self, now: u64, frames: u64) {
        let pause = (1 << self.rejections) - 1;
        self.rejections = (self.rejections + 1).min(MOST - 1);
        self.until = now + pause * frames;
    }

    /// Records that frame `now` adopts a tree. Its request, build and evaluation took `frames` frames. It costs `share`
    /// of the replaced tree's cost at the same positions.
    pub(super) fn adopted(&mut self, now: u64, frames: u64, share: f64) {
        if share > WORTHWHILE {
            self.rejected(now, frames);
        } else {
            *self = Self::default();
        }
    }

    /// Records the cost of the current tree in a frame.
    pub(super) fn observe(&mut self, cost: f64) {
        if cost > DEARER * self.dearest && self.dearest > 0.0 {
            (self.rejections, self.until) = (0, 0);
        }
        self.dearest = self.dearest.max(cost);
    }

    /// Returns whether a tree may be requested in frame `now`.
    pub(super) fn is_over(&self, now: u64) -> bool {
        now >= self.until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the number of frames until the next request, after each of `count` rejections.
    fn pauses(patience: &mut Patience, count: usize) -> Vec<u64> {
        let pause = |_| {
            patience.rejected(100, 10);
            (100..).find(|&now| patience.is_over(now)).unwrap() - 100
        };
        (0..count).map(pause).collect()
    }

    #[test]
    fn pauses_double_until_a_tree_is_adopted_or_the_current_one_costs_more_than_ever() {
        let mut patience = Patience::default();
        let all = [0, 10, 30, 70, 150, 310, 310];
        assert_eq!(pauses(&mut patience, 7), all);
        patience.adopted(100, 10, 0.9);
        assert_eq!(pauses(&mut patience, 2), all[..2]);
        for (cost, is_over) in [(2.0, false), (1.0, false), (2.1, false), (2.4, true)] {
            patience.observe(cost);
            assert_eq!(patience.is_over(101), is_over, "{cost}");
        }
        assert_eq!(pauses(&mut patience, 2), all[..2]);
    }

    #[test]
    fn a_tree_that_saves_less_than_a_tenth_counts_as_rejected() {
        let mut patience = Patience::default();
        pauses(&mut patience, 2);
        patience.adopted(100, 10, 0.91);
        assert!(!patience.is_over(129) && patience.is_over(130));
    }
}
