//! Command lines that are taken, and those that are refused in one line.

use super::*;
use crate::values::Frames;
use clap::CommandFactory;

pub(super) fn parse(line: &str) -> Result<Command, Stop> {
    let words = line.split_whitespace().map(std::ffi::OsString::from);
    parse_from(std::iter::once("abvh".into()).chain(words))
}

pub(super) fn refused(line: &str) -> String {
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
fn what_commands_share_has_one_help_text() {
    let cli = Cli::command();
    let all = |option: &str| -> Vec<String> {
        let commands = cli.get_subcommands();
        let found = commands.flat_map(|c| c.get_arguments().filter(|a| a.get_id() == option));
        found
            .map(|a| {
                let help = a.get_long_help().or(a.get_help());
                format!("{:?} {help:?}", a.get_value_names())
            })
            .collect()
    };
    // Not `update`, `layout` and `intersector`: single ones belong to one run, lists to many.
    for (option, commands) in [("size", 3), ("warm_up", 2)] {
        let mut texts = all(option);
        assert_eq!(texts.len(), commands, "{option}");
        texts.dedup();
        assert_eq!(texts.len(), 1, "{option}: {texts:?}");
    }
    for (option, commands) in [("update", 2), ("layout", 1)] {
        let texts = all(option);
        let lists = texts.iter().filter(|t| t.contains("LIST"));
        let mut lists: Vec<_> = lists.collect();
        assert_eq!(lists.len(), commands, "{option}");
        lists.dedup();
        assert_eq!(lists.len(), 1, "{option}: {lists:?}");
    }
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
    assert_eq!(bench.layouts.layout, [LayoutName::Auto]);
    assert_eq!(bench.policies.update.len(), 3);
    let some = parse("bench demo:twist --layout fast --size 8x8 --warm-up 0");
    let Ok(Command::Bench(some)) = some else {
        panic!("options must be taken");
    };
    assert_eq!(some.layouts.layout, [LayoutName::Fast]);
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
