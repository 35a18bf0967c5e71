//! Options of `render`.

use super::{DeviceArgs, SourceArgs, UpdateName};
use crate::values::{self, Frames, Shard, TimeRange};
use backend::Intersector;
use clap::{ArgAction, Args};
use geom::Point;
use output::Chroma;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(crate) struct RenderArgs {
    /// Scene. Either a demo, demo:NAME or demo:NAME:TRIANGLES, with NAME grove, collide, shatter, twist or hall. Or a
    /// directory or glob of .obj or .ply files, one per key frame. Or one .obj, .ply, .gltf or .glb file. '+' joins
    /// inputs; '@x,y,z' or '@x,y,z*scale' places an input: hall.obj+figure.glb@2,0,-1*0.5. The name of an existing file
    /// or folder is always one input. Moving inputs need equal numbers of key frames; an input with one key frame is
    /// static
    #[arg(default_value = "demo:grove", value_parser = values::scene())]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,
    /// How a ray is tested against a triangle
    #[arg(long, value_name = "NAME", default_value = "watertight", value_parser = values::intersector(|_| true))]
    pub(crate) intersector: Intersector,
    /// How trees follow the motion
    #[arg(long, value_name = "POLICY", default_value = "auto", value_parser = values::update())]
    pub(crate) update: UpdateName,
    /// With async: adopt each tree exactly K frames after its request
    #[arg(long, value_name = "K")]
    pub(crate) lockstep: Option<u32>,
    /// With async: time for which each new tree is built. 'on': the middle of the period in which the tree will be
    /// used, predicted from the key frames. 'off': the time of the frame that requests the tree. Hits are the same;
    /// predicted trees fit better, so frames are faster
    #[arg(long, value_name = "on|off", default_value = "on", action = ArgAction::Set, value_parser = values::switch())]
    pub(crate) predict: bool,
    /// Frames: N spread evenly over the time range, both ends included. Or the key times A..B, without B. Or a list of
    /// key times, such as 1,4,10-20x2 (10 to 20 in steps of 2). Files of key times are numbered by key time, others
    /// from 0000 [default: 48 for a demo, else one per key frame up to 96]
    #[arg(long, value_name = "N|A..B|LIST", value_parser = values::frames)]
    pub(crate) frames: Option<Frames>,
    /// Render only block I of N of the frames, counted from 1; auto takes both from the variables of a Slurm array task
    #[arg(long, value_name = "I/N|auto", value_parser = values::shard)]
    pub(crate) shard: Option<Shard>,
    /// Time range, in key frames [default: the whole motion]
    #[arg(long, value_name = "T0..T1", value_parser = values::time_range, allow_hyphen_values = true)]
    pub(crate) time_range: Option<TimeRange>,
    /// Frame size in pixels
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "1280x720")]
    pub(crate) size: [u32; 2],
    /// Position of the camera
    #[arg(long, value_name = "x,y,z", value_parser = values::point::<f64>, allow_hyphen_values = true)]
    pub(crate) eye: Option<[f64; 3]>,
    /// Point that the camera looks at
    #[arg(long, value_name = "x,y,z", value_parser = values::point::<f64>, allow_hyphen_values = true)]
    pub(crate) look_at: Option<[f64; 3]>,
    /// Up direction of the camera
    #[arg(long, value_name = "x,y,z", value_parser = values::point::<f32>, allow_hyphen_values = true)]
    pub(crate) up: Option<Point>,
    /// Vertical field of view, in degrees
    #[arg(long, value_name = "DEG", default_value = "40", value_parser = values::number(|d: f32| d > 0.0 && d < 180.0,
        "a field of view lies between 0 and 180 degrees"))]
    pub(crate) fov: f32,
    /// Position of the lamp
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
    /// File for a video, encoded by the `ffmpeg` on PATH: .mp4, .webm, .mkv or .mov. It plays --fps frames per second
    #[arg(long, value_name = "FILE", value_parser = values::file())]
    pub(crate) video: Option<PathBuf>,
    /// File for an uncompressed video (YUV4MPEG2, 4:4:4), - for standard output
    #[arg(long, value_name = "FILE.y4m")]
    pub(crate) y4m: Option<PathBuf>,
    /// File for statistics of every frame, - for standard output
    #[arg(long, value_name = "FILE.json")]
    pub(crate) stats: Option<PathBuf>,
    /// File for a timeline of host and device, for Perfetto or chrome://tracing
    #[arg(long, value_name = "FILE.json", value_parser = values::file())]
    pub(crate) timeline: Option<PathBuf>,
    /// File for the primary rays of a frame, as input for `abvh trace`
    #[arg(long, value_name = "FILE.npy", value_parser = values::file())]
    pub(crate) rays_out: Option<PathBuf>,
    /// Resume the run in the output folders: skip frames whose files are complete, by length and digest. If the folders
    /// hold another run, fail and name the difference
    #[arg(long)]
    pub(crate) resume: bool,
    /// Replace another run in the output folders
    #[arg(long, conflicts_with = "resume")]
    pub(crate) overwrite: bool,
    /// Print no progress and no remarks
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

impl RenderArgs {
    /// Returns the chroma resolutions that the videos need: halved for an encoder, full for Y4M.
    pub(crate) fn chroma(&self) -> Chroma {
        Chroma {
            halved: self.video.is_some(),
            full: self.y4m.is_some(),
        }
    }
}
