//! Runs of elements.

use std::ops::Range;

/// Runs in order but for what others, in order too, have of them.
#[must_use]
pub fn without(runs: &[Range<usize>], others: &[Range<usize>]) -> Vec<Range<usize>> {
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
    fn what_others_have_is_left_out() {
        let cut = |others: &[Range<usize>]| without(&[0..10, 20..30], others);
        assert_eq!(cut(&[]), [0..10, 20..30]);
        assert_eq!(cut(&[0..10, 12..14]), [20..30; 1]);
        assert_eq!(cut(&[2..4, 8..25]), [0..2, 4..8, 25..30]);
        assert_eq!(cut(&[0..3, 3..30]), [0..0; 0]);
    }
}
