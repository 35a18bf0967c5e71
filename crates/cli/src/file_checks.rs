//! Checks that written files differ from read files and from each other, and that they can be written.

use crate::error::CliError;
use output::FileKind;
use std::fs;
use std::path::{Path, PathBuf};

/// A file with the option that names it.
type NamedFile<'a> = (&'a str, PathBuf);

/// Files that a command reads and writes, with the options that name them.
#[derive(Default)]
pub(crate) struct CommandFiles<'a> {
    pub(crate) read: Vec<NamedFile<'a>>,
    pub(crate) written: Vec<NamedFile<'a>>,
    /// Output folders that receive files for every frame.
    pub(crate) folders: Vec<NamedFile<'a>>,
}

impl<'a> CommandFiles<'a> {
    /// Returns the files that optional arguments write, except standard output.
    pub(crate) fn written(options: &[(&'a str, &Option<PathBuf>)]) -> Self {
        let options = options.iter();
        let given = options.filter_map(|(option, file)| Some((*option, (*file).clone()?)));
        Self {
            written: given.filter(|(_, file)| file.as_os_str() != "-").collect(),
            ..Self::default()
        }
    }

    /// Checks, before any work on these scenes, that all files can be written and no file overwrites another.
    pub(crate) fn check(mut self, scenes: &[String]) -> Result<(), CliError> {
        if self.written.is_empty() && self.folders.is_empty() {
            return Ok(());
        }
        for scene in scenes {
            let files = scene::protected_files(scene).into_iter();
            self.read.extend(files.map(|file| ("SCENE", file)));
        }
        self.check_apart()?;
        for (_, folder) in &self.folders {
            output::check_dir(folder).map_err(CliError::invalid)?;
        }
        for (_, file) in &self.written {
            let dir = absolute(host::parent(file));
            // An output folder and its parents may not exist yet.
            let is_created = |(_, folder): &NamedFile<'_>| absolute(folder).starts_with(&dir);
            if dir.exists() || !self.folders.iter().any(is_created) {
                output::check_writable(file).map_err(CliError::invalid)?;
            }
        }
        Ok(())
    }

    /// Refuses an output file that is also an input or another output.
    pub(crate) fn check_apart(&self) -> Result<(), CliError> {
        for (i, (option, file)) in self.written.iter().enumerate() {
            let Some(path) = regular_path(file) else {
                continue;
            };
            let is_same = |other: &&NamedFile<'_>| regular_path(&other.1).as_ref() == Some(&path);
            let what = if let Some((other, file)) = self.read.iter().find(is_same) {
                format!("{} of {other}", file.display())
            } else if let Some((other, _)) = self.written[..i].iter().find(is_same) {
                format!("the output of {other}")
            } else if let Some(folder) = self.folder_of(&path) {
                format!("a file of the run in {folder}")
            } else {
                continue;
            };
            let file = file.display();
            return Err(CliError::invalid(format!(
                "{option} {file} would overwrite {what}"
            )));
        }
        for (_, file) in &self.read {
            if let Some(folder) = regular_path(file).and_then(|path| self.folder_of(&path)) {
                let file = format!("{}, which is read", file.display());
                return Err(CliError::invalid(format!("{folder} may overwrite {file}")));
            }
        }
        Ok(())
    }

    /// Returns the option of the output folder that contains `path`, if the run may write a file of that name.
    fn folder_of(&self, path: &Path) -> Option<&'a str> {
        let name = path.file_name()?.to_string_lossy();
        // The manifest and the journals are named `abvh-run*`.
        let is_ours = name.starts_with("abvh-run") || FileKind::of(&name).is_some();
        let folder = path.parent().filter(|_| is_ours)?;
        let found = self.folders.iter().find(|(_, f)| absolute(f) == folder);
        found.map(|(option, _)| *option)
    }
}

/// Returns the absolute path of a file. Returns `None` for devices and pipes, which several options may share.
fn regular_path(file: &Path) -> Option<PathBuf> {
    let metadata = fs::metadata(file).ok();
    let is_special = metadata.is_some_and(|metadata| !metadata.is_file() && !metadata.is_dir());
    (!is_special).then(|| absolute(file))
}

/// Returns the absolute path of a file, which may not exist. Resolves symbolic links.
pub(crate) fn absolute(file: &Path) -> PathBuf {
    if let Ok(whole) = fs::canonicalize(file) {
        return whole;
    }
    let file = &output::follow_links(file);
    let folder = host::parent(file);
    let absolute = || std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let folder = fs::canonicalize(folder).unwrap_or_else(|_| absolute());
    folder.join(file.file_name().unwrap_or_default())
}
