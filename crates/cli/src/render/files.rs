//! Paths of the files of each frame, and their contents.

use super::RenderSettings;
use crate::error::CliError;
use crate::file_checks::absolute;
use output::{FileKind, HitArrays};
use std::path::{Path, PathBuf};

/// The output folders for the files of frames, and whether a video is written.
#[derive(Debug)]
pub(super) struct FrameFiles {
    pictures: Option<PathBuf>,
    hits: Option<PathBuf>,
    pub(super) has_video: bool,
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
    /// Returns the outputs of a run. If the two folders are one folder under two names, both get the first name.
    pub(super) fn of(settings: &RenderSettings) -> Self {
        let pictures = (!settings.no_images).then(|| settings.out.clone());
        let is_same = |hits: &PathBuf| pictures.as_deref().map(absolute) == Some(absolute(hits));
        let hits = match &settings.hits {
            Some(hits) if is_same(hits) => pictures.clone(),
            hits => hits.clone(),
        };
        Self {
            pictures,
            hits,
            has_video: settings.has_video(),
        }
    }

    /// Creates the folders and their parents, and adds those that did not exist to `new_folders`.
    pub(super) fn create_folders(&self, new_folders: &mut NewFolders) -> Result<(), CliError> {
        for dir in self.folders() {
            let above = dir.ancestors().filter(|d| !d.as_os_str().is_empty());
            let missing: Vec<_> = above.take_while(|d| !d.exists()).collect();
            let parents_first = missing.into_iter().rev().map(Path::to_owned);
            new_folders.0.extend(parents_first);
            output::prepare_dir(&dir).map_err(CliError::invalid)?;
        }
        Ok(())
    }

    pub(super) fn folders(&self) -> Vec<PathBuf> {
        let mut all: Vec<_> = self.pictures.iter().chain(&self.hits).cloned().collect();
        all.dedup();
        all
    }

    /// Returns the kinds of files that each frame has in one of the folders.
    pub(super) fn kinds(&self, folder: &Path) -> Vec<FileKind> {
        let pictures = (self.pictures.as_deref() == Some(folder)).then_some(FileKind::Picture);
        let hits = (self.hits.as_deref() == Some(folder)).then_some(FileKind::Hits);
        pictures.into_iter().chain(hits).collect()
    }

    /// Returns a frame's files in one of the folders.
    pub(super) fn in_folder(&self, frame: u64, folder: &Path) -> Vec<PathBuf> {
        let kinds = self.kinds(folder).into_iter();
        kinds
            .map(|kind| folder.join(kind.file_name(frame)))
            .collect()
    }

    pub(super) fn has_pictures(&self) -> bool {
        self.pictures.is_some()
    }

    pub(super) fn has_hits(&self) -> bool {
        self.hits.is_some()
    }

    /// Returns whether any file is written per frame.
    pub(super) fn any(&self) -> bool {
        self.has_pictures() || self.has_hits()
    }

    /// Writes the files of a frame. `rgb` is empty if no picture is written.
    pub(super) fn write(
        &self,
        frame: u64,
        size: [u32; 2],
        hits: &HitArrays<'_>,
        rgb: &[u8],
    ) -> Result<(), CliError> {
        if let Some(file) = self.hits(frame) {
            output::remove_special_file(&file)?;
            hits.write(&file)?;
        }
        if let Some(file) = self.picture(frame) {
            output::remove_special_file(&file)?;
            output::write_png(&file, size, rgb)?;
        }
        Ok(())
    }

    fn picture(&self, frame: u64) -> Option<PathBuf> {
        let dir = self.pictures.as_ref()?;
        Some(dir.join(FileKind::Picture.file_name(frame)))
    }

    fn hits(&self, frame: u64) -> Option<PathBuf> {
        let dir = self.hits.as_ref()?;
        Some(dir.join(FileKind::Hits.file_name(frame)))
    }
}
