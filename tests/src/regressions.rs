//! Cases in which properties failed before, in proptest's files.
//!
//! Proptest itself would store its generator's state, which does not name a case. So we store a case's seed and number
//! in place of this state.

use conformance::{Disagreement, seed_bytes};
use proptest::test_runner::{FailurePersistence, FileFailurePersistence, PersistedSeed};

/// The cases of one property, in `proptest-regressions/PROPERTY.txt` of this package.
pub struct Regressions(FileFailurePersistence);

/// A seed and the number of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoredCase {
    /// The seed.
    pub seed: u64,
    /// The number of the case within the seed.
    pub number: u32,
}

impl Regressions {
    /// Returns the cases of a property.
    pub fn of(property: &str) -> Self {
        Self::at(format!(
            "{}/proptest-regressions/{property}.txt",
            env!("CARGO_MANIFEST_DIR")
        ))
    }

    /// Returns the cases in a file. Proptest keeps the path for as long as the program runs.
    pub fn at(path: String) -> Self {
        Self(FileFailurePersistence::Direct(path.leak()))
    }

    /// Reads the stored cases.
    pub fn cases(&self) -> Vec<StoredCase> {
        let stored = self.0.load_persisted_failures2(None);
        stored.iter().filter_map(StoredCase::read).collect()
    }

    /// Stores the case of a disagreement, if it is not stored yet.
    pub fn add(&mut self, found: &Disagreement) {
        let case = StoredCase {
            seed: found.seed,
            number: found.case,
        };
        if !self.cases().contains(&case) {
            let minimal = format_args!("{}", found.minimal);
            self.0
                .save_persisted_failure2(None, case.stored(), &minimal);
        }
    }
}

impl StoredCase {
    /// Reads a seed in proptest's notation: `cc ` (ChaCha), then hexadecimal digits.
    fn read(stored: &PersistedSeed) -> Option<Self> {
        let text = stored.to_string();
        let hex = text.strip_prefix("cc ")?;
        Some(Self {
            seed: u64::from_str_radix(hex.get(..16)?, 16).ok()?,
            number: u32::from_str_radix(hex.get(16..24)?, 16).ok()?,
        })
    }

    fn stored(self) -> PersistedSeed {
        let bytes = seed_bytes(self.seed, self.number);
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("cc {hex}").parse().expect("it is a seed of ChaCha")
    }
}
