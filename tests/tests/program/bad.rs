//! Bad usage and bad input: exit 2, one clear line, nothing written.

use crate::bad_scenes::{FRAMES, SCENES, obj};
use crate::devices::{BACKENDS, Subject};
use crate::sandbox::{SQUARE, Sandbox, ensure, trial};
use integration::scenes::REAL;
use libtest_mimic::Trial;

/// A case: its name, the input it needs, the words after `abvh`, and what must be said.
pub(crate) type Case = (&'static str, Input, &'static str, &'static [&'static str]);

/// Files of input, with their bytes.
pub(crate) type Input = fn() -> Vec<(&'static str, Vec<u8>)>;

/// No input at all.
pub(crate) fn nothing() -> Vec<(&'static str, Vec<u8>)> {
    Vec::new()
}

/// A .npy file of `shape` whose data is `bytes` zeros.
fn npy(descr: &str, shape: &str, bytes: usize) -> Vec<(&'static str, Vec<u8>)> {
    let square = ("a.obj", SQUARE.as_bytes().to_vec());
    vec![("rays.npy", npy_of(descr, shape, &vec![0; bytes])), square]
}

/// A .npy file of `shape` that holds `data`.
pub(crate) fn npy_of(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.as_bytes());
    file.extend(data);
    file
}

const USAGE: [Case; 25] = [
    (
        "nothing_left_to_measure",
        nothing,
        "bench demo:twist:500 --backend vulkan-rt --update rebuild --layout fast",
        &["nothing is left to measure", "vulkan-rt", "fast"],
    ),
    (
        "unknown_demo",
        nothing,
        "render demo:nothing",
        &["nothing", "grove"],
    ),
    (
        "demo_of_no_triangles",
        nothing,
        "render demo:twist:0",
        &["0"],
    ),
    (
        "demo_of_some_triangles",
        nothing,
        "render demo:twist:some",
        &["some"],
    ),
    (
        "no_frames",
        nothing,
        "render demo:twist:100 --frames 0",
        &["--frames", "0"],
    ),
    (
        "frames_reversed",
        nothing,
        "render demo:twist:100 --frames 5..2",
        &["--frames", "5..2"],
    ),
    (
        "frames_beyond_the_end",
        nothing,
        "render demo:twist:100 --frames 0..5000",
        &["5000"],
    ),
    (
        "no_width",
        nothing,
        "render demo:twist:100 --size 0x5",
        &["--size", "0x5"],
    ),
    (
        "too_many_pixels",
        nothing,
        "render demo:twist:100 --size 100000x100000",
        &["100000x100000", "16384"],
    ),
    (
        "size_of_one_number",
        nothing,
        "render demo:twist:100 --size 100",
        &["--size", "100"],
    ),
    (
        "eye_is_not_a_number",
        nothing,
        "render demo:twist:100 --eye nan,0,0",
        &["--eye", "nan"],
    ),
    (
        "eye_at_target",
        nothing,
        "render demo:twist:100 --eye 1,2,3 --look-at 1,2,3",
        &["eye"],
    ),
    (
        "no_field_of_view",
        nothing,
        "render demo:twist:100 --fov 180",
        &["--fov", "180"],
    ),
    (
        "no_threads",
        nothing,
        "render demo:twist:100 --threads 0",
        &["--threads", "0"],
    ),
    (
        "unknown_option",
        nothing,
        "render demo:twist:100 --colour red",
        &["--colour"],
    ),
    ("unknown_command", nothing, "paint demo:twist", &["paint"]),
    (
        "unknown_update",
        nothing,
        "render demo:twist:100 --update often",
        &["often"],
    ),
    (
        "lockstep_without_async",
        nothing,
        "render demo:twist:100 --update refit --lockstep 1",
        &["lockstep"],
    ),
    (
        "absent_backend",
        nothing,
        "render demo:twist:100 --backend vulkan --adapter none",
        &["vulkan"],
    ),
    (
        "time_range_reversed",
        nothing,
        "render demo:twist:100 --time-range 3..1",
        &["--time-range", "3..1"],
    ),
    (
        "time_is_not_a_number",
        nothing,
        "trace demo:twist:100 --time nan --rays rays.npy --out h.npz",
        &["--time", "nan"],
    ),
    (
        "clip_of_a_demo",
        nothing,
        "render demo:twist:100 --clip Walk",
        &["demo:twist:100", "Walk", ".gltf"],
    ),
    (
        "clip_of_a_mesh",
        || obj(SQUARE),
        "render a.obj --clip 0",
        &["a.obj", "clip", ".glb"],
    ),
    (
        "output_below_a_file",
        || obj(SQUARE),
        "render demo:twist:100 --frames 1 --size 8x8 --out a.obj/pictures",
        &["a.obj/pictures"],
    ),
    (
        "statistics_below_nowhere",
        || obj(SQUARE),
        "render demo:twist:100 --frames 1 --size 8x8 --no-images --stats a.obj/stats.json",
        &["a.obj/stats.json"],
    ),
];

const TRACE: &str = "trace a.obj --time 0 --rays rays.npy --out hits.npz";

const RAYS: [Case; 7] = [
    ("rays_absent", || obj(SQUARE), TRACE, &["rays.npy"]),
    (
        "rays_of_five_numbers",
        || npy("<f4", "(2, 5)", 40),
        TRACE,
        &["rays.npy", "5", "6"],
    ),
    (
        "rays_in_one_row",
        || npy("<f4", "(12,)", 48),
        TRACE,
        &["rays.npy", "12", "6"],
    ),
    (
        "rays_in_double_precision",
        || npy("<f8", "(2, 6)", 96),
        TRACE,
        &["rays.npy", "f8", "32"],
    ),
    (
        "rays_of_integers",
        || npy("<i4", "(2, 6)", 48),
        TRACE,
        &["rays.npy", "i4"],
    ),
    (
        "rays_cut_short",
        || npy("<f4", "(2, 6)", 40),
        TRACE,
        &["rays.npy"],
    ),
    (
        "rays_that_are_text",
        || [vec![("rays.npy", b"0 0 0 1 1 1".to_vec())], obj(SQUARE)].concat(),
        TRACE,
        &["rays.npy"],
    ),
];

pub(crate) fn trials() -> Vec<Trial> {
    let empty = trial("bad::empty_directory", |sandbox| {
        std::fs::create_dir(sandbox.path().join("d"))?;
        sandbox.run("render d").fails(2, &["d", "empty"])
    });
    let robot = REAL.into_iter().filter(|scene| scene.name == "robot");
    let clip = robot.map(|scene| {
        scene.trial("an_unknown_clip_is_answered_by_those_there_are", |scene| {
            let words = format!("render {} --clip gallop", scene.path()?);
            Sandbox::new()
                .run(&words)
                .fails(2, &["gallop", "Dance", "Idle"])
        })
    });
    let one = |case: Case| trial(&format!("bad::{}", case.0), move |s| refused(s, case, ""));
    let quoted = trial("bad::what_a_terminal_obeys_is_spelt_out", spelt_out);
    cases()
        .map(one)
        .chain(BACKENDS.into_iter().flat_map(beside))
        .chain([empty, quoted])
        .chain(clip)
        .collect()
}

fn cases() -> impl Iterator<Item = Case> {
    SCENES.into_iter().chain(FRAMES).chain(USAGE).chain(RAYS)
}

/// The same input before another backend than the one `auto` takes.
fn beside(backend: Subject) -> Vec<Trial> {
    let takes_one = |case: &Case| !case.2.contains("--backend") && !case.2.starts_with("paint");
    let one = |case: Case| {
        backend.trial(&format!("bad::{}::{}", backend.name, case.0), move |s| {
            refused(s, case, &format!("--backend {}", backend.name))
        })
    };
    cases().filter(takes_one).map(one).collect()
}

fn spelt_out(sandbox: &Sandbox) -> Result<(), libtest_mimic::Failed> {
    for (words, says) in [
        ("render --size \u{1b}[31m8x", "'\\u{1b}[31m8x'"),
        ("render --backend x\u{202e}y", "'x\\u{202e}y'"),
        ("render a\u{202e}jbo.\u{200b}", "a\\u{202e}jbo.\\u{200b}"),
        ("render --\u{1b}[2J", "'--\\u{1b}[2J'"),
    ] {
        sandbox.run(words).fails(2, &[says])?;
    }
    Ok(())
}

fn refused(
    sandbox: &Sandbox,
    (_, input, words, says): Case,
    options: &str,
) -> Result<(), libtest_mimic::Failed> {
    for (name, bytes) in input() {
        sandbox.write(name, bytes);
    }
    let before = sandbox.files();
    sandbox.run(&format!("{words} {options}")).fails(2, says)?;
    let after = sandbox.files();
    ensure(before == after, || format!("abvh {words} left {after:?}"))
}
