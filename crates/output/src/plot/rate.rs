//! How often something went wrong, and how sure that is.

/// Two-sided 95 % of the normal distribution.
const Z: f64 = 1.959_964;

/// A share of rays, with an interval that covers the true one in 95 of 100 cases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rate {
    /// What was seen.
    pub(crate) value: f64,
    /// Not less than this.
    pub(crate) low: f64,
    /// Not more than this.
    pub(crate) high: f64,
}

impl Rate {
    /// `wrong` of `tested`; `None` if nothing was tested.
    ///
    /// For none wrong the bound is the rule of three, `3 / tested` (one-sided; Hanley, Lippman-Hand 1983);
    /// otherwise Wilson's score interval (Wilson 1927).
    pub(crate) fn of(wrong: u64, tested: u64) -> Option<Self> {
        if tested == 0 {
            return None;
        }
        let n = tested as f64;
        let p = wrong.min(tested) as f64 / n;
        if wrong == 0 {
            let high = (3.0 / n).min(1.0);
            return Some(Self {
                value: 0.0,
                low: 0.0,
                high,
            });
        }
        let scale = 1.0 / (1.0 + Z * Z / n);
        let middle = (p + Z * Z / (2.0 * n)) * scale;
        let half = Z * scale * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        Some(Self {
            value: p,
            low: (middle - half).clamp(0.0, p),
            high: (middle + half).clamp(p, 1.0),
        })
    }

    /// The same per so many rays.
    pub(crate) fn per(self, rays: f64) -> Self {
        Self {
            value: self.value * rays,
            low: self.low * rays,
            high: self.high * rays,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn none_wrong_is_bounded_by_the_rule_of_three() {
        let r = Rate::of(0, 1_000_000).unwrap().per(1e6);
        assert_eq!((r.value, r.low), (0.0, 0.0));
        assert!((r.high - 3.0).abs() < 1e-12);
        assert_eq!(Rate::of(0, 2).unwrap().high, 1.0);
        assert_eq!(Rate::of(0, 0), None);
    }

    #[test]
    fn some_wrong_have_wilsons_interval() {
        // 10 of 100: 0.0552 to 0.1744 (Newcombe 1998 gives the method; the numbers follow from the formula).
        let r = Rate::of(10, 100).unwrap();
        assert!(
            (r.low - 0.05523).abs() < 1e-5 && (r.high - 0.17437).abs() < 1e-5,
            "{r:?}"
        );
    }

    #[test]
    fn more_wrong_than_tested_is_all_wrong() {
        let r = Rate::of(9, 3).unwrap();
        assert!(r.value == 1.0 && r.high == 1.0 && r.low > 0.2 && r.low < 1.0);
        let r = Rate::of(u64::MAX, u64::MAX).unwrap();
        assert!(r.low > 0.99 && r.high == 1.0);
    }
}
