//! Command lines that are taken, and those that are refused in one line.

use super::*;
use clap::CommandFactory;

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
    assert_eq!(args.size, [1280, 720]);
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
    assert_eq!(args.update, [UpdateName::Refit, UpdateName::Async]);
    assert_eq!(args.scenes, ["demo:twist"]);
    assert_eq!(args.frames, Frames::Count(3));
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    assert!(refused("render --size 0x5").contains("--size"));
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
