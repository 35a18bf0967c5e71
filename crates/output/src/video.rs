//! Videos of all frames in order: uncompressed YUV4MPEG2, or encoded by `ffmpeg`, which reads YUV4MPEG2 from a pipe.

use crate::OutputError;
use crate::atomic::{UnfinishedFile, open_existing};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, prelude::*};
use std::iter;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use y4m::{Colorspace, EncoderBuilder};

mod planes;

pub use planes::VideoPlanes;

type Result<T, E = OutputError> = std::result::Result<T, E>;

/// Paths of the videos to write.
#[derive(Clone, Copy, Debug)]
pub struct VideoFiles<'a> {
    /// Video that `ffmpeg` encodes, in the format of the file extension.
    pub encoded: Option<&'a Path>,
    /// YUV4MPEG2 (4:4:4), or `-` for standard output.
    pub y4m: Option<&'a Path>,
}

/// Writes videos on a separate thread. The frames `F` contain [`VideoPlanes`].
///
/// Dropping an unfinished video waits for the thread and discards the unfinished files.
#[derive(Debug)]
pub struct Video<F> {
    /// Queue of frames with their indices. `None` marks the end.
    frames: Option<Sender<Option<(usize, F)>>>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl<F> Drop for Video<F> {
    fn drop(&mut self) {
        drop(self.frames.take());
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl<F: AsRef<VideoPlanes> + Send + 'static> Video<F> {
    /// Begins up to two videos, or returns `None` if both paths are `None`.
    ///
    /// `size` is width and height in pixels, and `fps` is in frames per second. Fails if the extension of `encoded` is
    /// unknown, a file cannot be created, or `ffmpeg` or the thread cannot start. No byte is written before the first
    /// frame.
    pub fn begin(files: VideoFiles<'_>, size: [u32; 2], fps: f64) -> Result<Option<Self>> {
        let encoded = files
            .encoded
            .map(|path| Sink::open(path, Some(format_of(path)?)));
        let y4m = files.y4m.map(|path| Sink::open(path, None));
        let sinks = encoded.into_iter().chain(y4m);
        let sinks = sinks.collect::<Result<Vec<_>>>()?;
        if sinks.is_empty() {
            return Ok(None);
        }
        let (frames, receiver) = channel();
        let [width, height] = size.map(|n| n as usize);
        let rate = frame_rate(fps);
        let header = move || y4m::encode(width, height, rate);
        let thread = thread::Builder::new().spawn(move || write(&receiver, sinks, &header));
        let thread =
            thread.map_err(|e| OutputError(format!("cannot start the video thread: {e}")))?;
        Ok(Some(Self {
            frames: Some(frames),
            thread: Some(thread),
        }))
    }

    /// Queues the frame with this index in the run. Frames may arrive in any order. They are dropped once written.
    pub fn queue(&self, index: usize, frame: F) {
        self.send(Some((index, frame)));
    }

    fn send(&self, frame: Option<(usize, F)>) {
        // If the receiver is gone, `finish` returns the cause.
        let _ = self.frames.as_ref().map(|frames| frames.send(frame));
    }

    /// Returns whether the writing thread has ended early.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Waits until all frames are written, and renames the files to their final names.
    ///
    /// # Errors
    /// If the encoder ended early or a file cannot be written.
    ///
    /// # Panics
    /// If the writing thread panicked.
    pub fn finish(mut self) -> Result<()> {
        self.send(None);
        let ended = self.thread.take().map_or(Ok(Ok(())), JoinHandle::join);
        ended.unwrap_or_else(|e| std::panic::resume_unwind(e))
    }
}

/// Returns the frame rate with a resolution of 0.001 per second. It is at least 0.001, because 0 is no valid rate.
fn frame_rate(fps: f64) -> y4m::Ratio {
    y4m::Ratio::new((fps * 1000.0).round().max(1.0) as usize, 1000)
}

fn write<F: AsRef<VideoPlanes>>(
    frames: &Receiver<Option<(usize, F)>>,
    sinks: Vec<(OutputStream, Sink)>,
    header: &impl Fn() -> EncoderBuilder,
) -> Result<()> {
    // A run that fails before its first frame writes nothing.
    let Ok(first) = frames.recv() else {
        return Ok(());
    };
    let begin = |(out, mut sink): (OutputStream, Sink)| Ok((sink.begin(out, header())?, sink));
    let mut sinks = sinks.into_iter().map(begin).collect::<Result<Vec<_>>>()?;
    let (mut next, mut early) = (0, BTreeMap::new());
    for frame in iter::once(first).chain(frames) {
        let Some((index, frame)) = frame else {
            return (sinks.into_iter()).try_for_each(|(out, sink)| sink.end(out));
        };
        early.insert(index, frame);
        while let Some(frame) = early.remove(&next) {
            for (out, sink) in &mut sinks {
                sink.frame(out, frame.as_ref())?;
            }
            next += 1;
        }
    }
    // The end marker is missing, so the run ended early and leaves no video.
    Ok(())
}

/// Stream that receives a video's bytes: a file, standard output or the input of `ffmpeg`. It must be dropped before
/// its [`Sink`], so that no encoder writes to a removed file.
type OutputStream = Box<dyn Write + Send>;

/// Output file of a video, and the encoder that writes it, if any.
struct Sink {
    encoder: Option<Encoder>,
    file: Option<UnfinishedFile>,
    path: PathBuf,
}

impl Sink {
    /// Opens a file, or standard output for `-`. If `format` is given, an encoder writes the file.
    fn open(path: &Path, format: Option<&str>) -> Result<(OutputStream, Self)> {
        let cannot = |e| OutputError::writing(path, e);
        let is_named = path.as_os_str() != "-";
        let beside = || UnfinishedFile::beside(path).map_err(cannot);
        let file = is_named.then(beside).transpose()?.flatten();
        let target = file.as_ref().map_or(path, UnfinishedFile::path);
        let (encoder, out): (_, OutputStream) = match format {
            Some(format) => {
                let (started, pipe) = Encoder::start(format, target)?;
                (Some(started), Box::new(pipe))
            }
            None if is_named => (None, Box::new(open_existing(target).map_err(cannot)?)),
            None => (None, Box::new(io::stdout())),
        };
        let sink = Self {
            encoder,
            file,
            path: path.to_owned(),
        };
        Ok((out, sink))
    }

    fn begin(
        &mut self,
        out: OutputStream,
        header: EncoderBuilder,
    ) -> Result<y4m::Encoder<OutputStream>> {
        let begun = header.with_colorspace(Colorspace::C444).write_header(out);
        begun.map_err(|e| self.failed(&e))
    }

    fn frame(&mut self, out: &mut y4m::Encoder<OutputStream>, planes: &VideoPlanes) -> Result<()> {
        let written = out.write_frame(&planes.frame());
        written.map_err(|e| self.failed(&e))
    }

    fn failed(&mut self, why: &y4m::Error) -> OutputError {
        match self.encoder.take() {
            Some(encoder) => encoder.failed(&why.to_string()),
            None => OutputError::writing(&self.path, why),
        }
    }

    fn end(self, out: y4m::Encoder<OutputStream>) -> Result<()> {
        drop(out);
        let is_encoded = self.encoder.is_some();
        self.encoder.map_or(Ok(()), Encoder::end)?;
        if is_encoded && self.file.as_ref().is_some_and(|file| !holds_any(file)) {
            return Err(OutputError("--video: ffmpeg wrote no video".to_owned()));
        }
        let ended = match self.file {
            Some(file) => file.finish(),
            None => io::stdout().flush(),
        };
        ended.map_err(|e| OutputError::writing(&self.path, e))
    }
}

/// Returns whether a non-empty regular file exists at the temporary path. The encoder may have replaced the file that
/// was created there.
fn holds_any(file: &UnfinishedFile) -> bool {
    let metadata = fs::symlink_metadata(file.path());
    metadata.is_ok_and(|metadata| metadata.is_file() && metadata.len() > 0)
}

/// File extensions with the format names of `ffmpeg`.
const FORMATS: [(&str, &str); 4] = [
    ("mp4", "mp4"),
    ("webm", "webm"),
    ("mkv", "matroska"),
    ("mov", "mov"),
];

fn format_of(path: &Path) -> Result<&'static str> {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    let format = FORMATS.iter().find(|(name, _)| *name == ending);
    format.map(|(_, format)| *format).ok_or_else(|| {
        let known = FORMATS.map(|(name, _)| format!(".{name}")).join(", ");
        let (path, says) = (path.display(), "its name must end in one of");
        OutputError(format!("--video {path}: {says} {known}"))
    })
}

/// Running `ffmpeg` process. Dropping it stops the process.
struct Encoder {
    child: Child,
    /// Captured standard error.
    complaints: File,
}

impl Encoder {
    fn start(format: &str, file: &Path) -> Result<(Self, ChildStdin)> {
        let cannot = |e: io::Error| match e.kind() {
            io::ErrorKind::NotFound => OutputError(
                "--video needs `ffmpeg`, which is not on PATH: install it, or use --y4m".to_owned(),
            ),
            _ => OutputError(format!("--video: ffmpeg cannot be started: {e}")),
        };
        // `ffmpeg` takes a relative path that begins with `-` as an option, and text before a `:` as a protocol. The
        // path of a temporary file is absolute, but a pipe is opened by the path that the user gave, which may be
        // relative.
        let file = std::path::absolute(file).map_err(cannot)?;
        let complaints = tempfile::tempfile().map_err(cannot)?;
        let mut child = Command::new("ffmpeg")
            .args("-loglevel error -y -f yuv4mpegpipe -i pipe:0".split(' '))
            // Most players require even sizes and this pixel format.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2,format=yuv420p"])
            .args(["-f", format])
            .arg(file)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(complaints.try_clone().map_err(cannot)?)
            .spawn()
            .map_err(cannot)?;
        let pipe = child.stdin.take();
        let encoder = Self { child, complaints };
        let pipe = pipe.ok_or_else(|| OutputError("--video: ffmpeg has no stdin".to_owned()))?;
        // Maximum size without privileges. A larger pipe needs fewer context switches.
        #[cfg(target_os = "linux")]
        let _ = rustix::pipe::fcntl_setpipe_size(&pipe, 1 << 20);
        Ok((encoder, pipe))
    }

    fn end(mut self) -> Result<()> {
        match self.child.wait() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(self.failed(&status.to_string())),
            Err(e) => Err(self.failed(&e.to_string())),
        }
    }

    /// Returns an error with the encoder's last message, or else with `why`.
    fn failed(mut self, why: &str) -> OutputError {
        // The process must end first, because its last message may contain the cause.
        let _ = self.child.wait();
        let mut messages = Vec::new();
        let read = self.complaints.rewind();
        let _ = read.and_then(|()| self.complaints.read_to_end(&mut messages));
        let messages = String::from_utf8_lossy(&messages);
        let last = messages.lines().rfind(|line| !line.trim().is_empty());
        let why = last.unwrap_or(why);
        OutputError(format!("--video: ffmpeg ended early: {why}"))
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_rate_is_positive() {
        for (fps, expected) in [(0.0004, 1), (0.001, 1), (23.976, 23_976)] {
            let rate = frame_rate(fps);
            assert_eq!((rate.num, rate.den), (expected, 1000), "{fps}");
        }
    }
}
