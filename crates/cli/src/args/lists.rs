//! Options that commands share. Each command gives lists defaults of its own.

use super::{BackendName, UpdateName};
use crate::values;
use clap::Args;

#[derive(Args, Clone, Debug)]
pub(crate) struct PoliciesArgs {
    /// Update policies
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) update: Vec<UpdateName>,
}

#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct SizeArgs {
    /// Pixels of a frame
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "1280x720")]
    pub(crate) size: [u32; 2],
}

impl SizeArgs {
    pub(crate) fn count(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }
}

/// How a device is got ready to be measured.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct WarmUpArgs {
    /// Seconds for which a device repeats the first frame of each run, uncounted, before the others. It goes on until that
    /// takes as long as before, for half a second at most. 0 leaves it out [default: 0.7 on a GPU]
    #[arg(long, value_name = "SECONDS", value_parser = values::warm_up)]
    pub(crate) warm_up: Option<f64>,
}

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

/// How far a vertex may be from where it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Tolerance {
    /// In scene units.
    Units(f64),
    /// As a share of the diagonal of the scene's bounds.
    Share(f64),
}

pub(super) fn tolerance(text: &str) -> Result<Tolerance, String> {
    let number = text.strip_suffix('%').unwrap_or(text);
    match number.trim().parse::<f64>() {
        Ok(n) if n >= 0.0 && n.is_finite() => Ok(match number == text {
            true => Tolerance::Units(n),
            false => Tolerance::Share(n / 100.0),
        }),
        _ => Err(
            "a tolerance is a length from 0 on, such as 0.01, or a share of the diagonal, such as 0.1%"
                .to_owned(),
        ),
    }
}

/// Whether a backend makes and traces trees in ways of its own. It need not be present.
pub(crate) fn has_own_trees(backend: BackendName) -> bool {
    matches!(
        backend,
        BackendName::VulkanRt | BackendName::VulkanRtFastTrace
    )
}
