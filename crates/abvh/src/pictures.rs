//! Pictures of a step.

use crate::loaded::{Answer, Loaded, find};
use crate::mesh::Colour;
use crate::{Error, Point, QueryId, Result, Statistics, Step, StepId, Tracer};
use geom::{Animation, Camera};
use pipeline::Answers;
use shading::Shot;
use std::sync::Arc;

/// What pictures of a scene take, and what the host made of them.
pub(crate) struct RenderState {
    /// One a triangle, where the host shades; else the device has them.
    colours: Option<Arc<[Colour]>>,
    /// Pixels that the host shaded.
    shaded: Vec<(QueryId, Vec<u8>)>,
}

impl Step<'_> {
    /// Renders what a camera sees in the light of the sky and of one point, with shadows: meshes in their
    /// [colours](crate::Mesh::with_colours). [`Tracer::pixels`] has the picture, [`Tracer::hits`] the closest
    /// hits in it. All devices give the same bytes; one that is no GPU shades before the call returns, in the caller's rayon
    /// pool.
    ///
    /// ```
    /// # use abvh::{Camera, Device, Mesh, Scene, Tracer};
    /// let floor = [[-9.0, 0.0, -9.0], [9.0, 0.0, -9.0], [0.0, 0.0, 9.0]];
    /// let mut scene = Scene::new();
    /// scene.add(Mesh::fixed(&floor, &[[0, 1, 2]])?.with_colours(&[[160, 60, 40]])?);
    /// let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
    /// let camera = Camera::look_at([0.0, 4.0, 6.0], [0.0; 3], [0.0, 1.0, 0.0], 50.0, [64, 36]).unwrap();
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
        let Tracer { current, last, .. } = &mut *self.tracer;
        current.render((self.time, id), (camera, light), last)?;
        Ok(id)
    }
}

impl Tracer {
    /// Waits for a picture and copies it: red, green, blue (8-bit sRGB) and 255 a pixel, row by row from the top.
    ///
    /// # Errors
    /// [`Error::NoResult`] if the query is of another step, was dropped or is no picture; [`Error::Device`].
    pub fn pixels(&mut self, step: StepId, picture: QueryId, rgba: &mut Vec<u8>) -> Result<()> {
        let (loaded, answer) = find(&mut self.current, &mut self.former, step, picture)?;
        loaded.wait(answer.ticket, &mut self.last)?;
        loaded.pixels(picture, answer, rgba)
    }
}

impl Loaded {
    fn render(
        &mut self,
        (time, id): (f64, QueryId),
        shot: (&Camera, Point),
        last: &mut Option<Statistics>,
    ) -> Result<()> {
        let is_on_device = self.is_shaded_on_device()?;
        self.begin(time, (&[id], &[shading::query(shot)]), last)?;
        match self.results.back() {
            Some(&(_, answer)) if !is_on_device => {
                self.wait(answer.ticket, last)?;
                self.shade((id, answer), shot)
            }
            _ => Ok(()),
        }
    }

    /// Whether pictures come from the device; from the first picture on it has all that they take.
    pub(crate) fn is_shaded_on_device(&mut self) -> Result<bool> {
        Ok(self.render_state()?.colours.is_none())
    }

    /// What the first picture takes with it.
    fn render_state(&mut self) -> Result<&mut RenderState> {
        let state = match self.render_state.take() {
            Some(state) => state,
            None => {
                let colours = self.joined.triangle_colours();
                let palette = shading::palette(&colours);
                // Without triangles nothing is traced on a device, and there is only sky.
                let is_on_device = self.animation.live_count() > 0
                    && self.driver.shade(&palette).map_err(Error::of_driver)?;
                RenderState {
                    colours: (!is_on_device).then_some(colours),
                    shaded: Vec::new(),
                }
            }
        };
        Ok(self.render_state.insert(state))
    }

    /// Shades what a query found that is done, and that no step came after.
    fn shade(
        &mut self,
        (id, Answer { ticket, place }): (QueryId, Answer),
        (camera, light): (&Camera, Point),
    ) -> Result<()> {
        let at = self.time_of_last(self.joined.time);
        let hits = self.driver.backend().hits_of(ticket, place);
        let hits = hits.map_err(Error::of_backend)?;
        if let Some(state) = &mut self.render_state {
            let mut rgba = Vec::new();
            state.shade((&self.animation, at), (camera, light), (hits, &mut rgba))?;
            state.shaded.push((id, rgba));
        }
        Ok(())
    }

    /// Likewise, of a frame at a time.
    pub(crate) fn shade_frame(
        &self,
        time: f64,
        shot: (&Camera, Point),
        Answers { hits, pixels }: &mut Answers,
    ) -> Result<()> {
        let at = self.time_of_last(time);
        let state = self.render_state.as_ref();
        state.map_or(Ok(()), |state| {
            state.shade((&self.animation, at), shot, (hits, pixels))
        })
    }

    /// Where the last step stands in the animation, at a time of its own.
    fn time_of_last(&self, time: f64) -> f64 {
        match self.joined.is_live() {
            true => self.animation.end(),
            false => time,
        }
    }

    fn pixels(&mut self, id: QueryId, answer: Answer, rgba: &mut Vec<u8>) -> Result<()> {
        let shaded = self.render_state.iter().flat_map(|state| &state.shaded);
        let is_there = match shaded.into_iter().find(|(shaded, _)| *shaded == id) {
            Some((_, found)) => {
                rgba.clone_from(found);
                true
            }
            None => {
                let backend = self.driver.backend();
                let fetched = backend.pixels(answer.ticket, rgba);
                fetched.map_err(Error::of_backend)?
            }
        };
        is_there.then_some(()).ok_or(Error::NoResult)
    }
}

impl RenderState {
    fn shade(
        &self,
        (animation, time): (&Animation, f64),
        (camera, light): (&Camera, Point),
        (hits, rgba): (&backend::Hits, &mut Vec<u8>),
    ) -> Result<()> {
        let shot = Shot {
            moment: animation.at(time).map_err(Error::of_reading)?,
            colours: self.colours.as_deref().unwrap_or_default(),
            camera,
            light,
        };
        shading::shade(&shot, &hits.closest, &hits.blocked, rgba);
        Ok(())
    }

    /// Drops pictures of steps before one.
    pub(crate) fn keep_from(&mut self, step: u64) {
        self.shaded.retain(|(query, _)| query.step.0 >= step);
    }
}
