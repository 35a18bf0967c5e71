//! Paths of the files of each frame, and their contents.

use super::RenderSettings;
use crate::error::CliError;
use crate::file_checks::absolute;
use output::{FileKind, HitArrays, NamedDigest};
use std::path::{Path, PathBuf};

/// The output folders for the files of frames, and whether a video is written.
#[derive(Debug)]
pub(super) struct FrameFiles {
    pub(super) folders: Vec<OutputFolder>,
    pub(super) has_video: bool,
}

/// An output folder, and the kinds of files that each frame has in it.
#[derive(Debug)]
pub(super) struct OutputFolder {
    pub(super) path: PathBuf,
    pub(super) kinds: Vec<FileKind>,
}

/// Folders that the run created, each after its parent. Dropping them removes the empty ones, so that a run that fails
/// before it writes files leaves no folder.
#[derive(Debug, Default)]
pub(super) struct NewFolders(Vec<PathBuf>);

impl Drop for NewFolders {
    fn drop(&mut self) {
        for folder in self.0.iter().rev() {
            // Fails harmlessly for a folder that contains files.
            let _ = std::fs::remove_dir(folder);
        }
    }
}

impl FrameFiles {
    /// Returns the outputs of a run. If `--out` and `--hits` name the same folder, it is listed once, under the name in
    /// `--out`.
    pub(super) fn of(settings: &RenderSettings) -> Self {
        let folder = |path: &Path, kind| OutputFolder {
            path: path.to_owned(),
            kinds: vec![kind],
        };
        let mut folders = Vec::new();
        if !settings.no_images {
            folders.push(folder(&settings.out, FileKind::Picture));
        }
        if let Some(hits) = &settings.hits {
            match folders.first_mut() {
                Some(first) if absolute(&first.path) == absolute(hits) => {
                    first.kinds.push(FileKind::Hits);
                }
                _ => folders.push(folder(hits, FileKind::Hits)),
            }
        }
        Self {
            folders,
            has_video: settings.has_video(),
        }
    }

    /// Creates the folders and their parents, and adds those that did not exist to `new_folders`.
    pub(super) fn create_folders(&self, new_folders: &mut NewFolders) -> Result<(), CliError> {
        for OutputFolder { path, .. } in &self.folders {
            let above = path.ancestors().filter(|d| !d.as_os_str().is_empty());
            let missing: Vec<_> = above.take_while(|d| !d.exists()).collect();
            let parents_first = missing.into_iter().rev().map(Path::to_owned);
            new_folders.0.extend(parents_first);
            output::prepare_dir(path).map_err(CliError::invalid)?;
        }
        Ok(())
    }

    /// Returns whether each frame has a file of this kind.
    pub(super) fn has(&self, kind: FileKind) -> bool {
        let mut folders = self.folders.iter();
        folders.any(|folder| folder.kinds.contains(&kind))
    }

    /// Writes the files of a frame, and returns their digests for each folder. `rgb` is empty if no picture is written.
    pub(super) fn write(
        &self,
        frame: u64,
        size: [u32; 2],
        hits: &HitArrays<'_>,
        rgb: &[u8],
    ) -> Result<Vec<Vec<NamedDigest>>, CliError> {
        let mut digests = Vec::new();
        for folder in &self.folders {
            let mut written = Vec::new();
            for kind in &folder.kinds {
                let file = folder.path.join(kind.file_name(frame));
                output::remove_special_file(&file)?;
                match kind {
                    FileKind::Picture => output::write_png(&file, size, rgb)?,
                    FileKind::Hits => hits.write(&file)?,
                }
                written.push(file);
            }
            digests.push(output::digests(&written)?);
        }
        Ok(digests)
    }
}
