//! A scene loaded on a device, with its trees, submissions and results.

use crate::backends::find_backend;
use crate::hits::SharedHitsPool;
use crate::joined::{JoinedScene, key_count};
use crate::mesh::Colour;
use crate::query::{QueryId, StepId};
use crate::{Error, Hits, Mesh, Point, Ray, Result, Statistics, Update};
use backend::{Backend, Query, QueryKind, Rays, Ticket};
use geom::{Camera, KeyFrame, lock};
#[cfg(feature = "vulkan")]
use gpu_vulkan::{VulkanBackend, VulkanDevice};
#[cfg(feature = "wgpu")]
use gpu_wgpu::WgpuBackend;
use pipeline::{
    BuilderThreads, Driver, DriverOptions, Frame, FrameOutputs, FrameRecord, OutputSelection,
};
#[cfg(any(feature = "vulkan", feature = "wgpu"))]
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

/// Function that creates a backend, on any thread. A backend that computes on the host uses the given number of
/// threads.
type OpenBackend = Box<dyn FnOnce(usize) -> Result<Box<dyn Backend>> + Send>;

/// A scene on a device, with the results of its queries.
pub(crate) struct ResidentScene {
    pub(crate) driver: Driver,
    pub(crate) joined: JoinedScene,
    pub(crate) update: Update,
    pub(crate) builder_threads: BuilderThreads,
    /// Forms of the queries traced so far, one for each set of kernels.
    pub(crate) traced_forms: Vec<QueryForm>,
    /// Whether the scene replaced another one and no step has traced it yet. The device's positions may then be older
    /// than those of the meshes.
    #[cfg(feature = "wgpu")]
    pub(crate) is_stale: bool,
    /// Number of trees of the scenes before this one.
    trees_before: u64,
    /// Statistics after the last finished query of this scene or of an earlier one.
    pub(crate) last: Option<Statistics>,
    /// Results that are available, oldest first.
    pub(crate) results: VecDeque<QueryResult>,
    /// Memory of hits whose handles were all dropped.
    pool: SharedHitsPool,
    /// Colours of all triangles, if the host shades. The outer `None` means that no picture was rendered yet, the inner
    /// `None` that the device shades.
    pub(crate) host_colours: Option<Option<Arc<[Colour]>>>,
}

/// The location of a query's result.
pub(crate) struct QueryResult {
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

impl ResidentScene {
    pub(crate) fn new(
        meshes: Vec<Mesh>,
        backend: Box<dyn Backend>,
        mut options: DriverOptions,
        builder_threads: BuilderThreads,
    ) -> Result<Self> {
        check_memory(&meshes)?;
        let mut joined = JoinedScene::of(meshes)?;
        let animation = Arc::clone(&joined.animation);
        // Key frames of a streamed scene are numbered from 0 on, independently of the times of steps.
        options.time_range = if joined.is_streamed() {
            [0.0, f64::MAX]
        } else {
            options.time_range.map(|time| time.min(animation.end()))
        };
        let driver = Driver::new(backend, animation, options, builder_threads.clone());
        let mut driver = driver.map_err(Error::of_driver)?;
        joined.prepare(driver.backend())?;
        Ok(Self {
            driver,
            joined,
            update: options.update,
            builder_threads,
            traced_forms: Vec::new(),
            #[cfg(feature = "wgpu")]
            is_stale: false,
            trees_before: 0,
            last: None,
            results: VecDeque::new(),
            pool: SharedHitsPool::default(),
            host_colours: None,
        })
    }

    /// Returns the backend if its type is `B`.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    fn backend_as<B: Backend>(&mut self) -> Option<&mut B> {
        let backend: &mut dyn Any = self.driver.backend();
        backend.downcast_mut()
    }

    /// Returns the device if it is one of Vulkan's.
    #[cfg(feature = "vulkan")]
    pub(crate) fn vulkan(&mut self) -> Option<&mut VulkanDevice> {
        self.backend_as().map(VulkanBackend::gpu_mut)
    }

    /// Returns the backend if its device is one of wgpu's.
    #[cfg(feature = "wgpu")]
    pub(crate) fn wgpu(&mut self) -> Option<&mut WgpuBackend> {
        self.backend_as()
    }

    pub(crate) fn has_tree(&self) -> bool {
        self.driver.generation().0 > 0
    }

    /// Returns a function that creates a backend for another scene on the same device, on any thread.
    pub(crate) fn share_device(&mut self) -> OpenBackend {
        #[cfg(feature = "vulkan")]
        if let Some(vulkan) = self.backend_as::<VulkanBackend>() {
            let open = vulkan.share_device();
            return Box::new(move |_| Ok(Box::new(open().map_err(Error::of_backend)?)));
        }
        #[cfg(feature = "wgpu")]
        if let Some(wgpu) = self.backend_as::<WgpuBackend>() {
            let open = wgpu.share_device();
            return Box::new(move |_| Ok(Box::new(open().map_err(Error::of_backend)?)));
        }
        let name = self.driver.backend().device().backend;
        Box::new(move |threads| {
            let entry = name.parse().ok().and_then(find_backend);
            let absent = || Error::NoDevice(format!("backend {name} cannot be opened again"));
            let opened = entry.ok_or_else(absent)?.open(None, threads);
            opened.map_err(Error::NoDevice)
        })
    }

    /// Builds the first tree for `time`. Prepares everything that queries of these forms need, by tracing one ray of
    /// each.
    pub(crate) fn warm_up(&mut self, time: f64, forms: &[QueryForm]) -> Result<()> {
        let ray = [Ray::new([0.0; 3], [0.0, 0.0, 1.0])];
        // Without forms, traces one ray, because only a query builds the first tree.
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
            self.submit_to_driver(time, &[Query { rays, kind }])?;
            let finished =
                (self.driver).finish(OutputSelection::default(), &mut FrameOutputs::default());
            finished.map_err(Error::of_driver)?;
        }
        Ok(())
    }

    /// Continues from the state of `before`, a scene that differs in mesh `replaced` only.
    pub(crate) fn follow(&mut self, before: &mut Self, replaced: usize) -> Result<()> {
        self.joined
            .copy_moved_from(&before.newest_vertices()?, replaced);
        #[cfg(feature = "wgpu")]
        {
            self.is_stale = true;
            self.take_wgpu_vertices(before, replaced)?;
        }
        #[cfg(feature = "vulkan")]
        self.take_external_vertices(before, replaced)?;
        self.traced_forms.clone_from(&before.traced_forms);
        self.trees_before = before.trees_before + before.driver.generation().0;
        self.last = before.last;
        Ok(())
    }

    /// Returns the newest vertices of all meshes, including changes since the last query.
    fn newest_vertices(&mut self) -> Result<KeyFrame> {
        let time = self.joined.time;
        self.joined.push_changes(self.driver.backend(), time)?;
        self.joined.newest()
    }

    /// Submits queries, in one submission if the device can, and records where their results will be. `ids` has one
    /// entry per query.
    pub(crate) fn submit_and_record_results(
        &mut self,
        time: f64,
        ids: &[QueryId],
        queries: &[Query<'_>],
    ) -> Result<()> {
        if queries.len() > 1 && !self.driver.can_batch(queries) {
            let mut each = ids.chunks(1).zip(queries.chunks(1));
            return each
                .try_for_each(|(ids, queries)| self.submit_and_record_results(time, ids, queries));
        }
        // The wait below would fail for a step whose encoder was dropped.
        #[cfg(feature = "wgpu")]
        self.abandon_dropped();
        while self.driver.in_flight().len() >= self.driver.max_in_flight(queries) {
            self.finish()?;
        }
        let submitted = self.submit(time, queries).inspect_err(|_| {
            // A backend keeps the report of a submission only for a limited number of later submissions, and refused
            // ones count too. So wait for all submissions now, before their reports are dropped.
            let _ = self.finish_all();
        });
        let ticket = submitted?;
        let each = ids.iter().zip(queries).enumerate();
        let results = each.map(|(place, (&id, query))| QueryResult {
            query: id,
            ticket,
            place,
            rays: query.rays.count(),
            kind: query.kind,
            hits: None,
            pixels: None,
        });
        self.results.extend(results);
        self.retain_traces();
        Ok(())
    }

    /// Submits queries in one submission and notes their forms. Does not record where their results will be.
    pub(crate) fn submit(&mut self, time: f64, queries: &[Query<'_>]) -> Result<Ticket> {
        let ticket = self.submit_to_driver(time, queries)?;
        #[cfg(feature = "wgpu")]
        {
            self.is_stale = false;
        }
        queries.iter().for_each(|&query| self.note(query));
        Ok(ticket)
    }

    /// Passes the changes of meshes to the driver and submits queries.
    fn submit_to_driver(&mut self, time: f64, queries: &[Query<'_>]) -> Result<Ticket> {
        #[cfg(feature = "wgpu")]
        self.finish_encoded()?;
        #[cfg(any(feature = "vulkan", feature = "wgpu"))]
        {
            self.joined.on_device.check(&self.joined.meshes)?;
            self.release_points();
        }
        let backend = self.driver.backend();
        let time = self.joined.push_changes(backend, time)?;
        let begun = self.driver.begin(Frame { index: 0, time }, queries);
        let begun = begun.map_err(Error::of_driver);
        // After these errors, the vertices on the device are undefined.
        #[cfg(any(feature = "vulkan", feature = "wgpu"))]
        if let Err(
            Error::Device(_) | Error::DeviceLost(_) | Error::Misuse(_) | Error::OutOfMemory(_),
        ) = begun
        {
            self.joined.on_device.mark_lost();
        }
        begun
    }

    /// Makes the device read vertices from the host again, for meshes whose vertices came from device memory before.
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

    /// Adds the form of a query to `traced_forms`, if it is new.
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
    pub(crate) fn wait(&mut self, ticket: Ticket) -> Result<()> {
        #[cfg(feature = "wgpu")]
        self.abandon_dropped();
        if !self.results.iter().any(|result| result.ticket == ticket) {
            return Err(Error::NoResult);
        }
        while self.driver.in_flight().any(|other| other == ticket) {
            self.finish()?;
        }
        Ok(())
    }

    /// Waits for all submissions.
    pub(crate) fn finish_all(&mut self) -> Result<()> {
        #[cfg(feature = "wgpu")]
        self.abandon_dropped();
        while self.driver.in_flight().next().is_some() {
            self.finish()?;
        }
        Ok(())
    }

    /// Waits for the oldest submission in flight.
    fn finish(&mut self) -> Result<()> {
        let finished = self.take(OutputSelection::default(), &mut FrameOutputs::default());
        finished.map(drop)
    }

    /// Waits for the oldest submission in flight, and takes the selected results.
    pub(crate) fn take(
        &mut self,
        selection: OutputSelection,
        outputs: &mut FrameOutputs,
    ) -> Result<FrameRecord> {
        let finished = self.driver.finish(selection, outputs);
        let record = finished.map_err(Error::of_driver)?.ok_or(Error::NoResult)?;
        self.last = Some(self.statistics(&record));
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

    /// Makes the backend retain the hits and pictures of all `results`.
    fn retain_traces(&mut self) {
        let mut tickets: Vec<_> = self.results.iter().map(|result| result.ticket).collect();
        tickets.dedup();
        self.driver.backend().retain_traces(&tickets);
    }

    /// Waits for a result and returns a handle to its hits.
    pub(crate) fn hits(&mut self, at: usize) -> Result<Hits> {
        let &QueryResult {
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
        self.wait(ticket)?;
        let mut found = lock(&self.pool).take(rays, kind);
        let taken = (self.driver.backend()).take_hits(ticket, place, &mut found);
        taken.map_err(Error::of_backend)?;
        let hits = Hits::new(found, &self.joined.numbering, &self.pool);
        Ok(self.results[at].hits.insert(hits).clone())
    }

    /// Returns whether a result is available, so that reading it would not wait.
    pub(crate) fn is_done(&mut self, at: usize) -> Result<bool> {
        let result = &self.results[at];
        let ticket = result.ticket;
        if result.hits.is_some() {
            return Ok(true);
        }
        let is_done = self.driver.backend().is_done(ticket);
        is_done.map_err(Error::of_backend)
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
            lock(&self.pool).set_capacity(self.results.len());
        }
    }

    fn retain(&mut self, is_kept: impl Fn(u64) -> bool) {
        // The next steps are likely to have as many queries.
        lock(&self.pool).set_capacity(self.results.len());
        self.results.retain(|result| is_kept(result.query.step.0));
        self.retain_traces();
    }
}

#[cfg(feature = "wgpu")]
pub(crate) fn no_wgpu() -> Error {
    Error::Unsupported("this needs a wgpu device".into())
}

/// Returns an error if the scene needs more memory than the system has, because a build cannot report a failed
/// allocation.
fn check_memory(meshes: &[Mesh]) -> Result<()> {
    let vertices = meshes.iter().map(Mesh::vertex_count).sum::<usize>();
    let triangles = meshes.iter().map(Mesh::triangle_count).sum::<usize>();
    let points = key_count(meshes).saturating_mul(vertices);
    let bytes = points.saturating_mul(size_of::<Point>()) as u64;
    let bytes = bytes.saturating_add((triangles * size_of::<[u32; 3]>()) as u64);
    let bytes = bytes.saturating_add(pipeline::trees_and_rays_bytes(triangles, 0));
    host::check_memory(bytes).map_err(|e| Error::OutOfMemory(e.to_string()))
}

#[cfg(test)]
mod tests {
    use crate::{Camera, CameraPose, Device, Scene, Tracer};

    #[test]
    fn pictures_with_different_lights_share_one_form() {
        let tracer = Tracer::builder().device(Device::Cpu).threads(1);
        let mut tracer = tracer.build(Scene::new()).unwrap();
        let pose = CameraPose::new([0.0, 0.0, 3.0], [0.0; 3]);
        let camera = Camera::look_at(pose, [2, 2]).unwrap();
        for i in 0..3 {
            let mut step = tracer.step(0.0);
            step.render(&camera, [i as f32, 1.0, 0.0]).unwrap();
            step.submit().unwrap();
        }
        assert_eq!(tracer.state().current.traced_forms.len(), 1);
    }
}
