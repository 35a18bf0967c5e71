//! Options of what judges: `conform` and `stability`.

use super::BackendName;
use crate::values;
use backend::Intersector;
use clap::Args;
use clap::builder::{PossibleValuesParser, RangedU64ValueParser, TypedValueParser};
use conformance::{LAWS, OWN_TREE_LAWS};
use std::collections::BTreeSet;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(crate) struct TestArgs {
    /// Backends; auto is all that are present
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "auto")]
    pub(crate) backend: Vec<BackendName>,
    /// Adapter of the backends, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// File for the results
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) json: Option<PathBuf>,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ConformArgs {
    /// Scenes that rays of --oracle-rays are aimed at, beside the meshes made from the seed
    #[arg(value_name = "SCENE", value_parser = values::scene())]
    pub(crate) scene: Vec<String>,
    /// Let a scene's files name files outside its folder (mtllib of OBJ, URIs of glTF)
    #[arg(long)]
    pub(crate) allow_outside: bool,
    #[command(flatten)]
    pub(crate) test: TestArgs,
    /// Decides scenes and rays
    #[arg(long, value_name = "S", default_value = "1")]
    pub(crate) seed: u64,
    /// Random cases that each law is tried on; 0 tries no law, only what else is asked for
    #[arg(long, value_name = "N", default_value = "36", conflicts_with = "case")]
    pub(crate) cases: u32,
    /// Try only these laws, by name; a name that is none is answered by all that there are
    #[arg(long, value_name = "LIST", value_delimiter = ',', hide_possible_values = true,
        value_parser = PossibleValuesParser::new(law_names()))]
    pub(crate) law: Vec<String>,
    /// Only the case of this number
    #[arg(long, value_name = "N")]
    pub(crate) case: Option<u32>,
    /// Also aim so many rays, in all, at edges and vertices of closed bodies, where none may slip through
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) leak_rays: u64,
    /// Also compare so many rays, in all, with exact answers. Meshes of many kinds are near and far, huge and tiny.
    /// Rays go at insides, edges and vertices, in planes, along axes, from surfaces and from afar. A wrong answer
    /// of exact is a disagreement, one of watertight is counted
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) oracle_rays: u64,
    /// Of those rays, only the batch of this number
    #[arg(long, value_name = "B")]
    pub(crate) oracle_batch: Option<u64>,
    /// How those rays are traced [default: exact for --oracle-rays, watertight for --leak-rays]
    #[arg(long, value_name = "INTERSECTOR",
        value_parser = PossibleValuesParser::new(["watertight", "exact"]).try_map(|name| name.parse::<Intersector>()))]
    pub(crate) intersector: Option<Intersector>,
}

#[derive(Args, Debug)]
pub(crate) struct StabilityArgs {
    #[command(flatten)]
    pub(crate) test: TestArgs,
    /// Intersectors
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "moller-trumbore,woop,watertight,exact")]
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
    #[arg(long, value_name = "N", default_value = "32", requires = "record",
        value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
}

fn law_names() -> BTreeSet<&'static str> {
    let all = LAWS.iter().chain(OWN_TREE_LAWS);
    all.map(|l| l.name).collect()
}
