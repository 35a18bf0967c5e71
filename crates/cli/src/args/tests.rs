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
    for (option, commands) in [("size", 5), ("triangles", 2), ("warm_up", 4)] {
        let mut texts = all(option);
        assert_eq!(texts.len(), commands, "{option}");
        texts.dedup();
        assert_eq!(texts.len(), 1, "{option}: {texts:?}");
    }
    for (option, commands) in [("update", 3), ("layout", 3)] {
        let texts = all(option);
        let lists = texts.iter().filter(|t| t.contains("LIST"));
        let mut lists: Vec<_> = lists.collect();
        assert_eq!(lists.len(), commands, "{option}");
        lists.dedup();
        assert_eq!(lists.len(), 1, "{option}: {lists:?}");
    }
}

#[test]
fn each_command_has_defaults_of_its_own() {
    let (Ok(Command::Bench(bench)), Ok(Command::Growth(growth)), Ok(Command::Crossover(cross))) =
        (parse("bench"), parse("growth"), parse("crossover"))
    else {
        panic!("commands go without options");
    };
    assert_eq!(bench.size.size, [640, 360]);
    assert_eq!(bench.layouts.layout, [LayoutName::Auto]);
    assert_eq!(
        growth.layouts.layout,
        [LayoutName::Bvh2, LayoutName::Fast],
        "a list"
    );
    assert_eq!(
        (bench.policies.update.len(), growth.policies.update.len()),
        (3, 4)
    );
    assert_eq!(growth.timing.size.size, [1280, 720]);
    assert_eq!(
        cross.triangles.triangles.0,
        [10_000, 70_000, 250_000, 1_600_000]
    );
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
fn what_would_do_nothing_is_refused_with_what_it_stands_beside() {
    for (line, idle, beside) in [
        (
            "render --update refit --lockstep 1",
            "--lockstep",
            "--update async",
        ),
        (
            "render --update t-sah --predict off",
            "--predict",
            "--update async",
        ),
        (
            "render --tolerance 3 --intersector exact",
            "--tolerance",
            "--intersector auto",
        ),
        (
            "render --backend vulkan-rt --builder-threads 2",
            "--builder-threads",
            "trees that the host builds",
        ),
        (
            "render --update device-rebuild --builder-threads 2",
            "--builder-threads",
            "trees that the host",
        ),
        ("render --no-images --resume", "--resume", "--hits"),
        ("render --no-images --out d", "--no-images", "--out"),
        ("render demo:twist --fps 30", "--fps", ".glb"),
        ("render a.obj+b/ --fps 30", "--fps", ".glb"),
        (
            "trace a.ply --time 0 --rays r --out o --fps 30",
            "--fps",
            ".glb",
        ),
        (
            "trace a.ply --time 0 --rays r --out o --tree-time 1",
            "--tree-time",
            "--update refit",
        ),
        (
            "trace a.ply --time 0 --rays r --out o --intersector woop --tolerance 1",
            "--tolerance",
            "auto",
        ),
        (
            "trace a.ply --time 0 --rays r --out o --backend vulkan-rt --builder-threads 1",
            "--builder-threads",
            "host",
        ),
        (
            "bench --update refit,rebuild --predict on,off",
            "--predict",
            "--update async",
        ),
        (
            "bench --with-auto --predict off",
            "--predict",
            "--with-auto",
        ),
        (
            "bench --intersector exact --tolerance 1",
            "--tolerance",
            "--intersector auto",
        ),
        ("bench --update async --dwell 1", "--dwell", "async"),
        (
            "bench --backend vulkan-rt --builder-threads 2",
            "--builder-threads",
            "host",
        ),
        ("bench a.obj b.ply --fps 12", "--fps", ".gltf"),
        ("bench --compare a b --size 8x8", "--size", "--compare"),
        ("bench demo:twist --compare a b", "SCENE", "--compare"),
        ("bench --dwell-every 2", "--dwell-every", "--dwell"),
        ("bench --rounds 2", "--rounds", "--with-auto"),
        ("bench --fail-above 2", "--fail-above", "--compare"),
        ("chart --fps 12", "--fps", ".gltf"),
        ("inspect demo:twist --fps 12", "--fps", ".gltf"),
        (
            "inspect a.glb --reduce-keys 1 --tolerance 1",
            "--tolerance",
            "--reduce-keys",
        ),
        (
            "inspect a.glb --reduced-out d",
            "--reduced-out",
            "--reduce-keys",
        ),
        (
            "conform --cases 0 --law closest_hits_equal_the_reference",
            "--law",
            "--cases 0",
        ),
        ("conform --cases 3 --case 2", "--cases", "--case"),
        ("conform --offsets 0,10", "--offsets", "--leak-rays"),
        (
            "conform --intersector exact",
            "--intersector",
            "--oracle-rays",
        ),
        (
            "conform --oracle-batch 3",
            "--oracle-batch",
            "--oracle-rays",
        ),
        ("stability --seeds 3", "--seeds", "--record"),
        ("stability --record f --rays 9", "--record", "--rays"),
    ] {
        let text = refused(line);
        assert!(
            text.contains(idle) && text.contains(beside),
            "{line}: {text}"
        );
    }
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
        "bench --update async,rebuild --dwell 1 --dwell-every 2",
        "bench --backend cpu,vulkan-rt --builder-threads 2 --tolerance 2",
        "bench --compare a b --fail-above 3 --json c --quiet",
        "bench --with-auto --rounds 2 --builder-threads 1",
        "conform --cases 0 --leak-rays 9 --offsets 0 --intersector exact",
        "conform --seed 2 --law closest_hits_equal_the_reference --case 3",
    ] {
        let taken = parse(line);
        assert!(taken.is_ok(), "{line}: {taken:?}");
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
