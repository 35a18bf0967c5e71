//! Pictures of a step.

use crate::frames::LitView;
use crate::joined::JoinedScene;
use crate::loaded::ResidentScene;
use crate::mesh::Colour;
use crate::query::{QueryId, StepId};
use crate::shading::{Surfaces, palette};
use crate::{Error, Point, Result, Step, Tracer};
use geom::Camera;
use std::sync::Arc;

impl Step<'_> {
    /// Renders the view of a camera, lit by the sky and by one point light with shadows. Meshes have their
    /// [colours](crate::Mesh::with_colours). [`Tracer::pixels`] returns the picture, [`Tracer::hits`] its closest hits.
    ///
    /// All devices produce the same bytes with [`Watertight`](crate::Intersector::Watertight) and
    /// [`Exact`](crate::Intersector::Exact). Without a GPU, the host shades the picture before the call returns. The
    /// offset of shadow rays depends on the extent of the vertices. So vertices that only the device has are read back
    /// first, and the call waits for them.
    ///
    /// ```
    /// # use abvh::{Camera, CameraPose, Device, Mesh, Scene, Tracer};
    /// let floor = [[-9.0, 0.0, -9.0], [9.0, 0.0, -9.0], [0.0, 0.0, 9.0]];
    /// let mut scene = Scene::new();
    /// scene.add(Mesh::fixed(&floor, &[[0, 1, 2]])?.with_colours(&[[160, 60, 40]])?);
    /// let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
    /// let pose = CameraPose::new([0.0, 4.0, 6.0], [0.0; 3]).with_fov(50.0);
    /// let camera = Camera::look_at(pose, [64, 36]).unwrap();
    /// let mut step = tracer.step(0.0);
    /// let picture = step.render(&camera, [3.0, 8.0, 3.0])?;
    /// let done = step.submit()?;
    /// let mut rgba = Vec::new();
    /// tracer.pixels(done, picture, &mut rgba)?;
    /// let middle = &rgba[4 * (18 * 64 + 32)..][..4];
    /// assert!(middle[0] > middle[1] && middle[1] > middle[2] && middle[3] == 255);
    /// # Ok::<_, abvh::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`Step::trace`].
    pub fn render(&mut self, camera: &Camera, light: Point) -> Result<QueryId> {
        let id = self.next_id();
        let rendered = self.render_as(id, LitView { camera, light });
        self.remove_query_if_failed(id, rendered)
    }

    fn render_as(&mut self, id: QueryId, view: LitView<'_>) -> Result<()> {
        let current = &mut self.tracer.current;
        let colours = current.host_colours()?;
        current.submit_and_record_results(self.time, &[id], &[view.query()])?;
        let (Some(colours), Some(index)) = (colours, current.results.len().checked_sub(1)) else {
            return Ok(());
        };
        let (hits, mut rgba) = (current.hits(index)?, Vec::new());
        let surfaces = current.joined.surfaces(self.time, &colours)?;
        surfaces.shade(view, hits.of_backend(), &mut rgba);
        if let Some(result) = current.results.back_mut() {
            result.pixels = Some(rgba);
        }
        Ok(())
    }
}

impl Tracer {
    /// Waits for a picture and copies it to `rgba`. A pixel is four bytes: red, green, blue (8-bit sRGB) and 255. Rows
    /// start at the top.
    ///
    /// # Errors
    /// [`Error::NoResult`] if the query belongs to another step, was dropped or is not a picture. The other errors of
    /// [`Tracer::hits`].
    pub fn pixels(&self, step: StepId, picture: QueryId, rgba: &mut Vec<u8>) -> Result<()> {
        let mut state = self.shared_state();
        let (loaded, index) = state.find(step, picture)?;
        let ticket = loaded.results[index].ticket;
        loaded.wait(ticket)?;
        if let Some(shaded) = &loaded.results[index].pixels {
            rgba.clone_from(shaded);
            return Ok(());
        }
        let fetched = loaded.driver.backend().pixels(ticket, rgba);
        let is_there = fetched.map_err(Error::of_backend)?;
        is_there.then_some(()).ok_or(Error::NoResult)
    }
}

impl ResidentScene {
    /// Returns the colours of all triangles if the host shades, and `None` if the device does. The first call uploads
    /// the colours to the device.
    pub(crate) fn host_colours(&mut self) -> Result<Option<Arc<[Colour]>>> {
        if let Some(known) = &self.host_colours {
            return Ok(known.clone());
        }
        let colours = self.joined.triangle_colours();
        let palette = palette(&colours);
        let loaded = self.driver.backend().load_palette(&palette);
        let is_on_device = loaded.map_err(Error::of_backend)?;
        let known = (!is_on_device).then_some(colours);
        Ok(self.host_colours.insert(known).clone())
    }
}

impl JoinedScene {
    /// Returns the triangles with their positions at `time`, or with the newest positions if vertices are streamed.
    pub(crate) fn surfaces<'a>(&'a self, time: f64, colours: &'a [Colour]) -> Result<Surfaces<'a>> {
        let time = if self.is_streamed() {
            self.animation.end()
        } else {
            time
        };
        let moment = self.animation.at(time).map_err(Error::of_reading)?;
        Ok(Surfaces { moment, colours })
    }
}
