//! The files of each frame.

use crate::args::RenderArgs;
use crate::conflicts;
use crate::stop::Stop;
use backend::Hits;
use output::HitArrays;
use pipeline::Wanted;
use std::path::{Path, PathBuf};

fn is_same(a: &Path, b: &Path) -> bool {
    conflicts::whole(a) == conflicts::whole(b)
}

#[derive(Debug)]
pub(crate) struct Outputs {
    images: Option<PathBuf>,
    hits: Option<PathBuf>,
}

impl Outputs {
    /// Finds out whether every file can be written, before any work.
    pub(crate) fn of(args: &RenderArgs) -> Result<Self, Stop> {
        let images = (!args.no_images).then(|| args.out.clone());
        for dir in images.iter().chain(&args.hits) {
            output::check_dir(dir).map_err(Stop::bad)?;
        }
        let outputs = Self {
            images,
            hits: args.hits.clone(),
        };
        // A folder may be yet to be made.
        let is_in_new = |file: &Path| {
            let folder = file.parent().filter(|folder| !folder.exists());
            folder.is_some_and(|folder| outputs.folders().iter().any(|f| f == folder))
        };
        let files = [
            &args.stats,
            &args.timeline,
            &args.rays_out,
            &args.video,
            &args.y4m,
        ];
        let mut files = files.into_iter().flatten();
        files.try_for_each(|file| match file.as_os_str() == "-" || is_in_new(file) {
            true => Ok(()),
            false => output::check_writable(file).map_err(Stop::bad),
        })?;
        Ok(outputs)
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
        all.dedup_by(|a, b| is_same(a, b));
        all
    }

    /// A frame's files in one of the folders.
    pub(crate) fn in_folder(&self, frame: u64, folder: &Path) -> Vec<PathBuf> {
        let files = [self.image(frame), self.hits(frame)].into_iter().flatten();
        files
            .filter(|f| f.parent().is_some_and(|dir| is_same(dir, folder)))
            .collect()
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
            let found = HitArrays {
                hits: &hits.closest,
                shadow: Some(&hits.blocked),
                shape: &[u64::from(height), u64::from(width)],
            };
            output::remove_link(&file)?;
            output::write_hits(&file, &found)?;
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
