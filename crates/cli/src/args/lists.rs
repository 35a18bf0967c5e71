//! Options that commands share. Each command gives them defaults of its own.

use super::BackendName;
use crate::values;
use clap::Args;

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

#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct ToleranceArgs {
    /// Wrong rays in a million, against exact arithmetic, that --intersector auto may cause. A sample of the run's
    /// rays decides which intersectors are within; the cheapest of them is taken. 0 takes exact [default: 0]
    #[arg(long, value_name = "PPM", value_parser = values::number(|rate: f64| (0.0..=1e6).contains(&rate),
        "a tolerance is a number of rays a million, from 0 to 1000000"))]
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
    const SAYS: &str =
        "a tolerance is a length from 0 on, such as 0.01, or a share of the diagonal, such as 0.1%";
    let is_share = text.ends_with('%');
    let number = values::number(|n: f64| n >= 0.0, SAYS)(text.strip_suffix('%').unwrap_or(text));
    match number.map_err(|_| SAYS)? {
        n if is_share => Ok(Tolerance::Share(n / 100.0)),
        n => Ok(Tolerance::Units(n)),
    }
}

/// Whether a backend makes and traces trees in ways of its own. It need not be present.
pub(crate) fn has_own_trees(backend: BackendName) -> bool {
    matches!(
        backend,
        BackendName::VulkanRt | BackendName::VulkanRtFastTrace
    )
}
