//! Rejects options that would have no effect, before any work starts.

use super::{BackendName, Command, DeviceArgs, UpdateName};
use crate::open::has_own_trees;
use crate::stop::Stop;
use backend::Policy;
use clap::ArgMatches;
use clap::parser::ValueSource;

/// An option, whether it has an effect here, and otherwise the reason.
type Bond = (&'static str, bool, &'static str);

const ASYNC: &str = "goes only with --update async";
const CLIP: &str = "goes only with a .gltf or .glb scene";
const RECENTRE: &str = "goes only with a scene of files";
const ORACLE: &str = "goes only with --oracle-rays";
const AIMED: &str = "goes only with --leak-rays or --oracle-rays";
const FILES: &str = "goes only with pictures or --hits";
const HOST: &str = "goes only with trees that the host builds";

/// Options that `bench --compare` uses.
const COMPARED: [&str; 3] = ["compare", "fail_above", "quiet"];

/// Refuses an option that was given but has no effect.
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
    let has_files = |scenes: &[String]| ("recentre", scenes.iter().any(|s| has_file(s)), RECENTRE);
    let scene = std::slice::from_ref::<String>;
    match command {
        Command::Render(args) => {
            let update = args.update;
            let writes = !args.no_images || args.hits.is_some();
            let clips = may_have_clip(&args.scene) || args.chroma().any();
            vec![
                ("lockstep", may_be_async(update), ASYNC),
                ("predict", may_be_async(update), ASYNC),
                builders(&args.device, update),
                ("resume", writes, FILES),
                ("overwrite", writes, FILES),
                ("fps", clips, CLIP),
                has_files(scene(&args.scene)),
            ]
        }
        Command::Trace(args) => {
            let is_refit = args.update == Some(Policy::Refit);
            vec![
                ("tree_time", is_refit, "goes only with --update refit"),
                builders(&args.device, args.update),
                has_clip(scene(&args.scene)),
                has_files(scene(&args.scene)),
            ]
        }
        Command::Bench(args) => {
            let mut updates = args.measure.update.iter();
            let builds = |&b: &BackendName| updates.clone().any(|&u| host_builds(b, u));
            let builds = args.measure.backend.iter().any(builds);
            vec![
                ("predict", updates.any(|&u| may_be_async(u)), ASYNC),
                ("builder_threads", builds, HOST),
                ("fail_above", false, "goes only with --compare"),
                has_clip(&args.measure.scenes),
                has_files(&args.measure.scenes),
            ]
        }
        Command::Stress(args) => vec![has_clip(scene(&args.scene)), has_files(scene(&args.scene))],
        Command::Chart(args) => vec![
            has_clip(&args.measure.scenes),
            has_files(&args.measure.scenes),
        ],
        Command::Inspect(args) => {
            let reduces = args.reduce_keys.is_some();
            vec![
                has_clip(scene(&args.scene)),
                has_files(scene(&args.scene)),
                ("reduced_out", reduces, "goes only with --reduce-keys"),
            ]
        }
        Command::Conform(args) => {
            let oracle = args.oracle_rays > 0;
            vec![
                ("intersector", oracle || args.leak_rays > 0, AIMED),
                ("oracle_batch", oracle, ORACLE),
                ("scene", oracle, ORACLE),
            ]
        }
        Command::Stability(_) | Command::Info { .. } | Command::Merge(_) | Command::Doctor => {
            Vec::new()
        }
    }
}

fn builders(device: &DeviceArgs, update: UpdateName) -> Bond {
    ("builder_threads", host_builds(device.backend, update), HOST)
}

fn may_be_async(update: UpdateName) -> bool {
    update.is_none_or(Policy::builds_beside_frames)
}

fn host_builds(backend: BackendName, update: UpdateName) -> bool {
    !has_own_trees(backend) && !update.is_some_and(Policy::builds_on_device)
}

/// Returns whether an input of the scene can be a file, which a demo is not.
fn has_file(scene: &str) -> bool {
    scene.split('+').any(|input| !input.starts_with("demo:"))
}

/// Returns whether the scene can contain a clip: by its extension, or because it is a pattern.
fn may_have_clip(scene: &str) -> bool {
    let scene = scene.to_lowercase();
    let mut parts = [".gltf", ".glb", "*", "?", "["].iter();
    parts.any(|part| scene.contains(part))
}
