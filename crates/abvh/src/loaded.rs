//! A scene loaded on a device, with its trees, submissions and results.

use crate::hits::Spares;
use crate::mesh::Colour;
use crate::motion::Joined;
use crate::{Error, Hits, Mesh, Point, QueryId, Ray, Result, Statistics, StepId, Update};
use backend::{Backend, Query, QueryKind, Rays, Ticket};
use geom::{Camera, KeyFrame, lock};
#[cfg(feature = "vulkan")]
use gpu_vulkan::VulkanBackend;
#[cfg(feature = "wgpu")]
use gpu_wgpu::WgpuBackend;
use pipeline::{Answers, BuilderThreads, Driver, DriverOptions, Frame, FrameRecord, Wanted};
use std::any::Any;
use std::collections::VecDeque;
use std::mem::discriminant;
use std::sync::Arc;

/// The properties of a query that its kernels depend on: the camera, if any, and the kind.
#[derive(Clone)]
pub(crate) struct QueryForm {
    camera: Option<Camera>,
    kind: QueryKind,
}

impl QueryForm {
    /// Returns whether both need the same kernels. The position of a light does not matter.
    fn is_like(&self, other: &Self) -> bool {
        let form = |of: &Self| (of.camera.is_some(), discriminant(&of.kind));
        form(self) == form(other)
    }
}

/// Function that creates a backend, on any thread.
type OpenBackend = Box<dyn FnOnce() -> backend::Result<Box<dyn Backend>> + Send>;

pub(crate) struct Loaded {
    pub(crate) driver: Driver,
    pub(crate) joined: Joined,
    pub(crate) update: Update,
    pub(crate) builders: BuilderThreads,
    /// One query of each kind that was traced so far.
    pub(crate) traced_forms: Vec<QueryForm>,
    /// Number of trees of the scenes before this one.
    trees_before: u64,
    /// Submissions that are not known to be done, oldest first.
    pub(crate) under_way: VecDeque<Ticket>,
    /// Results that are available, oldest first.
    pub(crate) results: VecDeque<Answer>,
    /// Memory of hits whose handles were all dropped.
    spares: Spares,
    /// `None` before the first picture. Then the colours of all triangles if the host shades, or `None` if the device
    /// does.
    pub(crate) host_colours: Option<Option<Arc<[Colour]>>>,
}

/// Queries of a step that are begun together.
#[derive(Clone, Copy)]
pub(crate) struct Batch<'a> {
    /// One for each query.
    pub(crate) ids: &'a [QueryId],
    pub(crate) queries: &'a [Query<'a>],
}

/// The location of a query's result.
pub(crate) struct Answer {
    pub(crate) query: QueryId,
    pub(crate) ticket: Ticket,
    /// Index among the queries of its submission.
    pub(crate) place: usize,
    rays: usize,
    kind: QueryKind,
    /// Hits, which are taken from the backend when they are first read.
    hits: Option<Hits>,
    /// Pixels, if the host shaded the picture.
    pub(crate) pixels: Option<Vec<u8>>,
}

impl Loaded {
    pub(crate) fn new(
        meshes: Vec<Mesh>,
        backend: Box<dyn Backend>,
        mut options: DriverOptions,
        builders: BuilderThreads,
    ) -> Result<Self> {
        check_memory(&meshes)?;
        let mut joined = Joined::of(meshes)?;
        let animation = Arc::clone(&joined.animation);
        // Key frames that arrive are numbered from 0 on, independent of the times of steps.
        options.time_range = if joined.is_streamed() {
            [0.0, f64::MAX]
        } else {
            options.time_range.map(|time| time.min(animation.end()))
        };
        let driver = Driver::new(backend, animation, options, builders.clone());
        let mut driver = driver.map_err(Error::of_driver)?;
        joined.prepare(driver.backend())?;
        Ok(Self {
            driver,
            joined,
            update: options.update,
            builders,
            traced_forms: Vec::new(),
            trees_before: 0,
            under_way: VecDeque::new(),
            results: VecDeque::new(),
            spares: Spares::default(),
            host_colours: None,
        })
    }

    pub(crate) fn has_tree(&self) -> bool {
        self.driver.generation().0 > 0
    }

    /// Returns a function that creates a backend for another scene on the same device, on any thread. Returns `None` if the
    /// device has to be opened again.
    pub(crate) fn share_device(&mut self) -> Option<OpenBackend> {
        let backend: &mut dyn Any = self.driver.backend();
        #[cfg(feature = "vulkan")]
        if let Some(vulkan) = backend.downcast_ref::<VulkanBackend>() {
            let open = vulkan.share_device();
            return Some(Box::new(move || Ok(Box::new(open()?))));
        }
        #[cfg(feature = "wgpu")]
        if let Some(wgpu) = backend.downcast_ref::<WgpuBackend>() {
            let open = wgpu.share_device();
            return Some(Box::new(move || Ok(Box::new(open()?))));
        }
        let _ = backend;
        None
    }

    /// Builds the first tree for `time`, and prepares everything that such queries need, by tracing one ray of each
    /// kind.
    pub(crate) fn warm_up(&mut self, time: f64, forms: &[QueryForm]) -> Result<()> {
        let ray = [Ray::new([0.0; 3], [0.0, 0.0, 1.0])];
        // The first tree is built for the first query.
        let list = [QueryForm {
            camera: None,
            kind: QueryKind::Closest,
        }];
        for form in if forms.is_empty() { &list } else { forms } {
            let kind = form.kind;
            let pixel = form.camera.map(|camera| Camera {
                width: 1,
                height: 1,
                ..camera
            });
            let rays = pixel.as_ref().map_or(Rays::List(&ray), Rays::Camera);
            self.submit(time, &[Query { rays, kind }])?;
            let finished = (self.driver).finish(Wanted::default(), &mut Answers::default());
            finished.map_err(Error::of_driver)?;
        }
        Ok(())
    }

    /// Continues from the state of `before`, a scene that differs in mesh `but` only.
    pub(crate) fn follow(&mut self, before: &mut Self, but: usize) -> Result<()> {
        self.joined.move_to(&before.settle()?, but);
        #[cfg(feature = "wgpu")]
        self.follow_on_device(before, but)?;
        #[cfg(feature = "vulkan")]
        self.follow_external(before, but)?;
        self.traced_forms.clone_from(&before.traced_forms);
        self.trees_before = before.trees_before + before.driver.generation().0;
        Ok(())
    }

    /// Returns the newest vertices of all meshes, including changes since the last query.
    fn settle(&mut self) -> Result<KeyFrame> {
        let time = self.joined.time;
        self.joined.push_changes(self.driver.backend(), time)?;
        self.joined.newest()
    }

    /// Submits queries, in one submission if the device can, and notes where their results will be.
    pub(crate) fn begin(
        &mut self,
        time: f64,
        batch: Batch<'_>,
        last: &mut Option<Statistics>,
    ) -> Result<()> {
        let Batch { ids, queries } = batch;
        if queries.len() > 1 && !self.driver.can_batch(queries) {
            let mut each = ids.chunks(1).zip(queries.chunks(1));
            return each
                .try_for_each(|(ids, queries)| self.begin(time, Batch { ids, queries }, last));
        }
        while self.under_way.len() >= self.driver.most_under_way(queries) {
            self.finish(last)?;
        }
        let started = self.start(time, queries).inspect_err(|_| {
            // Backends keep reports for a number of submissions, and a refused submission counts. So read all reports
            // now.
            let _ = self.finish_all(last);
        });
        let ticket = started?;
        let each = ids.iter().zip(queries).enumerate();
        let answers = each.map(|(place, (&id, query))| Answer {
            query: id,
            ticket,
            place,
            rays: query.rays.count(),
            kind: query.kind,
            hits: None,
            pixels: None,
        });
        self.results.extend(answers);
        self.retain_traces();
        Ok(())
    }

    /// Submits queries in one submission, without noting where their results will be.
    pub(crate) fn start(&mut self, time: f64, queries: &[Query<'_>]) -> Result<Ticket> {
        let ticket = self.submit(time, queries)?;
        queries.iter().for_each(|&query| self.note(query));
        self.under_way.push_back(ticket);
        Ok(ticket)
    }

    fn submit(&mut self, time: f64, queries: &[Query<'_>]) -> Result<Ticket> {
        #[cfg(feature = "wgpu")]
        self.give_up_dropped();
        #[cfg(any(feature = "vulkan", feature = "wgpu"))]
        {
            self.joined.on_device.check(&self.joined.meshes)?;
            self.release_points();
        }
        let backend = self.driver.backend();
        let time = self.joined.push_changes(backend, time)?;
        let begun = self.driver.begin(Frame { index: 0, time }, queries);
        let begun = begun.map_err(Error::of_driver);
        #[cfg(any(feature = "vulkan", feature = "wgpu"))]
        if is_failure(&begun) {
            self.joined.on_device.lose();
        }
        begun
    }

    /// Makes the device read vertices from the host again where they came from device memory before.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    fn release_points(&mut self) {
        let returned = self.joined.on_device.take_returned();
        #[cfg(feature = "vulkan")]
        if let Some(gpu) = self.vulkan() {
            returned.iter().for_each(|run| gpu.release_points(run));
        }
        #[cfg(feature = "wgpu")]
        if let Some(backend) = self.wgpu() {
            let gpu = backend.gpu_mut();
            returned.iter().for_each(|run| gpu.release_points(run));
        }
    }

    fn note(&mut self, query: Query<'_>) {
        let camera = match query.rays {
            Rays::Camera(camera) => Some(*camera),
            Rays::List(_) | Rays::OnDevice(_) => None,
        };
        let form = QueryForm {
            camera,
            kind: query.kind,
        };
        if !self.traced_forms.iter().any(|other| form.is_like(other)) {
            self.traced_forms.push(form);
        }
    }

    /// Waits for a submission.
    ///
    /// # Errors
    /// [`Error::NoResult`] if the program dropped the encoder that holds it.
    pub(crate) fn wait(&mut self, ticket: Ticket, last: &mut Option<Statistics>) -> Result<()> {
        #[cfg(feature = "wgpu")]
        self.give_up_dropped();
        if !self.results.iter().any(|answer| answer.ticket == ticket) {
            return Err(Error::NoResult);
        }
        while self.under_way.contains(&ticket) {
            self.finish(last)?;
        }
        Ok(())
    }

    /// Waits for all submissions.
    pub(crate) fn finish_all(&mut self, last: &mut Option<Statistics>) -> Result<()> {
        #[cfg(feature = "wgpu")]
        self.give_up_dropped();
        while !self.under_way.is_empty() {
            self.finish(last)?;
        }
        Ok(())
    }

    /// Waits for the oldest submission in flight.
    fn finish(&mut self, last: &mut Option<Statistics>) -> Result<()> {
        let finished = self.take(Wanted::default(), &mut Answers::default(), last);
        finished.map(drop)
    }

    /// Waits for the oldest submission in flight, and takes the results selected by `wanted`.
    pub(crate) fn take(
        &mut self,
        wanted: Wanted,
        answers: &mut Answers,
        last: &mut Option<Statistics>,
    ) -> Result<FrameRecord> {
        self.under_way.pop_front();
        let finished = self.driver.finish(wanted, answers);
        let record = finished.map_err(Error::of_driver)?.ok_or(Error::NoResult)?;
        let done = self.statistics(&record);
        // A submission of a former scene may be waited for after newer ones.
        if last.is_none_or(|l| l.generation <= done.generation) {
            *last = Some(done);
        }
        Ok(record)
    }

    fn statistics(&self, record: &FrameRecord) -> Statistics {
        Statistics {
            generation: self.trees_before + record.tree.generation.0,
            age: record.tree.age_frames,
            cost_ratio: record.tree.sah_ratio,
            building: self.driver.is_building(),
            inactive: record.report.inactive,
            degenerate: record.report.degenerate,
        }
    }

    /// Makes the backend retain the traces of all available results.
    fn retain_traces(&mut self) {
        let mut tickets: Vec<_> = self.results.iter().map(|answer| answer.ticket).collect();
        tickets.dedup();
        self.driver.backend().retain_traces(&tickets);
    }

    /// Waits for a result and returns a handle to its hits.
    pub(crate) fn hits(&mut self, at: usize, last: &mut Option<Statistics>) -> Result<Hits> {
        let &Answer {
            ticket,
            place,
            rays,
            kind,
            ref hits,
            ..
        } = &self.results[at];
        if let Some(hits) = hits {
            return Ok(hits.clone());
        }
        self.wait(ticket, last)?;
        let mut found = lock(&self.spares).take(rays, kind);
        let taken = (self.driver.backend()).take_hits(ticket, place, &mut found);
        taken.map_err(Error::of_backend)?;
        let hits = Hits::new(found, &self.joined.numbering, &self.spares);
        Ok(self.results[at].hits.insert(hits).clone())
    }

    /// Returns whether a result is available, so that reading it would not wait.
    pub(crate) fn is_done(&mut self, at: usize) -> Result<bool> {
        let answer = &self.results[at];
        match (&answer.hits, answer.ticket) {
            (Some(_), _) => Ok(true),
            (None, ticket) => {
                let is_done = self.driver.backend().is_done(ticket);
                is_done.map_err(Error::of_backend)
            }
        }
    }

    /// Drops the results of steps before `step`. Returns whether any results are left.
    pub(crate) fn keep_from(&mut self, step: u64) -> bool {
        self.retain(|of| of >= step);
        !self.results.is_empty()
    }

    /// Drops the results of one step, and frees memory that only they needed.
    pub(crate) fn drop_step(&mut self, step: StepId) {
        let before = self.results.len();
        self.retain(|of| of != step.0);
        if self.results.len() < before {
            lock(&self.spares).set_capacity(self.results.len());
        }
    }

    fn retain(&mut self, is_kept: impl Fn(u64) -> bool) {
        // The next steps are likely to have as many queries.
        lock(&self.spares).set_capacity(self.results.len());
        self.results.retain(|answer| is_kept(answer.query.step.0));
        self.retain_traces();
    }
}

/// Returns an error if the scene needs more memory than the system has, because a build cannot report a failed
/// allocation.
fn check_memory(meshes: &[Mesh]) -> Result<()> {
    let keys = meshes.iter().map(Mesh::joined_points).sum::<usize>();
    let triangles = meshes.iter().map(Mesh::triangle_count).sum::<usize>();
    let bytes = keys * size_of::<Point>() + triangles * size_of::<[u32; 3]>();
    let bytes = pipeline::trees_bytes(triangles, 0).saturating_add(bytes as u64);
    host::check(bytes).map_err(|e| Error::OutOfMemory(e.to_string()))
}

/// Returns whether a step failed in a way that leaves the vertices on the device undefined.
#[cfg(any(feature = "vulkan", feature = "wgpu"))]
fn is_failure<T>(begun: &Result<T>) -> bool {
    use Error::{Device, DeviceLost, Misuse, OutOfMemory};
    matches!(
        begun,
        Err(Device(_) | DeviceLost(_) | Misuse(_) | OutOfMemory(_))
    )
}

/// Returns the scene, current or former, in which a query was traced, and the index of its result there.
pub(crate) fn find<'t>(
    current: &'t mut Loaded,
    former: &'t mut [Loaded],
    step: StepId,
    query: QueryId,
) -> Result<(&'t mut Loaded, usize)> {
    let is_asked = |answer: &Answer| answer.query == query && query.step == step;
    let mut all = std::iter::once(current).chain(former);
    let found = all.find_map(|loaded| {
        let at = loaded.results.iter().position(is_asked)?;
        Some((loaded, at))
    });
    found.ok_or(Error::NoResult)
}

#[cfg(test)]
mod tests {
    use crate::{Camera, Device, Scene, Tracer};

    #[test]
    fn render_lights_share_one_query_kind() {
        let tracer = Tracer::builder().device(Device::Cpu).threads(1);
        let mut tracer = tracer.build(Scene::new()).unwrap();
        let eye = [0.0, 0.0, 3.0];
        let camera = Camera::look_at(eye, [0.0; 3], [0.0, 1.0, 0.0], 50.0, [2, 2]).unwrap();
        for i in 0..3 {
            let mut step = tracer.step(0.0);
            step.render(&camera, [i as f32, 1.0, 0.0]).unwrap();
            step.submit().unwrap();
        }
        assert_eq!(tracer.state().current.traced_forms.len(), 1);
    }
}
