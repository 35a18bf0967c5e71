//! Frames as one video, in order: uncompressed as YUV4MPEG2, or encoded by `ffmpeg`, which reads that from a pipe.

use crate::OutputError;
use crate::atomic::UnfinishedFile;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::File;
use std::io::{self, prelude::*};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use y4m::Colorspace;

const FULL: Colorspace = Colorspace::C444;

type Result<T> = std::result::Result<T, OutputError>;

/// What a video is to be.
#[derive(Clone, Copy, Debug)]
pub struct VideoFiles<'a> {
    /// A file that `ffmpeg` encodes, its format told by its ending.
    pub encoded: Option<&'a Path>,
    /// A YUV4MPEG2 file; `-` is standard output.
    pub y4m: Option<&'a Path>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Frames a second.
    pub fps: f64,
}

/// Writes videos on a thread of its own, of frames `F` that hold three bytes of sRGB a pixel.
///
/// Dropped before its end, it leaves no file: whoever drops it waits for that.
#[derive(Debug)]
pub struct Video<F> {
    /// Frames with their places; `None` after the last.
    frames: Option<Sender<Option<(usize, F)>>>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl<F> Drop for Video<F> {
    fn drop(&mut self) {
        drop(self.frames.take());
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl<F: AsRef<[u8]> + Send + 'static> Video<F> {
    /// Begins what is wanted; `None` if nothing is.
    ///
    /// # Errors
    /// There is no `ffmpeg`, or a file cannot be made.
    pub fn begin(wanted: &VideoFiles<'_>) -> Result<Option<Self>> {
        let encoded = wanted.encoded.map(|file| Sink::encoded(file, wanted));
        let y4m = wanted.y4m.map(|file| Sink::raw(file, wanted));
        let sinks: Vec<Sink> = encoded.into_iter().chain(y4m).collect::<Result<_>>()?;
        if sinks.is_empty() {
            return Ok(None);
        }
        let (frames, receiver) = channel();
        let width = wanted.size[0] as usize;
        let thread = thread::Builder::new().spawn(move || write(&receiver, sinks, width));
        let thread = thread.map_err(|e| OutputError(format!("no thread for the video: {e}")))?;
        Ok(Some(Self {
            frames: Some(frames),
            thread: Some(thread),
        }))
    }

    /// Takes the frame at a place in the run; places may come in any order. It is dropped when it is written.
    pub fn take(&self, place: usize, frame: F) {
        self.send(Some((place, frame)));
    }

    fn send(&self, frame: Option<(usize, F)>) {
        // Why nobody listens any more, `finish` says.
        let _ = self.frames.as_ref().map(|frames| frames.send(frame));
    }

    /// Whether writing has ended early.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Waits until all frames are written, and gives each file its name.
    ///
    /// # Errors
    /// The encoder ended early, or a file cannot be written.
    ///
    /// # Panics
    /// If the writing thread did.
    pub fn finish(mut self) -> Result<()> {
        self.send(None);
        let ended = self.thread.take().map_or(Ok(Ok(())), JoinHandle::join);
        ended.unwrap_or_else(|e| std::panic::resume_unwind(e))
    }
}

fn write<F: AsRef<[u8]>>(
    frames: &Receiver<Option<(usize, F)>>,
    mut sinks: Vec<Sink>,
    width: usize,
) -> Result<()> {
    let (mut next, mut early) = (0, BTreeMap::new());
    let mut planes = Planes::default();
    for frame in frames {
        let Some((place, frame)) = frame else {
            return sinks.into_iter().try_for_each(Sink::end);
        };
        early.insert(place, frame);
        while let Some(frame) = early.remove(&next) {
            separate(frame.as_ref(), &mut planes.full);
            for sink in &mut sinks {
                let frame = planes.frame(width, sink.is_halved);
                sink.frame(&frame)?;
            }
            next += 1;
        }
    }
    // A run that ended early leaves no video.
    Ok(())
}

/// A frame's luma and chroma, of BT.601 in its limited range, which readers of the format take them for.
#[derive(Default)]
struct Planes {
    /// At full size (4:4:4).
    full: [Vec<u8>; 3],
    /// Chroma at half of it along both axes (4:2:0).
    halves: [Vec<u8>; 2],
}

impl Planes {
    /// Of so many columns; 4:2:0 if `halved`.
    fn frame(&mut self, width: usize, halved: bool) -> y4m::Frame<'_> {
        let [y, cb, cr] = &self.full;
        if !halved {
            return y4m::Frame::new([y, cb, cr], None);
        }
        let halves = &mut self.halves;
        halve((cb, width), &mut halves[0]);
        halve((cr, width), &mut halves[1]);
        y4m::Frame::new([y, &halves[0], &halves[1]], None)
    }
}

/// Means of two by two samples; at an odd edge, of those that are there twice.
fn halve((plane, width): (&[u8], usize), to: &mut Vec<u8>) {
    let (width, half) = (width.max(1), width.div_ceil(2).max(1));
    to.resize(half * (plane.len() / width).div_ceil(2), 0);
    let rows = plane.par_chunks(2 * width).zip(to.par_chunks_mut(half));
    rows.for_each(|(rows, to)| {
        let (upper, lower) = rows.split_at(width);
        let lower = if lower.is_empty() { upper } else { lower };
        let pairs = upper.chunks(2).zip(lower.chunks(2));
        for ((upper, lower), to) in pairs.zip(to) {
            let both = |row: &[u8]| u16::from(row[0]) + u16::from(row[row.len() - 1]);
            *to = ((both(upper) + both(lower) + 2) / 4) as u8;
        }
    });
}

/// A video: full size (4:4:4) in a file of its own, and for the encoder the half of it that it takes (4:2:0).
struct Sink {
    // Dropped in this order: no encoder writes a file that is gone.
    video: y4m::Encoder<Box<dyn Write + Send>>,
    is_halved: bool,
    encoder: Option<Encoder>,
    file: Option<UnfinishedFile>,
    name: String,
}

impl Sink {
    fn raw(path: &Path, wanted: &VideoFiles<'_>) -> Result<Self> {
        if path.as_os_str() == "-" {
            return Self::begin(path, wanted, (FULL, Box::new(io::stdout())));
        }
        let cannot = |e| cannot_write(path.display(), e);
        let file = UnfinishedFile::beside(path).map_err(cannot)?;
        let out = File::create(file.path()).map_err(cannot)?;
        Ok(Self {
            file: Some(file),
            ..Self::begin(path, wanted, (FULL, Box::new(out)))?
        })
    }

    fn encoded(path: &Path, wanted: &VideoFiles<'_>) -> Result<Self> {
        let format = format_of(path)?;
        let file = UnfinishedFile::beside(path).map_err(|e| cannot_write(path.display(), e))?;
        let (encoder, pipe) = Encoder::start(format, file.path())?;
        Ok(Self {
            encoder: Some(encoder),
            file: Some(file),
            ..Self::begin(path, wanted, (Colorspace::C420jpeg, Box::new(pipe)))?
        })
    }

    fn begin(
        path: &Path,
        wanted: &VideoFiles<'_>,
        (colours, out): (Colorspace, Box<dyn Write + Send>),
    ) -> Result<Self> {
        let name = path.display().to_string();
        let [width, height] = wanted.size.map(|n| n as usize);
        // Frames a second to a thousandth.
        let rate = y4m::Ratio::new((wanted.fps * 1000.0).round() as usize, 1000);
        let header = y4m::encode(width, height, rate).with_colorspace(colours);
        let video = header.write_header(out);
        Ok(Self {
            video: video.map_err(|e| cannot_write(&name, e))?,
            is_halved: matches!(colours, Colorspace::C420jpeg),
            encoder: None,
            file: None,
            name,
        })
    }

    fn frame(&mut self, frame: &y4m::Frame<'_>) -> Result<()> {
        let written = self.video.write_frame(frame);
        written.map_err(|e| match self.encoder.take() {
            Some(encoder) => encoder.failed(&e.to_string()),
            None => cannot_write(&self.name, e),
        })
    }

    fn end(self) -> Result<()> {
        drop(self.video);
        self.encoder.map_or(Ok(()), Encoder::end)?;
        let ended = match self.file {
            Some(file) => file.finish(),
            None => io::stdout().flush(),
        };
        ended.map_err(|e| cannot_write(&self.name, e))
    }
}

fn cannot_write(name: impl Display, cause: impl Display) -> OutputError {
    OutputError(format!("cannot write {name}: {cause}"))
}

/// Endings of files, and `ffmpeg`'s names for their formats.
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
        let (path, known) = (path.display(), FORMATS.map(|(name, _)| format!(".{name}")));
        let known = known.join(", ");
        OutputError(format!(
            "--video {path}: its name must end in one of {known}"
        ))
    })
}

/// `ffmpeg`. Dropped before its end, it is stopped.
struct Encoder {
    child: Child,
    /// What it complains of.
    complaints: File,
}

impl Encoder {
    fn start(format: &str, file: &Path) -> Result<(Self, ChildStdin)> {
        let cannot = |e: io::Error| match e.kind() {
            io::ErrorKind::NotFound => OutputError(
                "--video takes `ffmpeg`, which is not on PATH: install it, or use --y4m".to_owned(),
            ),
            _ => OutputError(format!("--video: ffmpeg cannot be started: {e}")),
        };
        let complaints = tempfile::tempfile().map_err(cannot)?;
        let mut child = Command::new("ffmpeg")
            .args(["-loglevel", "error", "-y", "-f", "yuv4mpegpipe"])
            .args(["-i", "pipe:0"])
            // Most players want even sizes and this format.
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
        let pipe = pipe.ok_or_else(|| OutputError("--video: ffmpeg reads nothing".to_owned()))?;
        Ok((encoder, pipe))
    }

    fn end(mut self) -> Result<()> {
        match self.child.wait() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(self.failed(&status.to_string())),
            Err(e) => Err(self.failed(&e.to_string())),
        }
    }

    /// With the encoder's own words, where it has any.
    fn failed(mut self, why: &str) -> OutputError {
        // What it is about to say may say why.
        let _ = self.child.wait();
        let mut said = Vec::new();
        let read = self.complaints.rewind();
        let _ = read.and_then(|()| self.complaints.read_to_end(&mut said));
        let said = String::from_utf8_lossy(&said);
        let last = said.lines().rfind(|line| !line.trim().is_empty());
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

/// Luma and chroma of sRGB pixels, three bytes each.
fn separate(rgb: &[u8], [y, cb, cr]: &mut [Vec<u8>; 3]) {
    let pixels = rgb.as_chunks::<3>().0;
    for plane in [&mut *y, cb, cr] {
        plane.resize(pixels.len(), 0);
    }
    let planes = (&mut y[..], &mut cb[..], &mut cr[..]);
    let planes = planes.into_par_iter().with_min_len(1 << 14);
    let pixels = pixels.par_iter();
    pixels.zip(planes).for_each(|(pixel, (y, cb, cr))| {
        [*y, *cb, *cr] = ycbcr(*pixel);
    });
}

/// sRGB to Y'CbCr of BT.601 in its limited range, in fixed point of 16 bits.
fn ycbcr([r, g, b]: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = [r, g, b].map(i32::from);
    let sum = |[x, y, z]: [i32; 3], offset: i32| {
        (((x * r + y * g + z * b + (1 << 15)) >> 16) + offset) as u8
    };
    [
        sum([16_829, 33_039, 6_416], 16),
        sum([-9_714, -19_070, 28_784], 128),
        sum([28_784, -24_103, -4_681], 128),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chroma_is_halved_along_both_axes_and_edges_count_twice() {
        let mut halves = Vec::new();
        halve((&[0, 4, 8, 4, 9, 10, 20, 22, 30], 3), &mut halves);
        assert_eq!(halves, [4, 9, 21, 30]);
        halve((&[1, 3, 5, 7], 2), &mut halves);
        assert_eq!(halves, [4]);
        halve((&[], 2), &mut halves);
        assert_eq!(halves, [0; 0]);
    }

    #[test]
    fn greys_have_no_chroma_and_reach_both_ends() {
        assert_eq!(ycbcr([0; 3]), [16, 128, 128]);
        assert_eq!(ycbcr([255; 3]), [235, 128, 128]);
        assert_eq!(ycbcr([255, 0, 0]), [81, 90, 240]);
        assert_eq!(ycbcr([0, 0, 255]), [41, 240, 110]);
    }
}
