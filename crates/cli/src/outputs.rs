//! The files of each frame.

use crate::args::RenderArgs;
use crate::conflicts::whole;
use crate::stop::Stop;
use backend::Hits;
use pipeline::Wanted;
use std::path::{Path, PathBuf};

#[derive(Debug)]
pub(crate) struct Outputs {
    images: Option<PathBuf>,
    hits: Option<PathBuf>,
}

impl Outputs {
    pub(crate) fn of(args: &RenderArgs) -> Self {
        Self {
            images: (!args.no_images).then(|| args.out.clone()),
            hits: args.hits.clone(),
        }
    }

    /// Makes the folders. Those that are new, the innermost first.
    pub(crate) fn prepare(&self) -> Result<Vec<PathBuf>, Stop> {
        let mut all = Vec::new();
        for dir in self.folders() {
            let above = dir.ancestors().filter(|d| !d.as_os_str().is_empty());
            let new = above.take_while(|d| !d.exists()).map(Path::to_owned);
            all.extend(new.collect::<Vec<_>>());
            output::prepare_dir(&dir).map_err(Stop::bad)?;
        }
        Ok(all)
    }

    pub(crate) fn folders(&self) -> Vec<PathBuf> {
        let mut all: Vec<_> = self.images.iter().chain(&self.hits).cloned().collect();
        all.dedup_by_key(|folder| whole(folder));
        all
    }

    /// A frame's files in one of the folders.
    pub(crate) fn in_folder(&self, frame: u64, folder: &Path) -> Vec<PathBuf> {
        let files = [self.image(frame), self.hits(frame)].into_iter().flatten();
        let is_there = |file: &PathBuf| file.parent().map(whole) == Some(whole(folder));
        files.filter(is_there).collect()
    }

    /// Whether any file is written of a frame.
    pub(crate) fn any(&self) -> bool {
        self.images.is_some() || self.hits.is_some()
    }

    /// What files are made of.
    pub(crate) fn wanted(&self) -> Wanted {
        Wanted {
            hits: self.hits.is_some(),
            pixels: self.images.is_some(),
        }
    }

    /// Writes a frame's files.
    pub(crate) fn write(
        &self,
        frame: u64,
        [width, height]: [u32; 2],
        hits: &Hits,
        rgb: &[u8],
    ) -> Result<(), Stop> {
        if let Some(file) = self.hits(frame) {
            let shape = [height, width].map(u64::from);
            output::remove_link(&file)?;
            output::write_hits(&file, &shape, &hits.closest, Some(&hits.blocked))?;
        }
        if let Some(file) = self.image(frame) {
            output::remove_link(&file)?;
            output::write_png(&file, [width, height], rgb)?;
        }
        Ok(())
    }

    fn image(&self, frame: u64) -> Option<PathBuf> {
        let dir = self.images.as_ref()?;
        Some(dir.join(format!("frame_{frame:04}.png")))
    }

    fn hits(&self, frame: u64) -> Option<PathBuf> {
        let dir = self.hits.as_ref()?;
        Some(dir.join(format!("hits_{frame:04}.npz")))
    }
}
