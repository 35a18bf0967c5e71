//! What may be asked of `stability`.

use super::SubjectName;
use crate::values;
use backend::Intersector;
use clap::Args;
use clap::builder::RangedU64ValueParser;
use std::path::PathBuf;

/// Options of `stability`.
#[derive(Args, Debug)]
pub(crate) struct StabilityArgs {
    /// Backends; auto is all that are present
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "auto"
    )]
    pub(crate) backend: Vec<SubjectName>,
    /// Adapter of the backends, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// Intersectors
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "moller-trumbore,woop,watertight,exact"
    )]
    pub(crate) intersector: Vec<Intersector>,
    /// Decides scenes and rays
    #[arg(long, value_name = "S", default_value_t = conformance::stress::Plan::default().seed)]
    pub(crate) seed: u64,
    /// Rays of each family
    #[arg(long, value_name = "N", default_value_t = conformance::stress::Plan::default().rays,
        value_parser = RangedU64ValueParser::<u32>::new().range(1..=1_000_000))]
    pub(crate) rays: u32,
    /// Check nothing; instead measure how often one backend's arithmetic errs, and write it to this file. That is
    /// the baseline which later checks of such devices are held to
    #[arg(long, value_name = "FILE", value_parser = values::file(), conflicts_with_all = ["json", "intersector", "seed", "rays"])]
    pub(crate) record: Option<PathBuf>,
    /// With --record: seeds to measure, from 1
    #[arg(long, value_name = "N", default_value = "32",
        value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
    /// File for the results
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) json: Option<PathBuf>,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}
