//! How often an intersector that is left to `auto` may be wrong.

use crate::values;
use clap::Args;

/// Option of whatever chooses an intersector.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct ToleranceArgs {
    /// Wrong rays a million, against the exact answer, that an intersector left to auto may have. At 0 it is
    /// exact; above, the cheapest of which a sample of the run's rays shows that it has fewer [default: 0]
    #[arg(long, value_name = "PPM", value_parser = values::tolerance)]
    pub(crate) tolerance: Option<f64>,
}

impl ToleranceArgs {
    /// What is tolerated of what is left to `auto`.
    pub(crate) fn ppm(self) -> f64 {
        self.tolerance.unwrap_or(0.0)
    }
}
