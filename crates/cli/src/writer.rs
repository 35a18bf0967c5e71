//! Writes the files of frames and the video on rayon's threads, while later frames are traced.

use crate::args::RenderArgs;
use crate::conflicts::whole;
use crate::stop::{self, Stop};
use crate::talk::Progress;
use abvh::frames::{Answers, Frame, FrameRecord, Wanted};
use geom::{Camera, Point, lock};
use output::{Chroma, FrameStats, HitArrays, Journal, Planes, RunTimeline, Video};
use rayon::Scope;
use scene::Scene;
use shading::Shot;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, MutexGuard};
use std::time::Instant;

/// Maximum number of bytes of hits and pictures that wait to be written. A quarter of the free memory is another limit.
/// Two frames are always allowed.
const MOST_BYTES: u64 = 1 << 30;
/// Bytes per pixel: a hit with its shadow, and the file's copy; a colour with and without alpha, and the picture; the
/// planes of a video.
const HIT_BYTES: usize = 17 + 17;
const COLOUR_BYTES: usize = 4 + 3 + 3;
const PLANE_BYTES: usize = 4;

/// Writes the files of frames, and collects the results of written frames.
pub(crate) struct Writer<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    light: Point,
    outputs: &'a Outputs,
    done: Mutex<Done<'a>>,
    spare: Sender<FrameBuffers>,
    /// Only one thread submits frames, so this lock is never contended.
    free: Mutex<Receiver<FrameBuffers>>,
}

/// Buffers of a frame that is being written.
#[derive(Default)]
struct FrameBuffers {
    answers: Answers,
    /// Colours that the host shaded.
    rgba: Vec<u8>,
    rgb: Vec<u8>,
    /// Empty without a video.
    planes: Planes,
}

/// A frame's buffers, which return to the writer when its files are written or given up.
pub(crate) struct Lent {
    buffers: FrameBuffers,
    spare: Sender<FrameBuffers>,
}

impl AsRef<Planes> for Lent {
    fn as_ref(&self) -> &Planes {
        &self.buffers.planes
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        // Sending fails once the run has ended.
        let _ = self.spare.send(std::mem::take(&mut self.buffers));
    }
}

/// Results of written frames, and their destinations.
struct Done<'a> {
    /// One for each output folder.
    journals: &'a mut [Journal],
    notes: Option<&'a mut RunTimeline>,
    progress: Progress,
    rows: Vec<FrameStats>,
    video: Option<Video<Lent>>,
    failed: Option<Stop>,
}

impl<'a> Writer<'a> {
    pub(crate) fn new(
        (scene, camera, light): (&'a Scene, &'a Camera, Point),
        (outputs, video, wanted): (&'a Outputs, Option<Video<Lent>>, Wanted),
        (journals, notes): (&'a mut [Journal], Option<&'a mut RunTimeline>),
        progress: Progress,
    ) -> Self {
        let (spare, free) = channel();
        let of_hits = if wanted.hits { HIT_BYTES } else { 0 };
        let of_planes = if outputs.video.any() { PLANE_BYTES } else { 0 };
        let bytes = COLOUR_BYTES + of_hits + of_planes;
        let free_bytes = host::free().map_or(u64::MAX, |free| free.bytes);
        let each = (bytes * camera.pixels()).max(1) as u64;
        let fitting = (MOST_BYTES.min(free_bytes / 4) / each) as usize;
        let wanted = rayon::current_num_threads() + 1;
        for _ in 0..fitting.clamp(2, wanted) {
            // The receiver is alive.
            let _ = spare.send(FrameBuffers::default());
        }
        Self {
            scene,
            camera,
            light,
            outputs,
            done: Mutex::new(Done {
                journals,
                notes,
                progress,
                rows: Vec::new(),
                video,
                failed: None,
            }),
            spare,
            free: Mutex::new(free),
        }
    }

    /// Accepts a frame. Waits while too many frames are being written. Fails if a signal arrived, or if files of an
    /// earlier frame could not be written.
    pub(crate) fn take<'s>(
        &'s self,
        scope: &Scope<'s>,
        place: usize,
        frame: &FrameRecord,
        answers: &mut Answers,
    ) -> Result<(), Stop> {
        stop::check_signals()?;
        self.check()?;
        let waits = Instant::now();
        let mut lent = self.lend()?;
        std::mem::swap(answers, &mut lent.buffers.answers);
        if let Some(notes) = &mut self.lock().notes {
            notes.add(frame, [waits, Instant::now()]);
        }
        let frame = frame.clone();
        let write = move || {
            if let Err(stop) = self.write(&frame, &mut lent.buffers) {
                self.lock().failed.get_or_insert(stop);
            } else if let Some(video) = &self.lock().video {
                video.take(place, lent);
            }
        };
        // Without its own threads, rayon would run spawned work only at the end of the run.
        let makes_any = self.outputs.any() || self.outputs.video.any();
        if !makes_any || rayon::current_thread_index().is_some() {
            write();
            return self.check();
        }
        scope.spawn(move |_| write());
        Ok(())
    }

    /// Returns the rows of all frames, in any order. Fails if files of a frame could not be written.
    pub(crate) fn rows(self) -> Result<Vec<FrameStats>, Stop> {
        self.check()?;
        let video = self.lock().video.take();
        video.map_or(Ok(()), Video::finish)?;
        Ok(std::mem::take(&mut self.lock().rows))
    }

    /// Returns buffers for one more frame. Waits until some are free.
    fn lend(&self) -> Result<Lent, Stop> {
        let free = lock(&self.free);
        let buffers = free.recv().map_err(Stop::failed)?;
        let spare = self.spare.clone();
        Ok(Lent { buffers, spare })
    }

    fn lock(&self) -> MutexGuard<'_, Done<'a>> {
        lock(&self.done)
    }

    fn check(&self) -> Result<(), Stop> {
        let mut done = self.lock();
        let video = done.video.take_if(|video| video.has_failed());
        video.map_or(Ok(()), Video::finish)?;
        done.failed.take().map_or(Ok(()), Err)
    }

    fn write(&self, frame: &FrameRecord, buffers: &mut FrameBuffers) -> Result<(), Stop> {
        let begun = Instant::now();
        let (row, Frame { index, time }) = (FrameStats::of(frame), frame.frame);
        let shot = Shot {
            moment: self.scene.animation.at(time).map_err(Stop::bad)?,
            colours: &self.scene.colours,
            camera: self.camera,
            light: self.light,
        };
        let (images, video) = (self.outputs.images.is_some(), self.outputs.video);
        let hits = &buffers.answers.hits;
        let mut pixels = &buffers.answers.pixels;
        if pixels.is_empty() && (images || video.any()) {
            shading::shade(&shot, &hits.closest, &hits.blocked, &mut buffers.rgba);
            pixels = &buffers.rgba;
        }
        let [width, height] = [self.camera.width, self.camera.height];
        if images {
            output::drop_alpha(pixels, &mut buffers.rgb);
        }
        if video.any() {
            let pixels = pixels.as_chunks::<4>().0;
            buffers.planes.set(pixels, width as usize, video);
        }
        let shape = [height, width].map(u64::from);
        let hits = HitArrays {
            shadow: Some(&hits.blocked),
            offset: self.scene.facts.offset,
            ..HitArrays::of(&hits.closest, &shape)
        };
        (self.outputs).write(index, [width, height], &hits, &buffers.rgb)?;
        let folders = self.outputs.folders();
        let files = |folder| self.outputs.in_folder(index, folder);
        let digests = folders.iter().map(|f| output::digests(&files(f)));
        let digests = digests.collect::<Result<Vec<_>, _>>()?;
        let mut done = self.lock();
        for (journal, files) in done.journals.iter_mut().zip(digests) {
            journal.add(files, &row)?;
        }
        if let Some(notes) = &mut done.notes {
            notes.wrote(index, [begun, Instant::now()]);
        }
        let ms = frame.wall_ms;
        done.progress.step(&format!("time {time:.3}, {ms:.1} ms"));
        done.rows.push(row);
        Ok(())
    }
}

/// The files of each frame, and the chroma of the videos.
#[derive(Debug)]
pub(crate) struct Outputs {
    images: Option<PathBuf>,
    hits: Option<PathBuf>,
    pub(crate) video: Chroma,
}

impl Outputs {
    /// Gives a folder that is named in two ways a single name.
    pub(crate) fn of(args: &RenderArgs) -> Self {
        let images = (!args.no_images).then(|| args.out.clone());
        let is_same = |hits: &PathBuf| images.as_deref().map(whole) == Some(whole(hits));
        let hits = match &args.hits {
            Some(hits) if is_same(hits) => images.clone(),
            hits => hits.clone(),
        };
        Self {
            images,
            hits,
            video: args.chroma(),
        }
    }

    /// Creates the folders. Returns the new ones, the innermost first.
    pub(crate) fn prepare(&self) -> Result<Vec<PathBuf>, Stop> {
        let mut all = Vec::new();
        for dir in self.folders() {
            let above = dir.ancestors().filter(|d| !d.as_os_str().is_empty());
            all.extend(above.take_while(|d| !d.exists()).map(Path::to_owned));
            output::prepare_dir(&dir).map_err(Stop::bad)?;
        }
        Ok(all)
    }

    pub(crate) fn folders(&self) -> Vec<PathBuf> {
        let mut all: Vec<_> = self.images.iter().chain(&self.hits).cloned().collect();
        all.dedup();
        all
    }

    /// Returns a frame's files in one of the folders.
    pub(crate) fn in_folder(&self, frame: u64, folder: &Path) -> Vec<PathBuf> {
        let files = [self.image(frame), self.hits(frame)].into_iter().flatten();
        files.filter(|f| f.parent() == Some(folder)).collect()
    }

    /// Returns whether any file is written per frame.
    pub(crate) fn any(&self) -> bool {
        self.images.is_some() || self.hits.is_some()
    }

    /// Returns the results that the files need.
    pub(crate) fn wanted(&self) -> Wanted {
        Wanted {
            hits: self.hits.is_some(),
            pixels: self.images.is_some() || self.video.any(),
        }
    }

    pub(crate) fn write(
        &self,
        frame: u64,
        size: [u32; 2],
        hits: &HitArrays<'_>,
        rgb: &[u8],
    ) -> Result<(), Stop> {
        if let Some(file) = self.hits(frame) {
            output::remove_special_file(&file)?;
            hits.write(&file)?;
        }
        if let Some(file) = self.image(frame) {
            output::remove_special_file(&file)?;
            output::write_png(&file, size, rgb)?;
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
