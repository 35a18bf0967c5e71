//! The files of each frame.

use crate::args::RenderArgs;
use crate::stop::Stop;
use backend::Hits;
use picture::Shot;
use report::{Found, WriteError};
use std::path::PathBuf;

/// Where pictures and hits go.
#[derive(Debug)]
pub(crate) struct Outputs {
    images: Option<PathBuf>,
    hits: Option<PathBuf>,
    rgb: Vec<u8>,
}

impl Outputs {
    /// Makes the directories and finds out whether every file can be written, before any work.
    pub(crate) fn prepare(args: &RenderArgs) -> Result<Self, Stop> {
        let images = (!args.no_images).then(|| args.out.clone());
        for dir in images.iter().chain(&args.hits) {
            report::prepare_dir(dir).map_err(Stop::bad)?;
        }
        for file in [&args.stats, &args.timeline, &args.rays_out]
            .into_iter()
            .flatten()
        {
            report::check_writable(file).map_err(Stop::bad)?;
        }
        Ok(Self {
            images,
            hits: args.hits.clone(),
            rgb: Vec::new(),
        })
    }

    /// Whether anything needs the hits back.
    pub(crate) fn any(&self) -> bool {
        self.images.is_some() || self.hits.is_some()
    }

    /// Whether all of a frame's files exist. A frame without files is never done.
    pub(crate) fn exist(&self, frame: u64) -> bool {
        self.any()
            && [self.image(frame), self.hits(frame)]
                .iter()
                .flatten()
                .all(|file| file.is_file())
    }

    /// Writes a frame's files.
    pub(crate) fn write(
        &mut self,
        frame: u64,
        shot: &Shot<'_>,
        hits: &Hits,
    ) -> Result<(), WriteError> {
        let [width, height] = [shot.camera.width, shot.camera.height];
        if let Some(file) = self.hits(frame) {
            let found = Found {
                hits: &hits.closest,
                shadow: Some(&hits.blocked),
                shape: &[u64::from(height), u64::from(width)],
            };
            report::write_hits(&file, &found)?;
        }
        if let Some(file) = self.image(frame) {
            picture::shade(shot, &hits.closest, &hits.blocked, &mut self.rgb);
            report::write_png(&file, [width, height], &self.rgb)?;
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
