//! The Pareto front: points that no other beats in both speed and accuracy.

/// Indices of the front of `(time, error)` pairs, fastest first. Of equal pairs only the first is in it.
pub(crate) fn front(pairs: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    let key = |&i: &usize| pairs[i];
    order.sort_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let better = pairs[i].1 < least;
        least = least.min(pairs[i].1);
        better
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_front_falls_from_left_to_right() {
        let pairs = [(3.0, 0.0), (1.0, 5.0), (2.0, 5.0), (2.0, 1.0), (4.0, 0.0)];
        assert_eq!(front(&pairs), [1, 3, 0]);
        assert!(front(&[]).is_empty());
        assert_eq!(front(&[(1.0, 1.0), (1.0, 1.0)]), [0]);
    }

    proptest! {
        #[test]
        fn a_point_is_off_the_front_only_if_another_is_as_good(
            pairs in prop::collection::vec((0u8..9, 0u8..9), 0..40)
        ) {
            let pairs: Vec<_> = pairs.iter().map(|&(a, b)| (f64::from(a), f64::from(b))).collect();
            let found = front(&pairs);
            for (i, p) in pairs.iter().enumerate() {
                let beaten = pairs.iter().enumerate().any(|(j, q)| {
                    q.0 <= p.0 && q.1 <= p.1 && (q != p || j < i)
                });
                prop_assert_eq!(found.contains(&i), !beaten);
            }
        }
    }
}
