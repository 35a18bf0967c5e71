//! How often an intersector that is left to `auto` may be wrong.

use crate::values;
use clap::Args;

/// Option of whatever chooses an intersector.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct ToleranceArgs {
    /// Wrong rays in a million, against exact arithmetic, that --intersector auto may cause. A sample of the run's
    /// rays decides which intersectors are within; the cheapest of them is taken. 0 takes exact [default: 0]
    #[arg(long, value_name = "PPM", value_parser = values::tolerance)]
    pub(crate) tolerance: Option<f64>,
}

impl ToleranceArgs {
    /// What is tolerated of what is left to `auto`.
    pub(crate) fn ppm(self) -> f64 {
        self.tolerance.unwrap_or(0.0)
    }
}
