//! Options beside others, on command lines.

use crate::args::tests::{parse, refused};

/// A command line, the option that would do nothing there, and what it stands beside or needs.
const IDLE: [(&str, &str, &str); 32] = [
    ("conform --cases 0 --seed 4", "--seed", "--cases 0"),
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
        "bench --intersector exact --tolerance 1",
        "--tolerance",
        "--intersector auto",
    ),
    (
        "bench --backend vulkan-rt --builder-threads 2",
        "--builder-threads",
        "host",
    ),
    ("bench a.obj b.ply --fps 12", "--fps", ".gltf"),
    ("bench --compare a b --size 8x8", "--size", "--compare"),
    ("bench demo:twist --compare a b", "SCENE", "--compare"),
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
];

#[test]
fn what_would_do_nothing_is_refused_with_what_it_stands_beside() {
    for (line, idle, beside) in IDLE {
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
