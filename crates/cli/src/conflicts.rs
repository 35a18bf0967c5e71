//! Files that are written must be neither files that are read nor each other, and must be such as can be written.

use crate::stop::Stop;
use std::fs;
use std::path::{Path, PathBuf};

/// How the names of a frame's files begin, and of what says what a run is.
const OURS: [&str; 3] = ["frame_", "hits_", "abvh-run"];

type Named<'a> = (&'a str, PathBuf);

/// What a command reads and writes, by the options that name it.
#[derive(Default)]
pub(crate) struct Files<'a> {
    pub(crate) read: Vec<Named<'a>>,
    pub(crate) written: Vec<Named<'a>>,
    /// Folders that hold the files of frames.
    pub(crate) folders: Vec<Named<'a>>,
}

impl<'a> Files<'a> {
    /// What is written by options that may be left out.
    pub(crate) fn written(options: &[(&'a str, &Option<PathBuf>)]) -> Self {
        let options = options.iter();
        let given = options.filter_map(|(option, file)| Some((*option, (*file).clone()?)));
        Self {
            written: given.filter(|(_, file)| file.as_os_str() != "-").collect(),
            ..Self::default()
        }
    }

    /// Finds out, before any work over these scenes, whether all can be written, and apart from each other.
    pub(crate) fn check(mut self, scenes: &[String]) -> Result<(), Stop> {
        if self.written.is_empty() && self.folders.is_empty() {
            return Ok(());
        }
        for scene in scenes {
            let files = scene::files(scene)?.into_iter();
            self.read.extend(files.map(|file| ("SCENE", file)));
        }
        self.check_apart()?;
        for (_, folder) in &self.folders {
            output::check_dir(folder).map_err(Stop::bad)?;
        }
        for (_, file) in &self.written {
            // A folder may be yet to be made.
            let will_be = |dir: &Path| self.folders.iter().any(|(_, folder)| folder == dir);
            let dir = host::parent(file);
            if dir.exists() || !will_be(dir) {
                output::check_writable(file).map_err(Stop::bad)?;
            }
        }
        Ok(())
    }

    /// Refuses to write a file that is read, or written twice.
    pub(crate) fn check_apart(&self) -> Result<(), Stop> {
        for (i, (option, file)) in self.written.iter().enumerate() {
            let Some(place) = place(file) else { continue };
            let is_same = |other: &&Named<'_>| self::place(&other.1).as_ref() == Some(&place);
            let what = if let Some((other, file)) = self.read.iter().find(is_same) {
                format!("{} of {other}", file.display())
            } else if let Some((other, _)) = self.written[..i].iter().find(is_same) {
                format!("what {other} writes")
            } else if let Some(folder) = self.folder_of(&place) {
                format!("a file that {folder} writes")
            } else {
                continue;
            };
            let file = file.display();
            return Err(Stop::bad(format!("{option} {file} would overwrite {what}")));
        }
        for (_, file) in &self.read {
            if let Some(folder) = place(file).and_then(|place| self.folder_of(&place)) {
                let file = format!("{}, which is read", file.display());
                return Err(Stop::bad(format!("{folder} may overwrite {file}")));
            }
        }
        Ok(())
    }

    /// The option whose folder a place lies in, under a name that is written there.
    fn folder_of(&self, place: &Path) -> Option<&'a str> {
        let name = place.file_name()?.to_string_lossy();
        let is_ours = OURS.iter().any(|o| name.starts_with(o));
        let folder = place.parent().filter(|_| is_ours)?;
        let found = self.folders.iter().find(|(_, f)| whole(f) == folder);
        found.map(|(option, _)| *option)
    }
}

/// Where a file lies or will lie; `None` for devices and pipes, which many may write to.
fn place(file: &Path) -> Option<PathBuf> {
    let about = fs::metadata(file).ok();
    let is_special = about.is_some_and(|about| !about.is_file() && !about.is_dir());
    (!is_special).then(|| whole(file))
}

/// A path from the root on, by what exists of it.
pub(crate) fn whole(file: &Path) -> PathBuf {
    if let Ok(whole) = fs::canonicalize(file) {
        return whole;
    }
    let folder = host::parent(file);
    let absolute = || std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let folder = fs::canonicalize(folder).unwrap_or_else(|_| absolute());
    folder.join(file.file_name().unwrap_or_default())
}
