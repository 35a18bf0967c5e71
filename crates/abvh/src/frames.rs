//! Renders sequences of pictures at the full speed of the device.
//!
//! ```
//! use abvh::frames::{Frame, Wanted};
//! use abvh::{Camera, Device, Mesh, Scene, Tracer};
//!
//! let [low, high] = [0.0, 2.0].map(|y| vec![[-1.0, y, -1.0], [1.0, y, -1.0], [0.0, y, 1.0]]);
//! let mut scene = Scene::new();
//! scene.add(Mesh::keyframes(vec![low, high], &[[0, 1, 2]])?);
//! let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
//! let camera = Camera::look_at([0.0, 4.0, 6.0], [0.0; 3], [0.0, 1.0, 0.0], 50.0, [64, 36]).unwrap();
//! let frames: Vec<Frame> = (0..5).map(|i| Frame { index: i, time: i as f64 / 4.0 }).collect();
//! let (light, mut pictures) = ([3.0, 8.0, 3.0], Vec::new());
//! tracer.render_frames(&frames, (&camera, light), Wanted::PIXELS, |_, answers| {
//!     pictures.push(std::mem::take(&mut answers.pixels));
//!     Ok::<_, abvh::Error>(())
//! })?;
//! assert!(pictures.len() == 5 && pictures.iter().all(|rgba| rgba.len() == 4 * 64 * 36));
//! # Ok::<_, abvh::Error>(())
//! ```

use crate::loaded::Loaded;
use crate::tracer::{State, moment};
use crate::{Error, Point, Result, Tracer};
use geom::Camera;
use pipeline::LOOK_AHEAD;
pub use pipeline::{Answers, Frame, FrameRecord, Wanted};

impl Tracer {
    /// Starts to compile the kernels for such frames, on separate threads. Returns whether the device computes the
    /// pixels, if pixels are wanted. If it returns `false`, the host shades the hits.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn prepare_frames(&mut self, shot: (&Camera, Point), wanted: Wanted) -> Result<bool> {
        let loaded = &mut self.state().current;
        let shades = wanted.pixels && loaded.host_colours()?.is_none();
        loaded.driver.prepare(shading::query(shot));
        Ok(shades)
    }

    /// Renders the view of a camera at the times of `frames`, lit by the sky and by one point light.
    ///
    /// As many frames are in flight as the device allows, and key frames are read ahead. `on_frame` is called for each
    /// finished frame, in the order of `frames`, with the results selected by `wanted`. It may take the memory of the
    /// results; memory that it leaves is reused. Streamed and rigid meshes keep the vertices of the last step. Results
    /// of earlier steps are dropped.
    ///
    /// A frame's `index` is not used here and is passed through. [`FrameRecord`] holds measurements, and may get more
    /// fields with each version.
    ///
    /// # Errors
    /// [`Error::KeyFrame`], [`Error::Unsupported`], [`Error::Device`], or the error of `on_frame`.
    pub fn render_frames<E: From<Error>>(
        &mut self,
        frames: &[Frame],
        shot: (&Camera, Point),
        wanted: Wanted,
        mut on_frame: impl FnMut(&FrameRecord, &mut Answers) -> Result<(), E>,
    ) -> Result<(), E> {
        let state = self.state();
        state.current.finish_all(&mut state.last)?;
        state.keep_from(u64::MAX);
        let State { current, last, .. } = state;
        let colours = if wanted.pixels {
            current.host_colours()?
        } else {
            None
        };
        let query = shading::query(shot);
        let most = if colours.is_some() && current.joined.is_streamed() {
            // The host shades with the animation's newest vertices, which a later frame would replace.
            1
        } else {
            current.driver.most_under_way(&[query])
        };
        let mut answers = Answers::default();
        let mut finish = |loaded: &mut Loaded, frame: Frame| -> Result<(), E> {
            let mut record = loaded.take(wanted, &mut answers, last)?;
            if let Some(colours) = &colours {
                let Answers { hits, pixels } = &mut answers;
                let time = moment(frame.time);
                (loaded.joined).shade(time, colours, shot, (hits, pixels))?;
            }
            record.frame = frame;
            on_frame(&record, &mut answers)
        };
        for (i, &frame) in frames.iter().enumerate() {
            let times = frames[i..].iter().map(|frame| moment(frame.time));
            current.joined.look_ahead(times.take(LOOK_AHEAD));
            current.start(moment(frame.time), &[query])?;
            if let Some(oldest) = (i + 1).checked_sub(most) {
                finish(current, frames[oldest])?;
            }
        }
        let left = frames.iter().skip((frames.len() + 1).saturating_sub(most));
        left.copied().try_for_each(|frame| finish(current, frame))
    }
}
