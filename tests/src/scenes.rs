//! Scenes to test with: demos, which are always there, and real ones, which may be absent.
//!
//! Real scenes are packed. They are looked for in the folder that `ABVH_SCENES` names, else in `../shared/scenes` beside the
//! workspace, and unpacked once into the target directory. Trials that need an absent pack show as ignored, with the reason.

use geom::Animation;
use libtest_mimic::Trial;
use scene::Scene;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// A scene and what to call it.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Name of the trial.
    pub name: &'static str,
    /// The demo; or the pack and what to open below its folder.
    spec: &'static str,
}

/// Every demo, small.
pub const DEMOS: [Source; 5] = [
    source("grove", "demo:grove:4000"),
    source("collide", "demo:collide:4000"),
    source("shatter", "demo:shatter:6000"),
    source("twist", "demo:twist:4000"),
    source("hall", "demo:hall:4000"),
];

/// Real scenes that move.
pub const REAL: [Source; 9] = [
    source("horse-gallop", "horse-gallop/models/horse-gallop"),
    source("horse-collapse", "horse-collapse/models/horse-collapse"),
    source("rod-twist", "ccd-rod-twist/ccd-rod-twist"),
    source("cloth-ball", "ccd-cloth-ball/ccd-cloth-ball"),
    source("n-body", "ccd-n-body-simulation/ccd-n-body-simulation"),
    source("robot", "small/gltf-robotexpressive/RobotExpressive.glb"),
    source("cesium-man", "small/gltf-cesiumman/CesiumMan.glb"),
    source(
        "morph-stress",
        "small/gltf-morphstress/MorphStressTest.gltf",
    ),
    source("fox", "small/gltf-fox/Fox.glb"),
];

const fn source(name: &'static str, spec: &'static str) -> Source {
    Source { name, spec }
}

impl Source {
    /// The pack that holds it, and what to open there; none for demos.
    fn packed(&self) -> Option<(&str, &str)> {
        self.spec.split_once('/')
    }

    /// What to give the program, unpacking the scene if need be.
    pub fn path(&self) -> String {
        let Some((pack, file)) = self.packed() else {
            return self.spec.to_owned();
        };
        let folder = unpacked(pack).expect("packs can be unpacked");
        folder.join(file).to_string_lossy().into_owned()
    }

    /// Opens the scene.
    pub fn open(&self) -> Scene {
        scene::open(&self.path(), &scene::Options::default()).expect("scenes can be read")
    }

    /// What moves, opened once a process.
    pub fn animation(&self) -> Arc<Animation> {
        static OPEN: Mutex<BTreeMap<&str, Arc<Animation>>> = Mutex::new(BTreeMap::new());
        let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        let known = open.entry(self.spec);
        Arc::clone(known.or_insert_with(|| self.open().animation))
    }

    /// A trial that runs on this scene; ignored, with the reason, where the scene is absent.
    pub fn trial(self, law: &str, run: impl FnOnce(Source) + Send + 'static) -> Trial {
        let trial = crate::trial(format!("{}::{law}", self.name), move || run(self));
        match self.packed().map(|(pack, _)| archive(pack)) {
            Some(Err(reason)) => trial.with_ignored_flag(true).with_kind(reason.to_string()),
            _ => trial,
        }
    }
}

/// Where `pack` lies, or why it cannot be had.
fn archive(pack: &str) -> io::Result<PathBuf> {
    let folder = match std::env::var_os("ABVH_SCENES") {
        Some(folder) => PathBuf::from(folder),
        None => workspace().join("../shared/scenes"),
    };
    let file = folder.join(format!("{pack}.tar.zst"));
    let why = || io::Error::other(format!("needs {pack}.tar.zst, see ABVH_SCENES"));
    file.is_file().then_some(file).ok_or_else(why)
}

/// The root of the workspace.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The folder that holds what `pack` holds. Unpacked once, beside its final name, so that processes may race for it.
fn unpacked(pack: &str) -> io::Result<PathBuf> {
    let archive = archive(pack)?;
    let cache = crate::program::target_dir().join("test-scenes");
    let size = fs::metadata(&archive)?.len();
    let folder = cache.join(format!("{pack}-{size}"));
    if folder.is_dir() {
        return Ok(folder);
    }
    fs::create_dir_all(&cache)?;
    let beside = tempfile::tempdir_in(&cache)?;
    let stream = ruzstd::decoding::StreamingDecoder::new(File::open(&archive)?);
    let stream = stream.map_err(io::Error::other)?;
    tar::Archive::new(stream).unpack(beside.path())?;
    expand(beside.path())?;
    match fs::rename(beside.path(), &folder) {
        Err(e) if !folder.is_dir() => Err(e),
        _ => Ok(folder),
    }
}

/// Expands every `.gz` below `folder` beside itself.
fn expand(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            expand(&path)?;
        } else if path.extension().is_some_and(|e| e == "gz") {
            let mut stream = flate2::read::MultiGzDecoder::new(File::open(&path)?);
            io::copy(&mut stream, &mut File::create(path.with_extension(""))?)?;
        }
    }
    Ok(())
}
