//! Frames as one video, in order: encoded by `ffmpeg`, or uncompressed as YUV4MPEG2.

use crate::stop::Stop;
use crate::writer::Lent;
use output::UnfinishedFile;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

/// What a video is to be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted<'a> {
    /// A file that `ffmpeg` encodes, its format told by its ending.
    pub(crate) encoded: Option<&'a Path>,
    /// A YUV4MPEG2 file; `-` is standard output.
    pub(crate) y4m: Option<&'a Path>,
    /// Width and height in pixels.
    pub(crate) size: [u32; 2],
    /// Frames a second.
    pub(crate) fps: f64,
}

/// Writes videos on a thread of its own. Dropped before its end, it leaves no file: whoever drops it waits for that.
pub(crate) struct Video {
    frames: Option<Sender<Message>>,
    thread: Option<JoinHandle<Result<(), Stop>>>,
}

impl Drop for Video {
    fn drop(&mut self) {
        drop(self.frames.take());
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

enum Message {
    /// A frame, and its place in the run.
    Frame(usize, Lent),
    /// All frames were sent.
    End,
}

impl Video {
    /// Begins what is wanted; `None` if nothing is.
    ///
    /// # Errors
    /// There is no `ffmpeg`, or a file cannot be made.
    pub(crate) fn begin(wanted: &Wanted<'_>) -> Result<Option<Self>, Stop> {
        let mut sinks = Vec::new();
        if let Some(file) = wanted.encoded {
            sinks.push(Sink::Encoder(Encoder::start(file, wanted)?));
        }
        if let Some(file) = wanted.y4m {
            sinks.push(Sink::Y4m(Y4m::begin(file, wanted)?));
        }
        if sinks.is_empty() {
            return Ok(None);
        }
        let (frames, receiver) = channel();
        let thread = thread::Builder::new().spawn(move || write(&receiver, sinks));
        let thread = thread.map_err(|e| Stop::failed(format!("no thread for the video: {e}")))?;
        Ok(Some(Self {
            frames: Some(frames),
            thread: Some(thread),
        }))
    }

    /// Takes the frame at a place in the run; places may come in any order. Its buffers go back when it is written.
    pub(crate) fn take(&self, place: usize, lent: Lent) {
        self.send(Message::Frame(place, lent));
    }

    fn send(&self, message: Message) {
        // Why nobody listens any more, `finish` says.
        let _ = self.frames.as_ref().map(|frames| frames.send(message));
    }

    /// Whether writing has ended early.
    pub(crate) fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Waits until all frames are written, and gives each file its name.
    ///
    /// # Errors
    /// The encoder ended early, or a file cannot be written.
    pub(crate) fn finish(mut self) -> Result<(), Stop> {
        self.send(Message::End);
        let ended = self.thread.take().map_or(Ok(Ok(())), JoinHandle::join);
        ended.unwrap_or_else(|e| std::panic::resume_unwind(e))
    }
}

fn write(messages: &Receiver<Message>, mut sinks: Vec<Sink>) -> Result<(), Stop> {
    let (mut next, mut early) = (0, BTreeMap::new());
    for message in messages {
        let Message::Frame(place, lent) = message else {
            return sinks.into_iter().try_for_each(Sink::end);
        };
        early.insert(place, lent);
        while let Some(lent) = early.remove(&next) {
            sinks
                .iter_mut()
                .try_for_each(|sink| sink.frame(lent.rgb()))?;
            next += 1;
        }
    }
    // A run that ended early leaves no video.
    Ok(())
}

enum Sink {
    Encoder(Encoder),
    Y4m(Y4m),
}

impl Sink {
    fn frame(&mut self, rgb: &[u8]) -> Result<(), Stop> {
        match self {
            Self::Encoder(encoder) => encoder.frame(rgb),
            Self::Y4m(y4m) => y4m.frame(rgb),
        }
    }

    fn end(self) -> Result<(), Stop> {
        match self {
            Self::Encoder(encoder) => encoder.end(),
            Self::Y4m(y4m) => y4m.end(),
        }
    }
}

/// `ffmpeg`, which reads frames from a pipe. Dropped before its end, it leaves no file.
struct Encoder {
    child: Child,
    /// Reads what it complains of.
    complaints: Option<JoinHandle<String>>,
    file: Option<UnfinishedFile>,
}

/// Endings of files, and `ffmpeg`'s names for their formats.
const FORMATS: [(&str, &str); 4] = [
    ("mp4", "mp4"),
    ("webm", "webm"),
    ("mkv", "matroska"),
    ("mov", "mov"),
];

impl Encoder {
    fn start(path: &Path, wanted: &Wanted<'_>) -> Result<Self, Stop> {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        let format = FORMATS.iter().find(|(name, _)| *name == ending);
        let format = format.map(|(_, format)| *format).ok_or_else(|| {
            let known = FORMATS.map(|(name, _)| format!(".{name}")).join(", ");
            Stop::bad(format!(
                "--video {}: its name must end in one of {known}",
                path.display()
            ))
        })?;
        let file = UnfinishedFile::beside(path).map_err(Stop::bad)?;
        let [width, height] = wanted.size;
        let mut child = Command::new("ffmpeg")
            .args(["-loglevel", "error", "-y", "-f", "rawvideo"])
            .args(["-pixel_format", "rgb24", "-video_size"])
            .arg(format!("{width}x{height}"))
            .args(["-framerate", &wanted.fps.to_string(), "-i", "pipe:0"])
            // Most players want even sizes and this format.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2,format=yuv420p"])
            .args(["-f", format])
            .arg(file.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| match e.kind() {
                io::ErrorKind::NotFound => Stop::bad(
                    "--video takes `ffmpeg`, which is not on PATH: install it, or use --y4m",
                ),
                _ => Stop::bad(format!("--video: ffmpeg cannot be started: {e}")),
            })?;
        let complaints = child.stderr.take().map(|mut stderr| {
            thread::spawn(move || {
                let mut text = Vec::new();
                let _ = stderr.read_to_end(&mut text);
                String::from_utf8_lossy(&text).into_owned()
            })
        });
        Ok(Self {
            child,
            complaints,
            file: Some(file),
        })
    }

    fn frame(&mut self, rgb: &[u8]) -> Result<(), Stop> {
        let pipe = self.child.stdin.as_mut();
        let written = pipe.map_or(Ok(()), |pipe| pipe.write_all(rgb));
        written.map_err(|e| self.failed(&e.to_string()))
    }

    fn end(mut self) -> Result<(), Stop> {
        drop(self.child.stdin.take());
        let status = self.child.wait().map_err(Stop::failed)?;
        if !status.success() {
            return Err(self.failed(&status.to_string()));
        }
        let file = self.file.take();
        file.map_or(Ok(()), |file| file.finish().map_err(Stop::from))
    }

    /// With the encoder's own words, where it has any.
    fn failed(&mut self, why: &str) -> Stop {
        drop(self.child.stdin.take());
        let _ = self.child.kill();
        let said = self.complaints.take().and_then(|thread| thread.join().ok());
        let said = said.unwrap_or_default();
        let last = said.lines().rfind(|line| !line.trim().is_empty());
        Stop::failed(format!(
            "--video: ffmpeg ended early: {}",
            last.unwrap_or(why)
        ))
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        if self.file.is_some() {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }
}

/// An uncompressed video: the frames' luma and chroma at full size (4:4:4), of BT.601 in its limited range, which readers
/// of the format take it for.
struct Y4m {
    encoder: y4m::Encoder<Box<dyn Write + Send>>,
    planes: [Vec<u8>; 3],
    file: Option<UnfinishedFile>,
    name: String,
}

impl Y4m {
    fn begin(path: &Path, wanted: &Wanted<'_>) -> Result<Self, Stop> {
        let name = path.display().to_string();
        let (file, out): (_, Box<dyn Write + Send>) = match path.as_os_str() == "-" {
            true => (None, Box::new(io::stdout())),
            false => {
                let file = UnfinishedFile::beside(path).map_err(Stop::bad)?;
                let out = File::create(file.path())
                    .map_err(|e| Stop::bad(format!("cannot write {name}: {e}")))?;
                (Some(file), Box::new(out))
            }
        };
        let [width, height] = wanted.size.map(|n| n as usize);
        // Frames a second to a thousandth.
        let rate = y4m::Ratio::new((wanted.fps * 1000.0).round() as usize, 1000);
        let header = y4m::encode(width, height, rate).with_colorspace(y4m::Colorspace::C444);
        let encoder = header
            .write_header(out)
            .map_err(|e| Stop::failed(format!("cannot write {name}: {e}")))?;
        Ok(Self {
            encoder,
            planes: Default::default(),
            file,
            name,
        })
    }

    fn frame(&mut self, rgb: &[u8]) -> Result<(), Stop> {
        let pixels = rgb.as_chunks::<3>().0;
        let [y, cb, cr] = &mut self.planes;
        for plane in [&mut *y, cb, cr] {
            plane.resize(pixels.len(), 0);
        }
        let planes = (&mut y[..], &mut cb[..], &mut cr[..]);
        let planes = planes.into_par_iter().with_min_len(1 << 14);
        let pixels = pixels.par_iter();
        pixels.zip(planes).for_each(|(pixel, (y, cb, cr))| {
            [*y, *cb, *cr] = ycbcr(*pixel);
        });
        let frame = y4m::Frame::new([&y[..], cb, cr], None);
        let written = self.encoder.write_frame(&frame);
        written.map_err(|e| Stop::failed(format!("cannot write {}: {e}", self.name)))
    }

    fn end(self) -> Result<(), Stop> {
        match self.file {
            Some(file) => file.finish().map_err(Stop::from),
            None => io::stdout()
                .flush()
                .map_err(|e| Stop::failed(format!("cannot write {}: {e}", self.name))),
        }
    }
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
    fn greys_have_no_chroma_and_reach_both_ends() {
        assert_eq!(ycbcr([0; 3]), [16, 128, 128]);
        assert_eq!(ycbcr([255; 3]), [235, 128, 128]);
        assert_eq!(ycbcr([255, 0, 0]), [81, 90, 240]);
        assert_eq!(ycbcr([0, 0, 255]), [41, 240, 110]);
    }
}
