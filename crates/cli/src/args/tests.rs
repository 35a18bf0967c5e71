//! Command lines that are taken, and those that are refused in one line.

use super::*;
use crate::values::Frames;

fn parse(line: &str) -> Result<Command, Stop> {
    let words = line.split_whitespace().map(std::ffi::OsString::from);
    parse_from(std::iter::once("abvh".into()).chain(words))
}

fn refused(line: &str) -> String {
    match parse(line) {
        Err(Stop::Bad(e)) => {
            let text = e.to_string();
            assert!(!text.starts_with("error"), "{text}");
            text
        }
        other => panic!("{line}: {other:?}"),
    }
}

#[test]
fn the_definitions_fit_together() {
    Cli::command().debug_assert();
}

#[test]
fn no_argument_renders_the_grove() {
    let Ok(Command::Render(args)) = parse("") else {
        panic!("no arguments must mean render");
    };
    assert_eq!(args.scene, "demo:grove");
    assert_eq!(args.size.size, [1280, 720]);
    assert_eq!(args.out, PathBuf::from("abvh-out"));
}

#[test]
fn negative_coordinates_are_values_and_no_options() {
    let Ok(Command::Render(args)) = parse("render a.obj --eye -1,2,-3 --light=-4,5,6") else {
        panic!("negative numbers must be taken");
    };
    assert_eq!(args.camera.eye, Some([-1.0, 2.0, -3.0]));
    assert_eq!(args.camera.light, Some([-4.0, 5.0, 6.0]));
}

#[test]
fn lists_are_parted_by_commas() {
    let Ok(Command::Bench(args)) = parse("bench demo:twist --update refit,async --frames 3") else {
        panic!("lists must be taken");
    };
    assert_eq!(args.policies.update, [UpdateName::Refit, UpdateName::Async]);
    assert_eq!(args.scenes, ["demo:twist"]);
    assert_eq!(args.frames, Frames::Count(3));
}

#[test]
fn help_is_told_in_short_sentences() {
    let cli = Cli::command();
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

#[test]
fn each_command_has_defaults_of_its_own() {
    let Ok(Command::Bench(bench)) = parse("bench") else {
        panic!("bench goes without options");
    };
    assert_eq!(bench.size.size, [640, 360]);
    assert_eq!(bench.layout, [LayoutName::Auto]);
    assert_eq!(bench.policies.update.len(), 3);
    let some = parse("bench demo:twist --layout fast --size 8x8 --warm-up 0");
    let Ok(Command::Bench(some)) = some else {
        panic!("options must be taken");
    };
    assert_eq!(some.layout, [LayoutName::Fast]);
    assert_eq!(
        (some.size.size, &*some.warm_up.words()),
        ([8, 8], " --warm-up 0")
    );
}

#[test]
fn only_statistics_go_to_standard_output() {
    for line in [
        "render --timeline -",
        "render --rays-out -",
        "trace a.obj --time 0 --rays r.npy --out -",
        "bench --json -",
        "bench --csv -",
        "bench --growth -",
        "conform --json -",
        "stability --json -",
        "stability --record -",
    ] {
        assert!(refused(line).contains("only --stats"), "{line}");
    }
    assert!(parse("render --stats -").is_ok());
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    assert!(refused("render --size 0x5").contains("--size"));
    assert!(refused("bench --warm-up 99").contains("60 seconds"));
    assert!(refused("render --frames 0").contains("--frames"));
    assert!(refused("render --eye 1,2,nan").contains("nan"));
    assert!(refused("render --intersector perfect").contains("watertight"));
    assert!(refused("render --threads 0").contains("--threads"));
    assert!(refused("trace demo:twist").contains("--rays"));
    assert!(refused("paint").contains("paint"));
    assert!(refused("conform --backend opengl").contains("opengl"));
    assert!(refused("conform --law gravity").contains("gravity"));
    assert!(refused("conform --case first").contains("sliver-far-away"));
    assert!(refused("conform --offsets 1e9").contains("1e9"));
    assert!(refused("stability --backend opengl").contains("opengl"));
    assert!(refused("stability --intersector sturdy").contains("watertight"));
    assert!(refused("stability --rays 0").contains("--rays"));
    assert!(refused("stability --record b.json --seed 2").contains("--seed"));
    assert!(refused("inspect demo:twist --reduce-keys -1").contains("-1"));
    for tolerance in ["%", "-1", "-0.1%", "nan", "inf", "inf%", "1%%", "%1"] {
        let text = refused(&format!("inspect demo:twist --reduce-keys={tolerance}"));
        assert!(text.contains("0.1%"), "{tolerance}: {text}");
    }
}

#[test]
fn a_tolerance_is_a_length_or_a_share() {
    for (text, expected) in [
        ("0", Tolerance::Units(0.0)),
        ("2.5e-3", Tolerance::Units(2.5e-3)),
        ("1%", Tolerance::Share(0.01)),
    ] {
        let Ok(Command::Inspect(args)) = parse(&format!("inspect a --reduce-keys {text}")) else {
            panic!("{text}");
        };
        assert_eq!(args.reduce_keys, Some(expected));
    }
}

#[test]
fn the_intersector_is_watertight_but_where_it_is_left_to_auto() {
    let intersector = |words: &str| {
        let words = format!("abvh render demo:twist {words}");
        match parse_from(words.split(' ').map(Into::into)) {
            Ok(Command::Render(args)) => args.method.intersector,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(intersector("--quiet"), IntersectorName::Watertight);
    assert_eq!(intersector("--tolerance 3"), IntersectorName::Auto);
    assert_eq!(intersector("--backend cpu"), IntersectorName::Watertight);
}

/// A command line, the option that would do nothing there, and what it stands beside or needs.
const IDLE: &str = "\
conform --cases 0 --seed 4 | --seed | --cases 0
render --update refit --lockstep 1 | --lockstep | --update async
render --update t-sah --predict off | --predict | --update async
render --tolerance 3 --intersector exact | --tolerance | --intersector auto
render --backend vulkan-rt --builder-threads 2 | --builder-threads | trees that the host builds
render --update device-rebuild --builder-threads 2 | --builder-threads | trees that the host
render --no-images --resume | --resume | --hits
render --no-images --out d | --no-images | --out
render demo:twist --fps 30 | --fps | .glb
render a.obj+b/ --fps 30 | --fps | .glb
trace a.ply --time 0 --rays r --out o --fps 30 | --fps | .glb
trace a.ply --time 0 --rays r --out o --tree-time 1 | --tree-time | --update refit
trace a.ply --time 0 --rays r --out o --intersector woop --tolerance 1 | --tolerance | auto
trace a.ply --time 0 --rays r --out o --backend vulkan-rt --builder-threads 1 | --builder-threads | host
bench --update refit,rebuild --predict on,off | --predict | --update async
bench --intersector exact --tolerance 1 | --tolerance | --intersector auto
bench --backend vulkan-rt --builder-threads 2 | --builder-threads | host
bench a.obj b.ply --fps 12 | --fps | .gltf
bench --compare a b --size 8x8 | --size | --compare
bench demo:twist --compare a b | SCENE | --compare
bench --fail-above 2 | --fail-above | --compare
chart --fps 12 | --fps | .gltf
inspect demo:twist --fps 12 | --fps | .gltf
inspect a.glb --reduce-keys 1 --tolerance 1 | --tolerance | --reduce-keys
inspect a.glb --reduced-out d | --reduced-out | --reduce-keys
conform --cases 0 --law closest_hits_equal_the_reference | --law | --cases 0
conform --cases 3 --case 2 | --cases | --case
conform --offsets 0,10 | --offsets | --leak-rays
conform --intersector exact | --intersector | --oracle-rays
conform --oracle-batch 3 | --oracle-batch | --oracle-rays
stability --seeds 3 | --seeds | --record
stability --record f --rays 9 | --record | --rays";

#[test]
fn what_would_do_nothing_is_refused_with_what_it_stands_beside() {
    for row in IDLE.lines() {
        let [line, idle, beside] = *row.split(" | ").collect::<Vec<_>>() else {
            panic!("{row}");
        };
        let text = refused(line);
        assert!(text.contains(idle) && text.contains(beside), "{text}");
    }
    assert_eq!(IDLE.lines().count(), 32);
}

#[test]
fn what_does_something_is_taken() {
    for line in [
        "render --lockstep 1",
        "render --update async --lockstep 1 --predict off",
        "render --tolerance 3",
        "render --no-images --hits h --resume",
        "render --update refit --builder-threads 2",
        "render hall.obj+figure.GLB@2,0,-1*0.5 --fps 30",
        "render figures/* --fps 30",
        "trace a.glb --time 0 --rays r --out o --fps 9 --update refit --tree-time 1",
        "bench --predict on,off --builder-threads 2",
        "bench --backend cpu,vulkan-rt --builder-threads 2 --tolerance 2",
        "bench --compare a b --fail-above 3 --json c --quiet",
        "bench --update async --builder-threads 1,2 --csv c --growth g.svg",
        "conform --cases 0 --leak-rays 9 --offsets 0 --intersector exact",
        "conform --seed 2 --law closest_hits_equal_the_reference --case 3",
    ] {
        let taken = parse(line);
        assert!(taken.is_ok(), "{line}: {taken:?}");
    }
}
