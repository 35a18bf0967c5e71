//! Options of `render`.

use super::{DeviceArgs, MethodArgs, SourceArgs, UpdateName};
use crate::values::{self, Frames, Shard, TimeRange};
use clap::{ArgAction, Args};
use geom::Point;
use output::Chroma;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(crate) struct RenderArgs {
    /// Scene: a demo, demo:NAME or demo:NAME:TRIANGLES, of grove, collide, shatter, twist and hall. Or a directory or
    /// glob of .obj or .ply files, one a key frame. Or one .obj, .ply, .gltf or .glb file. Several are joined by '+',
    /// each placed by '@x,y,z' or '@x,y,z*scale': hall.obj+figure.glb@2,0,-1*0.5. A name that exists as a whole is one
    /// input. Inputs that move need equally many key frames; one with a single key frame stands still
    #[arg(default_value = "demo:grove", value_parser = values::scene())]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    /// How trees follow the motion
    #[arg(long, value_name = "POLICY", default_value = "auto", value_parser = values::update())]
    pub(crate) update: UpdateName,
    /// With async: adopt each tree exactly K frames after it was asked for
    #[arg(long, value_name = "K")]
    pub(crate) lockstep: Option<u32>,
    /// With async: what each new tree is built for. 'on': the middle of the time in which it will be used, taken
    /// from the key frames. 'off': the frame that asks for it. Hits are the same; trees built ahead fit better, so
    /// that frames are faster
    #[arg(long, value_name = "on|off", default_value = "on", action = ArgAction::Set, value_parser = values::switch())]
    pub(crate) predict: bool,
    /// Frames: N spread evenly over the time range, both ends included. Or those at key times A..B, B left out. Or a
    /// list of key times, such as 1,4,10-20x2: from 10 to 20 by twos. Files of key times carry these for numbers.
    /// Others are numbered from 0000 on [default: 48 for a demo, else one a key frame up to 96]
    #[arg(long, value_name = "N|A..B|LIST", value_parser = values::frames)]
    pub(crate) frames: Option<Frames>,
    /// Render only block I of N of those frames, from 1 on; auto takes both from Slurm's variables of an array's task
    #[arg(long, value_name = "I/N|auto", value_parser = values::shard)]
    pub(crate) shard: Option<Shard>,
    /// Stretch of time, in key frames [default: all of it]
    #[arg(long, value_name = "T0..T1", value_parser = values::time_range, allow_hyphen_values = true)]
    pub(crate) time_range: Option<TimeRange>,
    /// Pixels of a frame
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "1280x720")]
    pub(crate) size: [u32; 2],
    /// Where the eye is
    #[arg(long, value_name = "x,y,z", value_parser = values::point::<f64>, allow_hyphen_values = true)]
    pub(crate) eye: Option<[f64; 3]>,
    /// What it looks at
    #[arg(long, value_name = "x,y,z", value_parser = values::point::<f64>, allow_hyphen_values = true)]
    pub(crate) look_at: Option<[f64; 3]>,
    /// Which way is up
    #[arg(long, value_name = "x,y,z", value_parser = values::point::<f32>, allow_hyphen_values = true)]
    pub(crate) up: Option<Point>,
    /// Vertical field of view
    #[arg(long, value_name = "DEG", default_value = "40", value_parser = values::number(|d: f32| d > 0.0 && d < 180.0,
        "a field of view lies between 0 and 180 degrees"))]
    pub(crate) fov: f32,
    /// Where the lamp is
    #[arg(long, value_name = "x,y,z", value_parser = values::point::<f64>, allow_hyphen_values = true)]
    pub(crate) light: Option<[f64; 3]>,
    /// Directory for pictures: frame_0000.png and so on
    #[arg(long, value_name = "DIR", default_value = "abvh-out", value_parser = values::file())]
    pub(crate) out: PathBuf,
    /// Write no pictures
    #[arg(long, conflicts_with = "out")]
    pub(crate) no_images: bool,
    /// Directory for hits: hits_0000.npz and so on
    #[arg(long, value_name = "DIR", value_parser = values::file())]
    pub(crate) hits: Option<PathBuf>,
    /// File for a video, encoded by the `ffmpeg` on PATH: .mp4, .webm, .mkv or .mov. It plays --fps frames a second
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) video: Option<PathBuf>,
    /// File for an uncompressed video (YUV4MPEG2, 4:4:4), - for standard output
    #[arg(long, value_name = "FILE.y4m")]
    pub(crate) y4m: Option<PathBuf>,
    /// File for statistics of every frame, - for standard output
    #[arg(long, value_name = "FILE.json")]
    pub(crate) stats: Option<PathBuf>,
    /// File for a timeline of host and device, to be opened in Perfetto or chrome://tracing
    #[arg(long, value_name = "FILE.json", value_parser = values::file())]
    pub(crate) timeline: Option<PathBuf>,
    /// File for the primary rays of a frame, to be traced again with `abvh trace`
    #[arg(long, value_name = "FILE.npy", value_parser = values::file())]
    pub(crate) rays_out: Option<PathBuf>,
    /// Go on with the run that the folders hold: frames whose files are whole, by length and digest, are skipped.
    /// Where another run lies there, whatever differs is named
    #[arg(long)]
    pub(crate) resume: bool,
    /// Replace another run that the folders hold
    #[arg(long, conflicts_with = "resume")]
    pub(crate) overwrite: bool,
    /// No progress and no remarks
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

impl RenderArgs {
    /// What all frames are in videos: an encoder takes half of the chroma.
    pub(crate) fn chroma(&self) -> Chroma {
        Chroma {
            halved: self.video.is_some(),
            full: self.y4m.is_some(),
        }
    }
}
