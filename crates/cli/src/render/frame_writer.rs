//! Writes the files of frames on rayon's threads, while later frames are traced. Also converts frames for the video,
//! which has a writing thread of its own.

use super::files::FrameFiles;
use crate::camera::LitCamera;
use crate::console::ProgressLine;
use crate::error::CliError;
use crate::signals;
use abvh::frames::{Frame, FrameOutputs, FrameRecord, OutputSelection};
use geom::lock;
use output::{FileKind, HitArrays, Journal, Video, VideoPlanes};
use rayon::Scope;
use scene::Scene;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, MutexGuard};

/// Maximum number of bytes in the buffers of frames that are being written. A quarter of the free memory is another
/// limit. Two frames are always allowed.
const MOST_BYTES: u64 = 1 << 30;
/// Bytes per pixel of hits: a hit with its shadow, and the copy for the file.
const HIT_BYTES: usize = 17 + 17;
/// Bytes per pixel of colours: RGBA, RGB, and the encoded picture.
const COLOUR_BYTES: usize = 4 + 3 + 3;
/// Bytes per pixel of a video: three planes.
const PLANE_BYTES: usize = 3;

/// Parameters that all frames share: the scene, the view, and the outputs that are written.
pub(super) struct FrameContext<'a> {
    pub(super) scene: &'a Scene,
    pub(super) lit_camera: &'a LitCamera,
    pub(super) files: &'a FrameFiles,
    pub(super) wanted: OutputSelection,
}

/// Writes the files of frames, and collects the results of written frames.
pub(super) struct FrameWriter<'a> {
    context: FrameContext<'a>,
    log: Mutex<FrameLog<'a>>,
    /// Receives free buffers. Only one thread submits frames, so this lock is never contended.
    free: Mutex<Receiver<FrameBuffers>>,
    /// Returns buffers to `free`.
    returned: Sender<FrameBuffers>,
}

/// Records of the frames that have been written.
pub(super) struct FrameLog<'a> {
    /// One for each output folder.
    pub(super) journals: &'a mut [Journal],
    pub(super) progress: ProgressLine,
    pub(super) video: Option<Video<BorrowedBuffers>>,
    pub(super) records: Vec<FrameRecord>,
    /// The first failure.
    pub(super) failed: Option<CliError>,
}

/// Buffers of a frame that is being written.
#[derive(Default)]
struct FrameBuffers {
    outputs: FrameOutputs,
    rgb: Vec<u8>,
    /// Empty without a video.
    planes: VideoPlanes,
}

/// Buffers of a frame. Dropping them returns them to the writer.
pub(super) struct BorrowedBuffers {
    buffers: FrameBuffers,
    returned: Sender<FrameBuffers>,
}

impl AsRef<VideoPlanes> for BorrowedBuffers {
    fn as_ref(&self) -> &VideoPlanes {
        &self.buffers.planes
    }
}

impl Drop for BorrowedBuffers {
    fn drop(&mut self) {
        // Sending fails once the run has ended.
        let _ = self.returned.send(std::mem::take(&mut self.buffers));
    }
}

impl FrameContext<'_> {
    /// Returns the number of frames that may wait to be written.
    fn frames_in_flight(&self) -> usize {
        let hits = if self.wanted.hits { HIT_BYTES } else { 0 };
        let planes = if self.files.has_video { PLANE_BYTES } else { 0 };
        let bytes = COLOUR_BYTES + hits + planes;
        let free = host::free().map_or(u64::MAX, |free| free.bytes);
        let each = (bytes * self.lit_camera.camera.pixels()).max(1) as u64;
        let fitting = (MOST_BYTES.min(free / 4) / each) as usize;
        fitting.clamp(2, rayon::current_num_threads() + 1)
    }
}

impl<'a> FrameWriter<'a> {
    pub(super) fn new(context: FrameContext<'a>, log: FrameLog<'a>) -> Self {
        let (returned, free) = channel();
        for _ in 0..context.frames_in_flight() {
            // Sending cannot fail, because the receiver exists.
            let _ = returned.send(FrameBuffers::default());
        }
        Self {
            context,
            log: Mutex::new(log),
            free: Mutex::new(free),
            returned,
        }
    }

    /// Writes a frame on rayon's threads. `place` counts the frames that this process renders, from 0. Swaps `outputs`
    /// for free buffers, and waits while too many frames are being written. Fails if a signal arrived, or if files of
    /// a frame or the video could not be written.
    pub(super) fn write<'s>(
        &'s self,
        scope: &Scope<'s>,
        place: usize,
        frame: &FrameRecord,
        outputs: &mut FrameOutputs,
    ) -> Result<(), CliError> {
        signals::check()?;
        self.check()?;
        let mut borrowed = self.borrow_buffers()?;
        std::mem::swap(outputs, &mut borrowed.buffers.outputs);
        let record = FrameRecord {
            host_bytes: host::resident(),
            ..frame.clone()
        };
        let write = move || {
            if let Err(error) = self.write_files(record, &mut borrowed.buffers) {
                self.lock().failed.get_or_insert(error);
            } else if let Some(video) = &self.lock().video {
                video.queue(place, borrowed);
            }
        };
        // This thread is a rayon worker only if no other thread could be started. Spawned work would then run only at
        // the end of the run.
        let files = self.context.files;
        let writes_any = !files.folders.is_empty() || files.has_video;
        if !writes_any || rayon::current_thread_index().is_some() {
            write();
            return self.check();
        }
        scope.spawn(move |_| write());
        Ok(())
    }

    /// Returns the records of all frames, in any order. Fails if files of a frame or the video could not be written.
    pub(super) fn finish(self) -> Result<Vec<FrameRecord>, CliError> {
        let ended = self.check().and_then(|()| {
            let video = self.lock().video.take();
            video.map_or(Ok(()), Video::finish).map_err(CliError::from)
        });
        if ended.is_err() {
            // On a terminal, Ctrl-C also interrupts the encoder. Report the signal, not the encoder's failure.
            signals::check()?;
        }
        ended?;
        Ok(std::mem::take(&mut self.lock().records))
    }

    /// Returns buffers for one more frame. Waits until some are free.
    fn borrow_buffers(&self) -> Result<BorrowedBuffers, CliError> {
        let free = lock(&self.free);
        let buffers = free.recv().map_err(CliError::failed)?;
        let returned = self.returned.clone();
        Ok(BorrowedBuffers { buffers, returned })
    }

    fn lock(&self) -> MutexGuard<'_, FrameLog<'a>> {
        lock(&self.log)
    }

    fn check(&self) -> Result<(), CliError> {
        let mut log = self.lock();
        let video = log.video.take_if(|video| video.has_failed());
        video.map_or(Ok(()), Video::finish)?;
        log.failed.take().map_or(Ok(()), Err)
    }

    fn write_files(&self, record: FrameRecord, buffers: &mut FrameBuffers) -> Result<(), CliError> {
        let Frame { index, time } = record.frame;
        let FrameContext {
            scene,
            lit_camera,
            files,
            ..
        } = self.context;
        let FrameOutputs { hits, pixels } = &buffers.outputs;
        let [width, height] = [lit_camera.camera.width, lit_camera.camera.height];
        if files.has(FileKind::Picture) {
            output::drop_alpha(pixels, &mut buffers.rgb);
        }
        if files.has_video {
            let pixels = pixels.as_chunks::<4>().0;
            buffers.planes.set(pixels);
        }
        let shape = [height, width].map(u64::from);
        let hits = HitArrays {
            shadow: Some(&hits.blocked),
            offset: scene.facts.offset,
            ..HitArrays::of(&hits.closest, &shape)
        };
        let digests = files.write(index, [width, height], &hits, &buffers.rgb)?;
        let mut log = self.lock();
        for (journal, files) in log.journals.iter_mut().zip(digests) {
            journal.add(files, &record)?;
        }
        let ms = record.wall_ms;
        log.progress.step(&format!("time {time:.3}, {ms:.1} ms"));
        log.records.push(record);
        Ok(())
    }
}
