//! Golden pictures: small, few, compared pixel by pixel.
//!
//! `ABVH_BLESS=1 cargo test -p integration --test images` writes them anew;
//! look at them before you commit. A picture that differs is left in the
//! target directory, and the failure says where.

use image::RgbImage;
use integration::program;
use libtest_mimic::{Arguments, Failed, Trial};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Name, words after `abvh render`, and the frame to keep.
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

/// A house with a roof on a field: quads, triangles, and a door left open to the light.
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

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let trial = |(name, words, frame): (&'static str, &'static str, usize)| {
        Trial::test(name, move || picture(name, words, frame))
    };
    libtest_mimic::run(&arguments, PICTURES.map(trial).into()).exit_code()
}

fn picture(name: &str, words: &str, frame: usize) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    fs::write(folder.path().join("house.obj"), HOUSE)?;
    fs::write(folder.path().join("nothing.obj"), NOTHING)?;
    let options = "--size 96x64 --update refit --quiet --out .";
    let line = format!("render {words} {options}");
    let output = program::run(folder.path(), line.split(' '));
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    compare(name, &folder.path().join(format!("frame_{frame:04}.png")))
}

/// Compares `new` with the picture kept under `name`, or keeps it if that is asked for.
fn compare(name: &str, new: &Path) -> Result<(), Failed> {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("golden")
        .join(format!("{name}.png"));
    if std::env::var_os("ABVH_BLESS").is_some_and(|v| v == "1") {
        fs::copy(new, &golden)?;
        return Ok(());
    }
    let found = image::open(new)?.into_rgb8();
    let expected = image::open(&golden)
        .map_err(|e| format!("{}: {e}", golden.display()))?
        .into_rgb8();
    let Some(difference) = difference(&found, &expected) else {
        return Ok(());
    };
    let beside = keep(name, new)?;
    let (golden, beside) = (golden.display(), beside.display());
    Err(format!("{difference}\nexpected: {golden}\nfound:    {beside}").into())
}

/// Keeps a picture that differs where it outlives the test.
fn keep(name: &str, new: &Path) -> Result<PathBuf, Failed> {
    let folder = program::target_dir().join("test-images");
    fs::create_dir_all(&folder)?;
    let beside = folder.join(format!("{name}.png"));
    fs::copy(new, &beside)?;
    Ok(beside)
}

fn difference(found: &RgbImage, expected: &RgbImage) -> Option<String> {
    if found.dimensions() != expected.dimensions() {
        return Some(format!(
            "{:?} pixels, not {:?}",
            found.dimensions(),
            expected.dimensions()
        ));
    }
    let pixels = found.enumerate_pixels().zip(expected.pixels());
    let other: Vec<_> = pixels.filter(|((_, _, a), b)| a != b).collect();
    let ((x, y, a), b) = other.first()?;
    let count = other.len();
    Some(format!(
        "{count} pixels differ; the first is ({x}, {y}): {:?}, not {:?}",
        a.0, b.0
    ))
}
