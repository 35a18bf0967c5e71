//! Files of hits: the same whatever tree, policy or thread count made them.

use crate::runs::bytes;
use crate::sandbox::{Sandbox, trial};
use libtest_mimic::Trial;
use std::io::Cursor;
use zip::ZipArchive;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("hits::no_policy_changes_them", no_policy_changes_them),
        trial("hits::trace_repeats_render", trace_repeats_render),
    ]
}

/// Each with another number of threads than the one before.
const RUNS: [&str; 8] = [
    "rebuild --threads 2",
    "refit --threads 1",
    "t-sah --threads 2",
    "async --threads 1",
    "async --predict off --threads 2",
    "async --predict off --lockstep 3 --threads 1",
    "async --lockstep 0 --threads 2",
    "async --lockstep 7 --threads 1",
];

fn no_policy_changes_them(sandbox: &Sandbox) {
    let render = |out: &str, options: &str| {
        let words = "render demo:shatter:3000 --frames 10 --size 40x30 --no-images --quiet";
        sandbox.does(&format!("{words} --hits {out} --update {options}"));
        bytes(sandbox, out)
    };
    let expected = render("expected", "rebuild --threads 1");
    assert_eq!(expected.len(), 10);
    for options in RUNS {
        let out = options.replace(' ', "-");
        assert!(render(&out, options) == expected, "{options}");
    }
}

/// The rays that `render` writes, traced again: with a fresh tree, and with one of another time.
fn trace_repeats_render(sandbox: &Sandbox) {
    let scene = "demo:collide:2000";
    let frame = "--time-range 7.25..9 --frames 2 --size 40x30 --no-images --quiet";
    sandbox.does(&format!(
        "render {scene} {frame} --hits . --rays-out rays.npy"
    ));
    let expected = bits(sandbox, "hits_0000.npz");
    promised_types(sandbox, &expected);
    let words = format!("trace {scene} --time 7.25 --rays rays.npy --out h.npz");
    for options in [
        "",
        "--update refit --tree-time 0",
        "--update rebuild --threads 1",
    ] {
        sandbox.does(&format!("{words} {options}"));
        assert!(bits(sandbox, "h.npz") == expected, "{options}");
    }
    sandbox.does(&format!("{words} --any-hit"));
    let hit: Vec<u8> = array(sandbox, "h.npz", "hit").1;
    let met = expected[0].iter().map(|&i| u8::from(i != u32::MAX));
    assert!(met.eq(hit), "any-hit disagrees");
}

/// Shapes, and how arrays tell of misses.
fn promised_types(sandbox: &Sandbox, [triangle, t, ..]: &[Vec<u32>; 4]) {
    let (shape, shadow) = array::<u8>(sandbox, "hits_0000.npz", "shadow");
    assert_eq!(shape, [30, 40]);
    assert_eq!(array::<u32>(sandbox, "hits_0000.npz", "triangle").0, shape);
    for i in 0..triangle.len() {
        let miss = triangle[i] == u32::MAX;
        assert_eq!(miss, t[i] == f32::INFINITY.to_bits(), "t of ray {i}");
        assert!(shadow[i] <= u8::from(!miss), "shadow of ray {i}");
    }
    let hits = triangle.iter().filter(|&&i| i != u32::MAX).count();
    let some = hits > 0 && hits < triangle.len() && shadow.contains(&1);
    assert!(some, "{hits} hits");
}

/// `triangle`, and `t`, `u`, `v` by their bits.
fn bits(sandbox: &Sandbox, file: &str) -> [Vec<u32>; 4] {
    let bits = |name| -> Vec<u32> {
        let (_, xs) = array::<f32>(sandbox, file, name);
        xs.into_iter().map(f32::to_bits).collect()
    };
    [
        array(sandbox, file, "triangle").1,
        bits("t"),
        bits("u"),
        bits("v"),
    ]
}

/// Shape and values of one array of a file.
pub(crate) fn array<T: npyz::Deserialize>(
    sandbox: &Sandbox,
    file: &str,
    name: &str,
) -> (Vec<u64>, Vec<T>) {
    let mut archive = ZipArchive::new(Cursor::new(sandbox.read(file))).unwrap();
    let array = archive.by_name(&format!("{name}.npy"));
    let array = array.unwrap_or_else(|e| panic!("{file}, {name}: {e}"));
    let array = npyz::NpyFile::new(array).unwrap();
    (array.shape().to_vec(), array.into_vec().unwrap())
}
