//! Renders sequences of pictures at the full speed of the device.
//!
//! ```
//! use abvh::frames::{Frame, LitView, OutputSelection};
//! use abvh::{Camera, CameraPose, Device, Mesh, Scene, Tracer};
//!
//! let [low, high] = [0.0, 2.0].map(|y| vec![[-1.0, y, -1.0], [1.0, y, -1.0], [0.0, y, 1.0]]);
//! let mut scene = Scene::new();
//! scene.add(Mesh::keyframes(vec![low, high], &[[0, 1, 2]])?);
//! let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
//! let pose = CameraPose::new([0.0, 4.0, 6.0], [0.0; 3]).with_fov(50.0);
//! let camera = Camera::look_at(pose, [64, 36]).unwrap();
//! let frames: Vec<Frame> = (0..5).map(|i| Frame { index: i, time: i as f64 / 4.0 }).collect();
//! let view = LitView { camera: &camera, light: [3.0, 8.0, 3.0] };
//! let mut pictures = Vec::new();
//! tracer.render_frames(&frames, view, OutputSelection::PIXELS, |_, outputs| {
//!     pictures.push(std::mem::take(&mut outputs.pixels));
//!     Ok::<_, abvh::Error>(())
//! })?;
//! assert!(pictures.len() == 5 && pictures.iter().all(|rgba| rgba.len() == 4 * 64 * 36));
//! # Ok::<_, abvh::Error>(())
//! ```

use crate::loaded::ResidentScene;
use crate::step::clamp_time;
use crate::{Error, Point, Result, Tracer};
use backend::Query;
use geom::Camera;
use pipeline::LOOK_AHEAD;
pub use pipeline::{Frame, FrameOutputs, FrameRecord, OutputSelection};

/// The camera and the light of a picture.
#[derive(Clone, Copy, Debug)]
pub struct LitView<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Position of the point light.
    pub light: Point,
}

impl<'a> LitView<'a> {
    pub(crate) fn query(self) -> Query<'a> {
        Query::picture(self.camera, self.light)
    }
}

impl Tracer {
    /// Starts to compile the kernels for [`Tracer::render_frames`] on separate threads. Returns `true` if pixels are
    /// selected and the device computes them. If the host shades the pixels, [`FrameOutputs`] also holds hits.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]. [`Error::DeviceLost`]. [`Error::Device`].
    pub fn prepare_frames(
        &mut self,
        view: LitView<'_>,
        selection: OutputSelection,
    ) -> Result<bool> {
        let loaded = &mut self.state().current;
        let shades = selection.pixels && loaded.host_colours()?.is_none();
        loaded.driver.prepare(view.query());
        Ok(shades)
    }

    /// Renders the view of a camera at the times of `frames`, lit by the sky and by one point light.
    ///
    /// If possible, two frames are in flight, and key frames are read ahead. `on_frame` is called for each finished
    /// frame, in the order of `frames`, with the selected results. It may take the memory of the results; memory that
    /// it leaves is reused. Streamed and rigid meshes keep the vertices of the last step. Results of earlier steps are
    /// dropped.
    ///
    /// A frame's `index` is not used here and is passed through. [`FrameRecord`] holds measurements, and may get more
    /// fields with each version.
    ///
    /// # Errors
    /// As for [`Step::trace`](crate::Step::trace), or the error of `on_frame`.
    pub fn render_frames<E: From<Error>>(
        &mut self,
        frames: &[Frame],
        view: LitView<'_>,
        selection: OutputSelection,
        mut on_frame: impl FnMut(&FrameRecord, &mut FrameOutputs) -> Result<(), E>,
    ) -> Result<(), E> {
        let state = self.state();
        state.current.finish_all()?;
        state.keep_from(u64::MAX);
        let current = &mut state.current;
        let colours = if selection.pixels {
            current.host_colours()?
        } else {
            None
        };
        let query = view.query();
        let most = if colours.is_some() && current.joined.is_streamed() {
            // The host shades with the animation's newest vertices, which a later frame would replace.
            1
        } else {
            current.driver.max_in_flight(&[query])
        };
        let mut outputs = FrameOutputs::default();
        let mut finish = |loaded: &mut ResidentScene, frame: Frame| -> Result<(), E> {
            let mut record = loaded.take(selection, &mut outputs)?;
            if let Some(colours) = &colours {
                let FrameOutputs { hits, pixels } = &mut outputs;
                let surfaces = loaded.joined.surfaces(clamp_time(frame.time), colours)?;
                surfaces.shade(view, hits, pixels);
            }
            record.frame = frame;
            on_frame(&record, &mut outputs)
        };
        for (i, &frame) in frames.iter().enumerate() {
            let times = frames[i..].iter().map(|frame| clamp_time(frame.time));
            current.joined.look_ahead(times.take(LOOK_AHEAD));
            current.submit(clamp_time(frame.time), &[query])?;
            if let Some(oldest) = (i + 1).checked_sub(most) {
                finish(current, frames[oldest])?;
            }
        }
        let left = frames.iter().skip((frames.len() + 1).saturating_sub(most));
        left.copied().try_for_each(|frame| finish(current, frame))
    }
}
