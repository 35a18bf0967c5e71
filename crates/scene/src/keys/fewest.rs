//! The graph side: fewest edges first, then the lightest heaviest edge.

/// The path from frame 0 to the last of `frames` over edges no heavier than
/// `limit`: of the fewest edges, among those of the least maximum weight, among
/// those the lexicographically first. Both ends included.
///
/// `within(from, to, limit)` is the weight of an edge, or nothing if that is more
/// than `limit`. Edges between neighbours must cost 0. It is asked lazily.
pub(crate) fn fewest(
    frames: usize,
    limit: f64,
    within: &mut impl FnMut(usize, usize, f64) -> Option<f64>,
) -> Vec<usize> {
    let layers = layers(frames, limit, within);
    let costs = costs(&layers, frames, limit, within);
    let worst = costs[0].unwrap_or(limit);
    let mut path = vec![0];
    for layer in &layers[1..] {
        let here = path[path.len() - 1];
        let next =
            layer.iter().copied().filter(|&j| j > here).find(|&j| {
                costs[j].is_some_and(|c| c <= worst) && within(here, j, worst).is_some()
            });
        path.extend(next);
    }
    path
}

/// Frames by the least number of edges from frame 0, ascending; up to the layer that holds the last frame, alone.
///
/// A path of the fewest edges has its n-th frame in layer n.
fn layers(
    frames: usize,
    limit: f64,
    within: &mut impl FnMut(usize, usize, f64) -> Option<f64>,
) -> Vec<Vec<usize>> {
    let last = frames - 1;
    let mut layers = vec![vec![0]];
    let mut waiting: Vec<usize> = (1..frames).collect();
    while let Some(&end) = waiting.last() {
        let from = &layers[layers.len() - 1];
        let mut reaches = |to: usize| {
            // Near ones first: they are likelier to be within the limit.
            let before = from.iter().rev().filter(|&&i| i < to);
            before.copied().any(|i| within(i, to, limit).is_some())
        };
        if reaches(end) {
            layers.push(vec![last]);
            break;
        }
        let (layer, rest): (Vec<_>, _) = waiting.iter().partition(|&&to| reaches(to));
        assert!(!layer.is_empty(), "edges between neighbours cost 0");
        layers.push(layer);
        waiting = rest;
    }
    layers
}

/// For each frame, the least maximum weight of a path to the last frame, one layer an edge; nothing if there is none.
fn costs(
    layers: &[Vec<usize>],
    frames: usize,
    limit: f64,
    within: &mut impl FnMut(usize, usize, f64) -> Option<f64>,
) -> Vec<Option<f64>> {
    let mut costs = vec![None; frames];
    costs[frames - 1] = Some(0.0);
    for pair in layers.windows(2).rev() {
        let mut onward: Vec<(f64, usize)> = pair[1]
            .iter()
            .filter_map(|&j| Some((costs[j]?, j)))
            .collect();
        onward.sort_by(|a, b| a.0.total_cmp(&b.0));
        for &from in &pair[0] {
            let mut best: Option<f64> = None;
            for &(cost, to) in onward.iter().filter(|&&(_, to)| to > from) {
                if best.is_some_and(|b| cost >= b) {
                    break;
                }
                if let Some(weight) = within(from, to, best.unwrap_or(limit)) {
                    best = Some(weight.max(cost));
                }
            }
            costs[from] = best;
        }
    }
    costs
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Every subset that keeps both ends, judged by the definition.
    fn by_hand(frames: usize, limit: f64, weight: &dyn Fn(usize, usize) -> f64) -> Vec<usize> {
        let inner = frames.saturating_sub(2);
        let mut best: Option<(usize, f64, Vec<usize>)> = None;
        for set in 0..1_u32 << inner {
            let mut path = vec![0];
            path.extend((0..inner).filter(|i| set >> i & 1 == 1).map(|i| i + 1));
            if frames > 1 {
                path.push(frames - 1);
            }
            let worst = path
                .windows(2)
                .map(|w| weight(w[0], w[1]))
                .fold(0.0, f64::max);
            let found = (path.len(), worst, path);
            let better = best
                .as_ref()
                .is_none_or(|b| found.partial_cmp(b) == Some(std::cmp::Ordering::Less));
            if worst <= limit && better {
                best = Some(found);
            }
        }
        best.expect("all frames are always within").2
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        #[test]
        fn of_all_subsets_it_takes_the_one_the_definition_names(
            frames in 1_usize..=9,
            weights in prop::collection::vec(0_u8..12, 81),
            limit in 0_u8..12,
        ) {
            let weight = |i: usize, j: usize| {
                if j == i + 1 { 0.0 } else { f64::from(weights[i * 9 + j]) }
            };
            let mut within = |i: usize, j: usize, limit: f64| {
                assert!(i < j, "edges go forward: {i} to {j}");
                Some(weight(i, j)).filter(|&w| w <= limit)
            };
            let found = fewest(frames, f64::from(limit), &mut within);
            prop_assert_eq!(found, by_hand(frames, f64::from(limit), &weight));
        }
    }

    #[test]
    fn a_long_stretch_may_do_where_a_shorter_one_does_not() {
        // 0 to 4 is within, 0 to 2 and 0 to 3 are not: a walk that grows until it fails would miss it.
        let mut within =
            |i: usize, j: usize, _: f64| (j == i + 1 || (i, j) == (0, 4)).then_some(0.0);
        assert_eq!(fewest(6, 1.0, &mut within), [0, 4, 5]);
    }
}
