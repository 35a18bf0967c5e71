//! Options that commands share which time many things. Each command gives them defaults of its own.

use super::{LayoutName, UpdateName};
use crate::values;
use crate::warm_up::WarmUp;
use clap::Args;

/// Policies to go through.
#[derive(Args, Clone, Debug)]
pub(crate) struct PoliciesArgs {
    /// Update policies
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) update: Vec<UpdateName>,
}

/// Layouts to go through.
#[derive(Args, Clone, Debug)]
pub(crate) struct LayoutsArgs {
    /// Layouts of the tree
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) layout: Vec<LayoutName>,
}

/// How large frames are.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct SizeArgs {
    /// Pixels of a frame
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "1280x720")]
    pub(crate) size: [u32; 2],
}

/// How a device is got ready to be measured.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct WarmUpArgs {
    /// Seconds for which a device repeats the first frame of each run, uncounted, before the others. It goes on until that
    /// takes as long as before, for half a second at most. 0 leaves it out [default: 0.7 on a GPU]
    #[arg(long, value_name = "SECONDS", value_parser = values::warm_up)]
    warm_up: Option<f64>,
}

impl WarmUpArgs {
    /// What was asked for.
    pub(crate) fn warm_up(self) -> WarmUp {
        self.warm_up.map_or(WarmUp::default(), WarmUp::asked)
    }

    /// The same on a command line, with a blank before it; empty if nothing was asked for.
    pub(crate) fn words(self) -> String {
        self.warm_up
            .map_or(String::new(), |seconds| format!(" --warm-up {seconds}"))
    }
}
