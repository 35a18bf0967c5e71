//! Positions whose source is a buffer of the calling program instead of the host.

use std::ops::Range;

/// A buffer with the positions of a run of vertices.
#[derive(Clone)]
pub struct PointsSource<B> {
    /// The buffer.
    pub buffer: B,
    /// Byte offset of the first position.
    pub offset: u64,
    /// The run of the scene's vertices.
    pub run: Range<usize>,
}

/// The runs of a scene's vertices whose source is a buffer of the calling program.
pub struct ExternalPoints<B> {
    /// Sorted by first vertex.
    runs: Vec<Range<usize>>,
    /// Sources from which the device has not copied yet.
    pub pending: Vec<PointsSource<B>>,
}

impl<B> Default for ExternalPoints<B> {
    fn default() -> Self {
        Self {
            runs: Vec::new(),
            pending: Vec::new(),
        }
    }
}

impl<B> ExternalPoints<B> {
    /// Adds a source, or replaces the source of the same run.
    pub fn set(&mut self, source: PointsSource<B>) {
        self.release(&source.run);
        let at = self.runs.partition_point(|r| r.start < source.run.start);
        self.runs.insert(at, source.run.clone());
        self.pending.push(source);
    }

    /// Removes the source of a run. The host is then its source again.
    pub fn release(&mut self, run: &Range<usize>) {
        self.pending.retain(|source| source.run != *run);
        self.runs = subtract(&self.runs, std::slice::from_ref(run));
    }

    /// Returns the runs, in order.
    pub fn runs(&self) -> &[Range<usize>] {
        &self.runs
    }

    /// Returns the parts of `runs` whose source is the host.
    pub fn host_runs(&self, runs: &[Range<usize>]) -> Vec<Range<usize>> {
        subtract(runs, &self.runs)
    }
}

/// Returns the parts of `runs` that `others` does not cover. Both lists must be sorted.
fn subtract(runs: &[Range<usize>], others: &[Range<usize>]) -> Vec<Range<usize>> {
    let rest = runs.iter().flat_map(|run| {
        let within = others
            .iter()
            .filter(|o| o.start < run.end && run.start < o.end);
        let starts = std::iter::once(run.start).chain(within.clone().map(|o| o.end));
        let ends = within.map(|o| o.start).chain([run.end]);
        starts.zip(ends).map(|(start, end)| start..end)
    });
    rest.filter(|run| !run.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subtracts_ranges() {
        let cut = |others: &[Range<usize>]| subtract(&[0..10, 20..30], others);
        assert_eq!(cut(&[]), [0..10, 20..30]);
        assert_eq!(cut(&[0..10, 12..14]), [20..30; 1]);
        assert_eq!(cut(&[2..4, 8..25]), [0..2, 4..8, 25..30]);
        assert_eq!(cut(&[0..3, 3..30]), [0..0; 0]);
    }

    #[test]
    fn latest_source_of_a_run_replaces_earlier_one() {
        let mut points = ExternalPoints::default();
        let source = |buffer: u8, run| PointsSource {
            buffer,
            offset: 0,
            run,
        };
        for (buffer, run) in [(1, 20..30), (2, 0..10), (3, 20..30)] {
            points.set(source(buffer, run));
        }
        assert_eq!(points.runs(), [0..10, 20..30]);
        let pending: Vec<u8> = points.pending.iter().map(|source| source.buffer).collect();
        assert_eq!(pending, [2, 3]);
        assert_eq!(points.host_runs(&[5..40; 1]), [10..20, 30..40]);
        points.release(&(0..10));
        assert_eq!(points.host_runs(&[5..40; 1]), [5..20, 30..40]);
    }
}
