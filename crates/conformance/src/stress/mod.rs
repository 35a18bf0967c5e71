//! How often each intersector is wrong where arithmetic is hardest.
//!
//! A [`Family`] makes scenes and rays that are hard in one way. A [`StressTest`] asks them of a backend and counts
//! what differs from the exact answer (crate `oracle`, which shares no code with backends); on closed bodies also
//! leaks and double hits. [`bounds`] says which rates are to be expected: none at all of robust
//! intersectors, of others what was measured ([`baseline`]), with slack for chance. A rate above its bound is a
//! fault; so is one below, for then something is not what it is called.
//!
//! An [`audit::Audit`] asks rays by the million of scenes of all kinds, of which `exact` may get none wrong.

pub mod audit;
pub mod baseline;
pub mod bounds;
mod cell;
mod family;
mod scenes;
mod stress_test;

pub use cell::{Cell, Measure, Measured};
pub use family::Family;
pub use stress_test::{Closed, Rearranged, StressCounts, StressTest};

/// What to ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Decides scenes and rays.
    pub seed: u64,
    /// Rays of each family.
    pub rays: u32,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            seed: 1,
            rays: 8192,
        }
    }
}
