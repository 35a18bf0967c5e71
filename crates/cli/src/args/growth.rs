//! What may be asked of `growth`.

use super::{LayoutsArgs, PoliciesArgs, TimingArgs, TrianglesArgs};
use crate::values;
use clap::Args;
use std::path::PathBuf;

/// Options of `growth`.
#[derive(Args, Debug)]
#[command(mut_arg("update", |arg| arg.default_value("async,refit,device-rebuild,t-sah")))]
#[command(mut_arg("layout", |arg| arg.default_value("bvh2,fast")))]
pub(crate) struct GrowthArgs {
    /// Demo, without a number of triangles
    #[arg(default_value = "demo:twist", value_parser = values::demo)]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) triangles: TrianglesArgs,
    /// Speed of the motion, in key frames a frame
    #[arg(long, value_name = "SPEED", default_value = "0.125", value_parser = values::speed)]
    pub(crate) speed: f64,
    #[command(flatten)]
    pub(crate) policies: PoliciesArgs,
    #[command(flatten)]
    pub(crate) layouts: LayoutsArgs,
    #[command(flatten)]
    pub(crate) timing: TimingArgs,
    /// Directory for growth.svg, growth.csv and growth.json
    #[arg(long, value_name = "DIR", default_value = "abvh-growth")]
    pub(crate) out: PathBuf,
}
