//! Files of hits: the same whatever tree or thread count made them.

use crate::sandbox::{Sandbox, trial};
use libtest_mimic::Trial;
use std::io::Cursor;
use zip::ZipArchive;

pub(crate) fn trials() -> Vec<Trial> {
    vec![trial("hits::trace_repeats_render", trace_repeats_render)]
}

/// The rays that `render` writes, traced again: with a fresh tree, and with one of another time.
fn trace_repeats_render(sandbox: &Sandbox) {
    let scene = "demo:collide:2000";
    let frame = "--time-range 7.25..9 --frames 2 --size 40x30 --no-images --quiet";
    sandbox.does(&format!(
        "render {scene} {frame} --hits . --rays-out rays.npy"
    ));
    let expected = bits(sandbox, "hits_0000.npz");
    let shape = array::<u8>(sandbox, "hits_0000.npz", "shadow").0;
    assert_eq!(shape, [30, 40]);
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
