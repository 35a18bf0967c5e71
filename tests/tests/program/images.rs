//! Golden pictures: few and small, compared pixel by pixel.
//!
//! `ABVH_BLESS=1 cargo test -p integration --test program images` rewrites them. Check them before you commit. A
//! picture that differs is saved in the target directory, and the failure names the file.

use crate::sandbox::{Sandbox, trial};
use integration::program::target_dir;
use libtest_mimic::Trial;
use std::fs;
use std::path::Path;

/// Name, arguments after `abvh render`, and the frame to compare.
const PICTURES: [(&str, &str, usize); 7] = [
    ("grove", "demo:grove:6000 --frames 3", 1),
    ("collide", "demo:collide:6000 --frames 3", 1),
    ("shatter", "demo:shatter:6000 --frames 3", 2),
    ("twist", "demo:twist:4000 --frames 3", 2),
    ("house", "house.obj", 0),
    (
        "house-and-sky",
        "house.obj --eye 3,0.3,5 --look-at 0,1.9,0 --fov 60",
        0,
    ),
    ("nothing", "nothing.obj", 0),
];

/// A house with a roof on a field: quads, triangles, and an open doorway.
const HOUSE: &str = "
v -3 0 -3\nv 3 0 -3\nv 3 0 3\nv -3 0 3
v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1
v -1 1 -1\nv 1 1 -1\nv 1 1 1\nv -1 1 1
v 0 1.8 -1\nv 0 1.8 1
v 0.3 0 1\nv 0.3 0.7 1\nv -0.3 0.7 1\nv -0.3 0 1
f 1 4 3 2
f 5 6 10 9
f 6 7 11 10
f 8 5 9 12
f 7 15 16 11\nf 12 17 18 8\nf 11 16 17 12
f 9 10 13
f 11 12 14
f 10 11 14 13
f 12 9 13 14
";

const NOTHING: &str = "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

pub(crate) fn trials() -> Vec<Trial> {
    let one = |(name, words, frame)| {
        let named = format!("images::{name}");
        trial(&named, move |s| picture(s, name, words, frame))
    };
    PICTURES.map(one).into()
}

/// Compares a picture with the golden one called `name`, or replaces that if `ABVH_BLESS=1`.
fn picture(sandbox: &Sandbox, name: &str, words: &str, frame: usize) {
    sandbox.write("house.obj", HOUSE);
    sandbox.write("nothing.obj", NOTHING);
    let how = "--size 96x64 --update refit --quiet --out .";
    sandbox.run_ok(&format!("render {words} {how}"));
    let new = sandbox.path().join(format!("frame_{frame:04}.png"));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden");
    let golden = folder.join(format!("{name}.png"));
    if std::env::var_os("ABVH_BLESS").is_some_and(|v| v == "1") {
        fs::copy(new, &golden).unwrap();
        return;
    }
    let [found, expected] = [&new, &golden].map(|path| {
        let read = image::open(path).map(image::DynamicImage::into_rgb8);
        read.unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    });
    if found == expected {
        return;
    }
    // Saved in a folder that outlives the test.
    let folder = target_dir().join("test-images");
    fs::create_dir_all(&folder).unwrap();
    let beside = folder.join(format!("{name}.png"));
    fs::copy(&new, &beside).unwrap();
    let pixels = found.enumerate_pixels().zip(expected.pixels());
    let mut other = pixels.filter(|((_, _, a), b)| a != b);
    let first = other.next();
    panic!(
        "{:?} and {:?} differ, first in {first:?} and {} more\nexpected: {}\nfound:    {}",
        found.dimensions(),
        expected.dimensions(),
        other.count(),
        golden.display(),
        beside.display()
    );
}
