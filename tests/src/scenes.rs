//! Scenes to test with: demos, which are always there, and real ones, which may be absent.
//!
//! Real scenes are packed. They are looked for in the folder that the environment
//! variable `ABVH_SCENES` names, else in `../shared/scenes` beside the workspace,
//! and unpacked once into the target directory. Trials that need an absent
//! pack show as ignored, with the reason.

use geom::Animation;
use libtest_mimic::{Failed, Trial};
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
    /// The pack that holds it; none for demos.
    pub pack: Option<&'static str>,
    /// What to open: below the pack's folder, or the demo.
    pub spec: &'static str,
}

/// Every demo, small.
pub const DEMOS: [Source; 5] = [
    demo("grove", "demo:grove:4000"),
    demo("collide", "demo:collide:4000"),
    demo("shatter", "demo:shatter:6000"),
    demo("twist", "demo:twist:4000"),
    demo("hall", "demo:hall:4000"),
];

/// Real scenes that move.
pub const REAL: [Source; 9] = [
    real("horse-gallop", "horse-gallop", "models/horse-gallop"),
    real("horse-collapse", "horse-collapse", "models/horse-collapse"),
    real("rod-twist", "ccd-rod-twist", "ccd-rod-twist"),
    real("cloth-ball", "ccd-cloth-ball", "ccd-cloth-ball"),
    real("n-body", "ccd-n-body-simulation", "ccd-n-body-simulation"),
    real("robot", "small", "gltf-robotexpressive/RobotExpressive.glb"),
    real("cesium-man", "small", "gltf-cesiumman/CesiumMan.glb"),
    real(
        "morph-stress",
        "small",
        "gltf-morphstress/MorphStressTest.gltf",
    ),
    real("fox", "small", "gltf-fox/Fox.glb"),
];

const fn demo(name: &'static str, spec: &'static str) -> Source {
    Source {
        name,
        pack: None,
        spec,
    }
}

const fn real(name: &'static str, pack: &'static str, spec: &'static str) -> Source {
    Source {
        name,
        pack: Some(pack),
        spec,
    }
}

impl Source {
    /// What to give the program, unpacking the scene if need be.
    ///
    /// # Errors
    /// The pack is absent or damaged.
    pub fn path(&self) -> Result<String, Failed> {
        let Some(pack) = self.pack else {
            return Ok(self.spec.to_owned());
        };
        let path = unpacked(pack)?.join(self.spec);
        Ok(path.to_string_lossy().into_owned())
    }

    /// Opens the scene.
    ///
    /// # Errors
    /// It is absent or cannot be read.
    pub fn open(&self) -> Result<Scene, Failed> {
        Ok(scene::open(&self.path()?, &scene::Options::default())?)
    }

    /// What moves, opened once a process.
    ///
    /// # Errors
    /// As [`Source::open`].
    pub fn animation(&self) -> Result<Arc<Animation>, Failed> {
        static OPEN: Mutex<BTreeMap<&str, Arc<Animation>>> = Mutex::new(BTreeMap::new());
        let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = open.get(self.spec) {
            return Ok(Arc::clone(known));
        }
        let animation = self.open()?.animation;
        open.insert(self.spec, Arc::clone(&animation));
        Ok(animation)
    }

    /// A trial that runs on this scene; ignored, with the reason, where the scene is absent.
    pub fn trial(
        self,
        law: &str,
        run: impl FnOnce(Source) -> Result<(), Failed> + Send + 'static,
    ) -> Trial {
        let trial = Trial::test(format!("{}::{law}", self.name), move || run(self));
        match self.pack.map(archive) {
            Some(Err(reason)) => trial.with_ignored_flag(true).with_kind(reason),
            _ => trial,
        }
    }
}

/// Where `pack` lies, or why it cannot be had.
fn archive(pack: &str) -> Result<PathBuf, String> {
    let folder = match std::env::var_os("ABVH_SCENES") {
        Some(folder) => PathBuf::from(folder),
        None => workspace().join("../shared/scenes"),
    };
    let file = folder.join(format!("{pack}.tar.zst"));
    if file.is_file() {
        return Ok(file);
    }
    Err(format!("needs {pack}.tar.zst, see ABVH_SCENES"))
}

/// The root of the workspace.
#[must_use]
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The folder that holds what `pack` holds. Unpacked once, beside its final
/// name, so that processes may race for it.
fn unpacked(pack: &str) -> Result<PathBuf, Failed> {
    let archive = archive(pack)?;
    let cache = crate::program::target_dir().join("test-scenes");
    let size = fs::metadata(&archive)?.len();
    let folder = cache.join(format!("{pack}-{size}"));
    if folder.is_dir() {
        return Ok(folder);
    }
    fs::create_dir_all(&cache)?;
    let beside = tempfile::tempdir_in(&cache)?;
    let stream = ruzstd::decoding::StreamingDecoder::new(File::open(&archive)?)?;
    tar::Archive::new(stream).unpack(beside.path())?;
    expand(beside.path())?;
    let renamed = fs::rename(beside.path(), &folder);
    match renamed {
        Err(e) if !folder.is_dir() => Err(e.into()),
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
