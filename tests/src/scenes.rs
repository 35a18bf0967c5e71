//! Scenes to test with: demos, which are always available, and real ones, which may be absent.
//!
//! Real scenes are packed. The packs are in the folder `ABVH_SCENES`, or in a default folder next to the workspace.
//! They are unpacked once into the target directory. Tests that need an absent pack show as ignored, with the reason.

use geom::{Animation, lock};
use libtest_mimic::Trial;
use scene::Scene;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// A scene and its name.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Name of the scene. Names of tests begin with it.
    pub name: &'static str,
    /// The demo, or the pack and the path within its folder.
    spec: &'static str,
}

/// Every demo, with few triangles.
pub const DEMOS: [Source; 5] = [
    source("grove", "demo:grove:4000"),
    source("collide", "demo:collide:4000"),
    source("shatter", "demo:shatter:6000"),
    source("twist", "demo:twist:4000"),
    source("hall", "demo:hall:4000"),
];

/// Real animated scenes.
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
    /// Returns the scene's pack and the path within it, or `None` for demos.
    fn packed(&self) -> Option<(&str, &str)> {
        self.spec.split_once('/')
    }

    /// Returns the scene argument for the program. Unpacks the scene if necessary.
    pub fn path(&self) -> String {
        let Some((pack, file)) = self.packed() else {
            return self.spec.to_owned();
        };
        let folder = unpacked(pack).expect("packs can be unpacked");
        folder.join(file).to_string_lossy().into_owned()
    }

    /// Opens the scene.
    pub fn open(&self) -> Scene {
        scene::open(&self.path(), &scene::SceneOptions::default()).expect("scenes can be read")
    }

    /// Returns the animation. It is opened once per process.
    pub fn animation(&self) -> Arc<Animation> {
        static OPEN: Mutex<BTreeMap<&str, Arc<Animation>>> = Mutex::new(BTreeMap::new());
        let mut open = lock(&OPEN);
        let known = open.entry(self.spec);
        Arc::clone(known.or_insert_with(|| self.open().animation))
    }

    /// Creates a test that runs on this scene. It is ignored, with the reason, if the scene is absent.
    pub fn trial(self, property: &str, run: impl FnOnce(Source) + Send + 'static) -> Trial {
        let trial = crate::trial(format!("{}::{property}", self.name), move || run(self));
        let absent = self.packed().and_then(|(pack, _)| archive(pack).err());
        crate::ignored_if(trial, absent.map(|reason| reason.to_string()))
    }
}

/// Returns the path of `pack`, or the reason why it is absent.
fn archive(pack: &str) -> io::Result<PathBuf> {
    let folder = match std::env::var_os("ABVH_SCENES") {
        Some(folder) => PathBuf::from(folder),
        None => workspace().join("../shared/scenes"),
    };
    let file = folder.join(format!("{pack}.tar.zst"));
    let why = || io::Error::other(format!("needs {pack}.tar.zst, see ABVH_SCENES"));
    file.is_file().then_some(file).ok_or_else(why)
}

/// Returns the root of the workspace.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Returns the folder with the contents of `pack`. Unpacks to a temporary folder and renames it, so processes may race.
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

/// Decompresses every `.gz` below `folder` into the folder that contains it.
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
