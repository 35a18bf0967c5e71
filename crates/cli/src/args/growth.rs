//! What may be asked of `growth`.

use super::{LayoutName, TimingArgs, UpdateName};
use crate::values::{self, Sizes};
use clap::Args;
use std::path::PathBuf;

/// Options of `growth`.
#[derive(Args, Debug)]
pub(crate) struct GrowthArgs {
    /// Demo, without a number of triangles
    #[arg(default_value = "demo:twist", value_parser = values::demo)]
    pub(crate) scene: String,
    /// Triangles, about so many: a list, or a range that is gone through by 1, 2 and 5
    #[arg(long, value_name = "LIST|A..B", default_value = "10K..20M", value_parser = values::sizes)]
    pub(crate) triangles: Sizes,
    /// Speed of the motion, in key frames a frame
    #[arg(long, value_name = "SPEED", default_value = "0.125", value_parser = values::speed)]
    pub(crate) speed: f64,
    /// Update policies
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "async,refit,device-rebuild,t-sah"
    )]
    pub(crate) update: Vec<UpdateName>,
    /// Layouts
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "bvh2,fast"
    )]
    pub(crate) layout: Vec<LayoutName>,
    #[command(flatten)]
    pub(crate) timing: TimingArgs,
    /// Directory for growth.svg, growth.csv and growth.json
    #[arg(long, value_name = "DIR", default_value = "abvh-growth")]
    pub(crate) out: PathBuf,
}
