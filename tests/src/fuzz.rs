//! Fuzzing of file readers: files of arbitrary bytes are loaded or refused with a message, without a panic.
//!
//! Tests on mutated seeds and the fuzzers in `fuzz/` both call [`Format::load`].

mod mutate;

pub use mutate::Mutator;

use crate::scenes::workspace;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// A format of input: a file format that the program reads, or a command line as a text file.
#[derive(Clone, Copy)]
pub struct Format {
    /// Name of the format and of the folder of its seeds.
    pub name: &'static str,
    /// File name extension, without a dot.
    pub extension: &'static str,
    load: fn(&Path) -> Result<(), String>,
}

/// Meshes as text.
pub const OBJ: Format = format("obj", "obj", scene);
/// Meshes as text, or in binary of either byte order.
pub const PLY: Format = format("ply", "ply", scene);
/// Clips as text with embedded buffers.
pub const GLTF: Format = format("gltf", "gltf", scene);
/// Clips in one binary file.
pub const GLB: Format = format("glb", "glb", scene);
/// Lists of rays.
pub const NPY: Format = format("npy", "npy", rays);
/// Command-line arguments after `abvh`, one per line.
pub const COMMAND: Format = format("command", "txt", command);

const fn format(
    name: &'static str,
    extension: &'static str,
    load: fn(&Path) -> Result<(), String>,
) -> Format {
    Format {
        name,
        extension,
        load,
    }
}

impl Format {
    /// Loads `bytes` from a temporary file of this format. They may be valid or not.
    pub fn load_bytes(self, bytes: &[u8]) {
        let folder = TempDir::new().expect("a temporary folder is available");
        let path = folder.path().join("case").with_extension(self.extension);
        fs::write(&path, bytes).expect("a case can be written");
        self.load(&path).ok();
    }

    /// Loads a file of this format, or returns why it is invalid. Panics if the loader panics or refuses without a
    /// message.
    pub fn load(self, path: &Path) -> Result<(), String> {
        let loaded = (self.load)(path);
        if let Err(why) = &loaded {
            assert!(!why.trim().is_empty(), "refused without a message");
        }
        loaded
    }

    /// Returns the paths of small valid files, and of files that caused failures in the past.
    pub fn seeds(self) -> Vec<PathBuf> {
        let folder = workspace().join("tests/seeds").join(self.name);
        let entries = fs::read_dir(folder).expect("each format has seeds");
        let mut paths: Vec<_> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
        paths.sort();
        paths
    }
}

fn scene(path: &Path) -> Result<(), String> {
    let name = path.to_str().ok_or("not UTF-8")?;
    let scene = scene::open(name, &scene::SceneOptions::default()).map_err(|e| e.to_string())?;
    let triangles = scene.animation.triangles().len();
    assert_eq!(scene.colours.len(), triangles, "one colour per triangle");
    Ok(())
}

/// Has the program parse a command line and print its help, so that nothing is run.
///
/// The program is built here, unless `ABVH_PROGRAM` names it.
fn command(path: &Path) -> Result<(), String> {
    let text = fs::read(path).map_err(|e| e.to_string())?;
    let words = text.split(|&b| b == b'\n').filter(|word| !word.is_empty());
    let words: Vec<_> = words.map(argument).collect();
    // Arguments after `--` are not options, so `--help` would have no effect.
    if words.iter().any(|word| word == "--") || text.contains(&0) {
        return Err("no command line".to_owned());
    }
    let named = std::env::var_os("ABVH_PROGRAM");
    let program = named.unwrap_or_else(|| crate::program::abvh().into());
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut command = Command::new(program);
    command.args(words).arg("--help").current_dir(folder);
    let output = command.output().expect("the program starts");
    let (has_out, has_err) = (!output.stdout.is_empty(), !output.stderr.is_empty());
    match output.status.code() {
        Some(0) if has_out && !has_err => Ok(()),
        Some(2) if !has_out && is_refusal(&output) => Err(String::from_utf8_lossy(&output.stderr)
            .trim_end()
            .to_owned()),
        _ => panic!("neither printed help nor refused the command line: {output:?}"),
    }
}

/// Returns whether the program's standard error is one line of plain text that starts with `abvh: `.
fn is_refusal(output: &Output) -> bool {
    let line = output.stderr.strip_suffix(b"\n").unwrap_or_default();
    let line = std::str::from_utf8(line).unwrap_or_default();
    line.starts_with("abvh: ") && !line.contains(char::is_control)
}

#[cfg(unix)]
fn argument(bytes: &[u8]) -> OsString {
    std::os::unix::ffi::OsStringExt::from_vec(bytes.to_vec())
}

#[cfg(not(unix))]
fn argument(bytes: &[u8]) -> OsString {
    String::from_utf8_lossy(bytes).into_owned().into()
}

fn rays(path: &Path) -> Result<(), String> {
    let rays = output::RayFile::open(path).and_then(|file| file.read([0.0; 3]));
    rays.map(drop).map_err(|e| e.to_string())
}
