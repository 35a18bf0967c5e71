//! Options that would do nothing with what they stand beside: refused, before any work.

use super::{
    BackendName, BenchArgs, Command, ConformArgs, IntersectorName, RenderArgs, TraceArgs,
    UpdateName,
};
use crate::open;
use crate::stop::Stop;
use clap::ArgMatches;
use clap::parser::ValueSource;

/// An option, whether it does something here, and what it would need or what leaves it without work.
type Bond = (&'static str, bool, &'static str);

const ASYNC: &str = "goes only with --update async";
const AUTO: &str = "goes only with --intersector auto";
const CLIP: &str = "goes only with a .gltf or .glb scene";
const ORACLE: &str = "goes only with --oracle-rays";
const FILES: &str = "goes only with pictures or --hits";
const HOST: &str = "goes only with trees that the host builds";

/// What `bench --compare` heeds beside its files.
const COMPARED: [&str; 4] = ["compare", "fail_above", "json", "quiet"];

/// # Errors
/// An option that was given does nothing.
pub(super) fn check(command: &Command, given: &ArgMatches) -> Result<(), Stop> {
    let is_given = |id: &str| given.value_source(id) == Some(ValueSource::CommandLine);
    if let Command::Bench(args) = command
        && !args.compare.is_empty()
    {
        let mut ids = given.ids().map(clap::Id::as_str);
        let idle = ids.find(|id| is_given(id) && !COMPARED.contains(id));
        return idle.map_or(Ok(()), |id| refuse(id, "does nothing beside --compare"));
    }
    let idle = |&(id, works, _): &Bond| !works && is_given(id);
    match bonds(command).into_iter().find(idle) {
        Some((id, _, why)) => refuse(id, why),
        None => Ok(()),
    }
}

fn refuse(id: &str, why: &str) -> Result<(), Stop> {
    let name = match id {
        "scene" | "scenes" => "SCENE".to_owned(),
        _ => format!("--{}", id.replace('_', "-")),
    };
    Err(Stop::bad(format!("{name} {why}")))
}

fn bonds(command: &Command) -> Vec<Bond> {
    let has_clip = |scenes: &[String]| ("fps", scenes.iter().any(|s| may_have_clip(s)), CLIP);
    let one = std::slice::from_ref::<String>;
    match command {
        Command::Render(args) => [&render(args)[..], &[has_clip(one(&args.scene))]].concat(),
        Command::Trace(args) => [&trace(args)[..], &[has_clip(one(&args.scene))]].concat(),
        Command::Bench(args) => [&bench(args)[..], &[has_clip(&args.scenes)]].concat(),
        Command::Chart(args) => vec![has_clip(&args.scenes)],
        Command::Inspect(args) => vec![
            has_clip(one(&args.scene)),
            (
                "tolerance",
                args.reduce_keys.is_none(),
                "does nothing beside --reduce-keys",
            ),
            (
                "reduced_out",
                args.reduce_keys.is_some(),
                "goes only with --reduce-keys",
            ),
        ],
        Command::Conform(args) => conform(args).to_vec(),
        Command::Stability(args) => {
            vec![("seeds", args.record.is_some(), "goes only with --record")]
        }
        Command::Info(_) | Command::Merge(_) => Vec::new(),
    }
}

fn render(args: &RenderArgs) -> [Bond; 6] {
    let update = args.policy.update;
    let (device, method) = (&args.device, args.method);
    let writes = !args.no_images || args.hits.is_some();
    [
        ("lockstep", may_be_async(update), ASYNC),
        ("predict", may_be_async(update), ASYNC),
        (
            "tolerance",
            method.intersector == IntersectorName::Auto,
            AUTO,
        ),
        ("builder_threads", host_builds(device.backend, update), HOST),
        ("resume", writes, FILES),
        ("overwrite", writes, FILES),
    ]
}

fn trace(args: &TraceArgs) -> [Bond; 3] {
    let (device, update) = (&args.device, args.update);
    let is_refit = update == UpdateName::Refit;
    let is_auto = args.method.intersector == IntersectorName::Auto;
    [
        ("tree_time", is_refit, "goes only with --update refit"),
        ("tolerance", is_auto, AUTO),
        ("builder_threads", host_builds(device.backend, update), HOST),
    ]
}

fn bench(args: &BenchArgs) -> [Bond; 4] {
    let (updates, backends) = (&args.policies.update, &args.backend);
    let any = |fits: &dyn Fn(UpdateName) -> bool| updates.iter().any(|&u| fits(u));
    let builds = |&b: &BackendName| any(&|u| host_builds(b, u));
    let is_auto = args.intersector.contains(&IntersectorName::Auto);
    [
        ("predict", any(&may_be_async), ASYNC),
        ("tolerance", is_auto, AUTO),
        ("builder_threads", backends.iter().any(builds), HOST),
        ("fail_above", false, "goes only with --compare"),
    ]
}

fn conform(args: &ConformArgs) -> [Bond; 6] {
    let (leaks, oracle) = (args.leak_rays > 0, args.oracle_rays > 0);
    let tries = args.cases > 0 || args.case.is_some();
    [
        ("law", tries, "does nothing beside --cases 0"),
        (
            "seed",
            tries || leaks || oracle,
            "does nothing beside --cases 0",
        ),
        ("offsets", leaks, "goes only with --leak-rays"),
        (
            "intersector",
            leaks || oracle,
            "goes only with --leak-rays or --oracle-rays",
        ),
        ("oracle_batch", oracle, ORACLE),
        ("scene", oracle, ORACLE),
    ]
}

fn may_be_async(update: UpdateName) -> bool {
    matches!(update, UpdateName::Async | UpdateName::Auto)
}

fn host_builds(backend: BackendName, update: UpdateName) -> bool {
    !open::has_own_trees(backend) && update != UpdateName::DeviceRebuild
}

/// Whether the word can name a clip: by its ending, or as a pattern.
fn may_have_clip(scene: &str) -> bool {
    let scene = scene.to_lowercase();
    [".gltf", ".glb", "*", "?", "["]
        .iter()
        .any(|part| scene.contains(part))
}

#[cfg(test)]
mod tests;
