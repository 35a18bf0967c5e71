//! What was left to `auto`.

use serde::Serialize;
use std::fmt;

/// What `auto` took, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Taken {
    /// What was left open, such as `backend`.
    pub what: String,
    /// What was taken.
    pub takes: String,
    /// The reason.
    pub why: String,
}

impl fmt::Display for Taken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, takes, why } = self;
        write!(f, "{what} auto takes {takes}: {why}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_reads_as_a_sentence() {
        let [what, takes, why] = ["layout", "bvh2", "all have it"].map(str::to_owned);
        let taken = Taken { what, takes, why };
        assert_eq!(taken.to_string(), "layout auto takes bvh2: all have it");
    }
}
