//! Command lines that are accepted, and those that are rejected in one line.

use super::*;
use crate::error::INVALID;
use crate::frame_list::FrameChoice;
use backend::{Intersector, Policy};
use std::path::PathBuf;

fn parse_line(line: &str) -> Result<CommandSettings, CliError> {
    let words = line.split_whitespace().map(std::ffi::OsString::from);
    parse(std::iter::once("abvh".into()).chain(words))
}

fn refused(line: &str) -> String {
    match parse_line(line) {
        Err(e) if e.code == INVALID => {
            let text = e.to_string();
            assert!(!text.starts_with("error"), "{text}");
            text
        }
        other => panic!("{line}: {other:?}"),
    }
}

#[test]
fn clap_definition_is_valid() {
    CommandLine::command().debug_assert();
}

fn render(line: &str) -> RenderSettings {
    match parse_line(line) {
        Ok(CommandSettings::Render(args)) => *args,
        other => panic!("{line}: {other:?}"),
    }
}

fn bench(line: &str) -> BenchSettings {
    match parse_line(line) {
        Ok(CommandSettings::Bench(args)) => *args,
        other => panic!("{line}: {other:?}"),
    }
}

#[test]
fn parses_defaults_lists_and_negative_coordinates() {
    let args = render("");
    assert_eq!(
        (&*args.scene, args.camera.size),
        ("demo:grove", [1280, 720])
    );
    assert_eq!(args.tracer.intersector, Intersector::Watertight);
    assert_eq!(args.out, PathBuf::from("abvh-out"));
    let measure = bench("bench").measure;
    assert_eq!((measure.camera.size, measure.update.len()), ([640, 360], 3));
    let camera = render("render a.obj --eye -1,2,-3 --light=-4,5,6").camera;
    let points = [[-1.0, 2.0, -3.0], [-4.0, 5.0, 6.0]].map(Some);
    assert_eq!([camera.eye, camera.light], points);
    let args = bench("bench demo:twist --update refit,async --frames 3 --warm-up 0");
    assert_eq!(
        args.measure.update,
        [Policy::Refit, Policy::Async].map(Some)
    );
    assert_eq!(args.measure.scenes, ["demo:twist"]);
    assert_eq!(args.measure.frames, FrameChoice::Count(3));
    assert_eq!(args.measure.warm_up, Some(0.0));
}

#[test]
fn help_uses_short_sentences() {
    let cli = CommandLine::command();
    let commands = cli.get_subcommands();
    let texts = commands.flat_map(|c| c.get_arguments().map(move |a| (c, a)));
    let long = texts.filter_map(|(command, option)| {
        let text = option.get_help()?.to_string();
        let longest = text.split(". ").map(|s| s.split(' ').count()).max();
        (longest > Some(25)).then(|| format!("{} {}: {text}", command.get_name(), option.get_id()))
    });
    let long: Vec<_> = long.collect();
    assert!(long.is_empty(), "{long:#?}");
}

/// Rejected command lines, each with parts of its message. For an option without effect, the message also says what the
/// option applies to.
const REFUSED: &str = "\
render --rays-out - | only --stats
render --hits - | only --stats
render --out - | only --stats
trace a.obj --time 0 --rays r.npy --out - | only --stats
bench --json - | only --stats
bench --csv - | only --stats
conform --json - | only --stats
stability --json - | only --stats
stability --record - | only --stats
render --size 0x5 | --size
bench --warm-up 99 | 60 seconds
render --frames 0 | --frames
chart --rays 0 | --rays
render --eye 1,2,nan | nan
render --intersector perfect | watertight
render --threads 0 | --threads
trace demo:twist | --rays
conform --backend opengl | opengl
conform --property gravity | gravity
conform --law gravity | --law was removed | use --property
conform --oracle-rays 9 | --oracle-rays was removed | --property continued_rays_visit_every_crossing_once
conform --case first | first
stability --backend opengl | opengl
stability --intersector sturdy | watertight
stability --rays 0 | --rays
stability --record b.json --seed 2 | --seed
render --update refit --lockstep 1 | --lockstep | --update async
render --update rebuild --predict off | --predict | --update async
render --update t-sah | t-sah | use --update refit
bench --update refit,t-sah | t-sah | use --update refit
render --layout fast | --layout was removed | --backend cpu-ref
bench --layout=bvh2,fast | --layout was removed | --backend cpu-ref
render --tolerance 3 | --tolerance was removed | use --intersector
trace a.ply --tolerance=3 | --tolerance was removed | use --intersector
render --update device-rebuild --builder-threads 2 | --builder-threads | trees that the host
conform --leak-rays 9 | --leak-rays was removed | use abvh stability
conform --intersector exact | conform --intersector was removed | use abvh stability
render --timeline t.html | --timeline was removed | use --stats
bench --compare a.json b.json | --compare was removed | --json
bench --against wgpu | --against was removed | --json
bench --fail-above=5 | --fail-above was removed | --json
inspect demo:twist --reduce-keys 1% | --reduce-keys was removed | no replacement
inspect demo:twist --reduced-out d | --reduced-out was removed | no replacement
render --no-images --resume | --resume | --hits
render --no-images --out d | --no-images | --out
render demo:twist --fps 30 | --fps | videos
render a.obj+b/ --fps 30 | --fps | videos
trace a.ply --time 0 --rays r --out o --fps 30 | --fps | .glb
trace a.ply --time 0 --rays r --out o --tree-time 1 | --tree-time | --update refit
trace a.ply --time 0 --rays r --out o --update device-rebuild --builder-threads 1 | --builder-threads | host
bench --intersector exact,auto | --intersector auto was removed | use --intersector watertight
bench --update device-rebuild --builder-threads 2 | --builder-threads | host
bench a.obj b.ply --fps 12 | --fps | .gltf
stress --update device-rebuild | possible values: rebuild, refit, async
chart --fps 12 | --fps | .gltf
inspect demo:twist --fps 12 | --fps | .gltf
inspect demo:twist+demo:hall --recentre | --recentre | files
conform --cases 3 --case 2 | --cases | --case
stability --record f --rays 9 | --record | --rays";

#[test]
fn rejects_invalid_or_useless_options() {
    for row in REFUSED.lines() {
        let (line, parts) = row.split_once(" | ").unwrap();
        let text = refused(line);
        let mut parts = parts.split(" | ");
        assert!(parts.all(|part| text.contains(part)), "{row}: {text}");
    }
}

#[test]
fn rivals_are_rejected_as_backends() {
    for name in rivals::RivalName::ALL {
        for command in ["render", "bench", "chart", "conform", "stability", "stress"] {
            let text = refused(&format!("{command} --backend {name}"));
            let says =
                format!("{name} is a rival, not a backend: use bench or chart with --rival {name}");
            assert_eq!(text, says);
        }
    }
    assert!(refused("bench --rival cpu").contains("--rival"));
}

#[test]
fn accepts_valid_command_lines() {
    for line in [
        "render --stats -",
        "render --lockstep 1",
        "render --update async --lockstep 1 --predict off",
        "render --no-images --hits h --resume",
        "render --update refit --builder-threads 2",
        "render hall.obj+figure.GLB@2,0,-1*0.5 --fps 30",
        "render figures/* --fps 30",
        "render demo:hall+a.obj --recentre",
        "trace a.glb --time 0 --rays r --out o --fps 9 --update refit --tree-time 1",
        "bench --backend cpu --rival embree,vulkan-rt --builder-threads 2 --no-cache",
        "bench --update async --builder-threads 2 --csv c",
        "conform --seed 2 --property hits_equal_the_reference --case 3",
    ] {
        let taken = parse_line(line);
        assert!(taken.is_ok(), "{line}: {taken:?}");
    }
}
