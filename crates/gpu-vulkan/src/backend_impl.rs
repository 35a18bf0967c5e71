//! The seam, carried out.

use crate::device::Gpu;
use crate::encode::{Groups, Part, dispatch, timeline};
use crate::errors::failed;
use crate::instance::{Adapter, Host};
use crate::memory::{Buffer, Place};
use crate::method;
use crate::pipelines::Pipelines;
use crate::scene::{SceneBuffers, within};
use crate::selftest;
use crate::slot::{Slot, Stage};
use crate::snapshots::{Snapshots, UnderWay};
use crate::transfer::{Transfer, wait_for};
use crate::tree::TreeBuffers;
use ash::vk;
use backend::{
    Backend, BackendError, Device, FRAMES_IN_FLIGHT, FrameReport, Generation, Hits, Inspect,
    Method, Query, Rays, Result, Seek, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Hit, Point, Pose, Ray};
use shaders::Params;
use std::collections::VecDeque;
use std::sync::{Arc, PoisonError};

/// How to open the backend.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// A device's index or a part of its name; the first GPU, else the first device, if not given.
    pub adapter: Option<String>,
    /// Runs under the Vulkan validation layer with synchronisation validation.
    pub validation: bool,
}

/// Submissions whose reports are remembered.
const REPORTS: usize = 16;

/// The backend that computes through Vulkan.
pub struct VulkanBackend {
    device: Device,
    timeline: vk::Semaphore,
    submitted: u64,
    slots: Vec<Slot>,
    /// The slot being recorded, if any.
    recording: Option<usize>,
    traces: VecDeque<Trace>,
    pending_trace: Option<Trace>,
    reports: VecDeque<(Ticket, FrameReport)>,
    transfer: Transfer,
    snapshots: Snapshots,
    request: bool,
    scene: Option<SceneBuffers>,
    tree: Option<TreeBuffers>,
    /// Which of the two position buffers is current.
    position: usize,
    alpha: f32,
    stale: Stale,
    expanded: bool,
    /// Inactive and degenerate triangles at the last preprocess.
    counts: (u64, u64),
    pipelines: Pipelines,
    gpu: Arc<Gpu>,
}

/// What must run before a trace.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Stale {
    Positions,
    Records,
    Boxes,
    Fresh,
}

/// The output of one trace.
struct Trace {
    ticket: Ticket,
    count: usize,
    seek: Seek,
    hits: Buffer,
    blocked: Buffer,
    rays: Option<Buffer>,
}

impl VulkanBackend {
    /// Opens a device.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] with the reason.
    pub fn new(options: &Options) -> Result<Self> {
        let host = Host::new(options.validation)?;
        let gpu = Gpu::open(host, |list| choose(list, options.adapter.as_deref()))?;
        let device = Device {
            backend: "vulkan",
            adapter: gpu.adapter.name.clone(),
            driver: gpu.adapter.driver.clone(),
            kind: gpu.adapter.kind,
            threads: 0,
        };
        let slots = (0..4)
            .map(|_| Slot::new(&gpu))
            .collect::<Result<Vec<_>>>()?;
        let mut made = Self {
            device,
            timeline: timeline(&gpu)?,
            submitted: 0,
            slots,
            recording: None,
            traces: VecDeque::new(),
            pending_trace: None,
            reports: VecDeque::new(),
            transfer: Transfer::new(&gpu)?,
            snapshots: Snapshots::new(),
            request: false,
            scene: None,
            tree: None,
            position: 0,
            alpha: 0.0,
            stale: Stale::Positions,
            expanded: false,
            counts: (0, 0),
            pipelines: Pipelines::new(&gpu)?,
            gpu,
        };
        made.test_arithmetic()?;
        Ok(made)
    }

    fn test_arithmetic(&mut self) -> Result<()> {
        self.submitted += 1;
        let (gpu, timeline, value) = (&self.gpu, self.timeline, self.submitted);
        let submit = |commands| {
            submit(gpu, commands, None, (timeline, value))?;
            Ok((timeline, value))
        };
        selftest::run(
            gpu,
            &mut self.slots[0],
            &self.pipelines,
            &mut self.transfer,
            submit,
        )
    }

    /// What the validation layer has said so far.
    #[must_use]
    pub fn validation_messages(&self) -> Vec<String> {
        self.gpu
            .host
            .messages
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    fn scene(&self) -> &SceneBuffers {
        self.scene.as_ref().expect("a scene was loaded")
    }

    fn tree(&self) -> &TreeBuffers {
        self.tree.as_ref().expect("a scene was loaded")
    }

    /// The slot being recorded, begun if need be.
    fn record(&mut self) -> Result<usize> {
        if let Some(i) = self.recording {
            return Ok(i);
        }
        let i = self.submitted as usize % self.slots.len();
        if let Some(ticket) = self.slots[i].ticket {
            self.retire(ticket)?;
        }
        self.slots[i].begin()?;
        self.recording = Some(i);
        Ok(i)
    }

    /// Waits for a submission and remembers its report.
    fn retire(&mut self, ticket: Ticket) -> Result<()> {
        if self.reports.iter().any(|(t, _)| *t == ticket) {
            return Ok(());
        }
        wait_for(&self.gpu, self.timeline, ticket.0)?;
        let slot = self.slots.iter().find(|s| s.ticket == Some(ticket));
        let slot = slot.expect("this ticket was never given, or was given too long ago");
        let (mut report, counts) = slot.report()?;
        if report.times.preprocess_ms.is_some() {
            let scene = self.scene();
            let never = scene.animation.triangle_count() - scene.animation.live_count();
            self.counts = (u64::from(counts[0]) + never as u64, u64::from(counts[1]));
        }
        (report.inactive, report.degenerate) = self.counts;
        if self.reports.len() == REPORTS {
            self.reports.pop_front();
        }
        self.reports.push_back((ticket, report));
        Ok(())
    }

    fn params(&self) -> Params {
        let tree = self.tree();
        let k = self.scene().scale_exponent;
        Params {
            alpha: self.alpha,
            scale: f32::from_bits(((127 - k) as u32) << 23),
            scale_exponent: k,
            leaf_bits_at: tree.parts.leaf_bits,
            leaf_ranks_at: tree.parts.leaf_ranks,
            leaf_triangles_at: tree.parts.leaf_triangles,
            node_count: tree.node_count,
            ..Params::default()
        }
    }

    /// Records one kernel; its buffers are found by their names in the kernel.
    fn run(&mut self, kernel: &str, params: &Params, groups: Groups, also: Also<'_>) -> Result<()> {
        let slot = self.record()?;
        let counts = Part::from(&self.slots[slot].counts);
        let (scene, tree) = (self.scene.as_ref(), self.tree.as_ref());
        let (scene, tree) = (
            scene.expect("a scene was loaded"),
            tree.expect("a scene was loaded"),
        );
        let position = self.position;
        let find = |name: &'static str| match name {
            "counts" => counts,
            "earlier" => scene.key(also.key),
            "later" => scene.key(also.key + 1),
            "positions" => (&scene.positions[position]).into(),
            "triangles" => (&scene.triangles).into(),
            "topology" => tree.topology().into(),
            "leaf_nodes" => (&tree.leaf_nodes).into(),
            "inner_nodes" => (&tree.inner_nodes).into(),
            "records" => (&tree.triangles).into(),
            "nodes" => (&tree.nodes).into(),
            "costs" => (&tree.costs).into(),
            "hits" => (&also.trace.expect("a trace").hits).into(),
            "blocked" => (&also.trace.expect("a trace").blocked).into(),
            "rays" => also
                .trace
                .and_then(|t| t.rays.as_ref())
                .expect("given rays")
                .into(),
            other => panic!("no buffer named {other}"),
        };
        let pipeline = self.pipelines.get(kernel);
        dispatch(
            &self.gpu,
            &mut self.slots[slot],
            pipeline,
            params,
            groups,
            find,
        )
    }

    fn barrier(&self) {
        if let Some(i) = self.recording {
            self.slots[i].compute_barrier();
        }
    }

    fn end_stage(&mut self, stage: Stage) {
        self.barrier();
        if let Some(i) = self.recording {
            self.slots[i].end_stage(stage);
        }
    }

    /// The lists of a tree just adopted.
    fn expand(&mut self) -> Result<()> {
        if !self.expanded {
            let params = self.params();
            self.run(
                "expand",
                &params,
                Groups::Linear(params.node_count),
                Also::default(),
            )?;
            self.barrier();
            self.expanded = true;
        }
        Ok(())
    }

    /// Buffers for a trace of `query`, taken from the oldest trace if they fit.
    fn trace_buffers(&mut self, query: &Query<'_>) -> Result<Trace> {
        let count = query.rays.count();
        within(&self.gpu, "the hits", count as u64 * 16)?;
        let old = if self.traces.len() > FRAMES_IN_FLIGHT {
            self.traces.pop_front()
        } else {
            None
        };
        if let Some(old) = &old {
            self.retire(old.ticket)?;
        }
        let fits = |b: &Buffer, bytes: usize| b.bytes >= bytes as u64;
        let reusable = old.filter(|o| fits(&o.hits, count * 16) && fits(&o.blocked, count * 4));
        let (hits, blocked, spare) = match reusable {
            Some(o) => (o.hits, o.blocked, o.rays),
            None => (
                Buffer::new(&self.gpu, "hits", count as u64 * 16, Place::Device)?,
                Buffer::new(&self.gpu, "shadows", count as u64 * 4, Place::Device)?,
                None,
            ),
        };
        let rays = match query.rays {
            Rays::Camera(_) => None,
            Rays::List(list) => Some(self.upload_rays(list, spare)?),
        };
        Ok(Trace {
            ticket: Ticket(0),
            count,
            seek: query.seek,
            hits,
            blocked,
            rays,
        })
    }

    fn upload_rays(&self, list: &[Ray], spare: Option<Buffer>) -> Result<Buffer> {
        let bytes = list.len() as u64 * 32;
        within(&self.gpu, "the rays", bytes)?;
        let mut buffer = match spare.filter(|b| b.bytes >= bytes) {
            Some(buffer) => buffer,
            None => Buffer::new(&self.gpu, "rays", bytes, Place::Upload)?,
        };
        // A direction of zero marks a ray that hits nothing.
        let void = Ray {
            direction: [0.0; 3],
            ..Ray::new([0.0; 3], [0.0; 3])
        };
        let rows: Vec<Ray> = list
            .iter()
            .map(|r| if r.is_valid() { *r } else { void })
            .collect();
        buffer.write(0, &rows);
        Ok(buffer)
    }

    fn primary(&mut self, query: &Query<'_>, trace: &Trace) -> Result<()> {
        let mut params = self.params();
        let also = Also {
            trace: Some(trace),
            key: 0,
        };
        let kernel = match (query.rays, query.seek) {
            (Rays::Camera(camera), Seek::Closest | Seek::ClosestAndShadow { .. }) => {
                set_camera(&mut params, camera);
                let groups = Groups::Pixels(camera.width, camera.height);
                return self.run("trace_camera", &params, groups, also);
            }
            (Rays::List(_), Seek::Any) => "any_rays",
            (Rays::List(_), _) => "trace_rays",
            (Rays::Camera(_), Seek::Any) => {
                let what = "any-hit of camera rays".to_owned();
                return Err(BackendError::Unsupported {
                    backend: "vulkan",
                    what,
                });
            }
        };
        params.count = trace.count as u32;
        self.run(kernel, &params, Groups::Linear(params.count), also)
    }

    fn shadow(&mut self, query: &Query<'_>, light: Point, trace: &Trace) -> Result<()> {
        let mut params = self.params();
        params.light = light;
        let also = Also {
            trace: Some(trace),
            key: 0,
        };
        match query.rays {
            Rays::Camera(camera) => {
                set_camera(&mut params, camera);
                self.run(
                    "shadow_camera",
                    &params,
                    Groups::Pixels(camera.width, camera.height),
                    also,
                )
            }
            Rays::List(_) => {
                params.count = trace.count as u32;
                self.run("shadow_rays", &params, Groups::Linear(params.count), also)
            }
        }
    }

    /// Copies a device buffer to the host, waiting for it.
    fn fetch<T: bytemuck::Pod>(&mut self, from: &Buffer, count: usize) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        let to = Buffer::new(&self.gpu, "a view for the host", bytes, Place::Readback)?;
        let done = self.transfer.copy(from, &to, bytes, None)?;
        self.transfer.wait(done)?;
        Ok(to.read::<T>(count).to_vec())
    }
}

/// Buffers that belong to one dispatch.
#[derive(Clone, Copy, Default)]
struct Also<'a> {
    trace: Option<&'a Trace>,
    key: u32,
}

fn set_camera(params: &mut Params, camera: &geom::Camera) {
    params.eye = camera.eye;
    params.corner = camera.corner;
    params.across = camera.across;
    params.down = camera.down;
    params.width = camera.width;
    params.height = camera.height;
}

/// The adapter asked for by index or part of its name; else the first GPU, else the first of all.
fn choose(list: &[Adapter], wanted: Option<&str>) -> Result<usize> {
    let Some(wanted) = wanted else {
        let gpu = list.iter().position(|a| a.kind == backend::DeviceKind::Gpu);
        return Ok(gpu.unwrap_or(0));
    };
    let by_index = wanted.parse::<usize>().ok().filter(|&i| i < list.len());
    let lower = wanted.to_lowercase();
    let by_name = || {
        list.iter()
            .position(|a| a.name.to_lowercase().contains(&lower))
    };
    by_index.or_else(by_name).ok_or_else(|| {
        let names: Vec<_> = list
            .iter()
            .map(|a| format!("{} {}", a.index, a.name))
            .collect();
        BackendError::NoDevice(format!("no adapter '{wanted}' among: {}", names.join(", ")))
    })
}

impl Backend for VulkanBackend {
    fn device(&self) -> &Device {
        &self.device
    }

    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()> {
        method::check(method)?;
        self.gpu.wait_idle()?;
        (self.scene, self.tree, self.pending_trace) = (None, None, None);
        self.traces.clear();
        // What was under way or recorded belongs to the scene before.
        (self.recording, self.request, self.snapshots.under_way) = (None, false, None);
        self.slots.iter_mut().for_each(|slot| slot.ticket = None);
        self.reports.clear();
        self.tree = Some(TreeBuffers::new(&self.gpu, &animation)?);
        self.scene = Some(SceneBuffers::new(&self.gpu, &mut self.transfer, animation)?);
        self.stale = Stale::Positions;
        Ok(())
    }

    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        let current = self.tree();
        assert!(generation > current.generation, "generations rise");
        assert!(
            self.recording.is_none(),
            "trees are adopted between submissions"
        );
        if let Some(ticket) = current.spare_used_by() {
            wait_for(&self.gpu, self.timeline, ticket.0)?;
        }
        let current = self.tree.as_mut().expect("a scene was loaded");
        current.adopt(&self.gpu, &mut self.transfer, tree, generation)?;
        self.expanded = false;
        self.stale = self.stale.min(Stale::Records);
        Ok(())
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        // The buffer that is on its way to the builder is left alone until it has arrived.
        if let Some(u) = &self.snapshots.under_way
            && !self.transfer.is_done(u.done_at)?
            && u.position == self.position
        {
            self.position = 1 - self.position;
        }
        self.alpha = pose.alpha;
        let mut params = self.params();
        params.count = (self.scene().animation.vertex_count() * 3).div_ceil(4) as u32;
        let also = Also {
            trace: None,
            key: pose.key,
        };
        self.run("interpolate", &params, Groups::Linear(params.count), also)?;
        self.end_stage(Stage::Interpolate);
        self.stale = Stale::Records;
        Ok(())
    }

    fn preprocess(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Records, "positions come first");
        assert!(self.tree().generation > Generation(0), "a tree comes first");
        self.expand()?;
        let mut params = self.params();
        params.count = self.tree().leaf_count;
        self.run(
            "preprocess",
            &params,
            Groups::Linear(params.count),
            Also::default(),
        )?;
        self.end_stage(Stage::Preprocess);
        self.stale = Stale::Boxes;
        Ok(())
    }

    fn refit(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Boxes, "boxes of leaves come first");
        let levels: Vec<_> = self
            .tree()
            .levels
            .iter()
            .rev()
            .map(|l| l.inner.clone())
            .collect();
        for inner in levels.into_iter().filter(|r| !r.is_empty()) {
            let mut params = self.params();
            params.first = inner.start;
            params.count = inner.len() as u32;
            self.run(
                "refit",
                &params,
                Groups::Linear(params.count),
                Also::default(),
            )?;
            self.barrier();
        }
        self.end_stage(Stage::Refit);
        self.stale = Stale::Fresh;
        Ok(())
    }

    fn trace(&mut self, query: Query<'_>) -> Result<()> {
        assert!(
            self.stale == Stale::Fresh,
            "a stale tree must not be traced"
        );
        assert!(self.pending_trace.is_none(), "one trace a submission");
        let trace = self.trace_buffers(&query)?;
        self.record()?;
        if self.tree().leaf_count == 0 {
            self.fill_misses(&trace)?;
        } else {
            self.primary(&query, &trace)?;
        }
        self.end_stage(Stage::TracePrimary);
        if let Seek::ClosestAndShadow { light } = query.seek {
            if self.tree().leaf_count > 0 {
                self.shadow(&query, light, &trace)?;
            }
            self.end_stage(Stage::TraceShadow);
        }
        self.pending_trace = Some(trace);
        Ok(())
    }

    fn request_positions(&mut self) -> Result<()> {
        assert!(self.stale >= Stale::Records, "positions come first");
        assert!(self.snapshots.under_way.is_none(), "one request at a time");
        self.record()?;
        self.request = true;
        Ok(())
    }

    fn submit(&mut self) -> Result<Ticket> {
        let i = self.record()?;
        self.slots[i].end()?;
        self.recording = None;
        self.submitted += 1;
        let ticket = Ticket(self.submitted);
        let arriving = self.tree.as_mut().and_then(|t| t.arriving.take());
        let arriving = arriving.map(|value| (self.transfer.done, value));
        submit(
            &self.gpu,
            self.slots[i].commands,
            arriving,
            (self.timeline, ticket.0),
        )?;
        self.slots[i].ticket = Some(ticket);
        if let Some(mut trace) = self.pending_trace.take() {
            trace.ticket = ticket;
            self.traces.push_back(trace);
        }
        if let Some(tree) = self.tree.as_mut() {
            tree.use_by(ticket);
        }
        if std::mem::take(&mut self.request) {
            self.send_positions(ticket, i)?;
        }
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        self.retire(ticket)?;
        let found = self.reports.iter().find(|(t, _)| *t == ticket);
        Ok(found.expect("retired just now").1.clone())
    }

    fn hits(&mut self, ticket: Ticket, out: &mut Hits) -> Result<()> {
        self.retire(ticket)?;
        let i = self.traces.iter().position(|t| t.ticket == ticket);
        let i = i.expect("this submission had no trace, or was too long ago");
        let trace = self.traces.remove(i).expect("found just now");
        let result = self.fetch_hits(&trace, out);
        self.traces.insert(i, trace);
        result
    }

    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        let Some(u) = &self.snapshots.under_way else {
            return Ok(None);
        };
        if !self.transfer.is_done(u.done_at)? {
            return Ok(None);
        }
        let vertices = self.scene().animation.vertex_count();
        let UnderWay { ticket, buffer, .. } =
            self.snapshots.under_way.take().expect("seen just now");
        Ok(Some((ticket, self.snapshots.give_out(buffer, vertices))))
    }

    fn inspect(&mut self) -> &mut dyn Inspect {
        self
    }
}

impl VulkanBackend {
    /// Sends the positions that `ticket` wrote to the host, on the transfer queue.
    fn send_positions(&mut self, ticket: Ticket, slot: usize) -> Result<()> {
        let bytes = (self.scene().animation.vertex_count() * 12) as u64;
        let buffer = self.snapshots.buffer(&self.gpu, bytes)?;
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let from = &scene.positions[self.position];
        let after = Some((self.timeline, ticket.0));
        let done_at = self.transfer.copy(from, &buffer, bytes, after)?;
        let position = self.position;
        self.snapshots.under_way = Some(UnderWay {
            ticket,
            buffer,
            done_at,
            position,
        });
        self.slots[slot].readback_bytes = bytes;
        Ok(())
    }

    /// An empty tree has no node to trace: every ray misses.
    fn fill_misses(&mut self, trace: &Trace) -> Result<()> {
        let misses = vec![Hit::MISS; trace.count];
        let lit = vec![0_u32; trace.count];
        let mut window = Buffer::new(&self.gpu, "misses", trace.hits.bytes, Place::Upload)?;
        window.write(0, &misses);
        let done = self
            .transfer
            .copy(&window, &trace.hits, trace.count as u64 * 16, None)?;
        self.transfer.wait(done)?;
        window.write(0, &lit);
        let done = self
            .transfer
            .copy(&window, &trace.blocked, trace.count as u64 * 4, None)?;
        self.transfer.wait(done)
    }

    fn fetch_hits(&mut self, trace: &Trace, out: &mut Hits) -> Result<()> {
        out.closest.clear();
        out.blocked.clear();
        if trace.seek != Seek::Any {
            out.closest = self.fetch(&trace.hits, trace.count)?;
        }
        if trace.seek != Seek::Closest {
            let blocked: Vec<u32> = self.fetch(&trace.blocked, trace.count)?;
            out.blocked.extend(blocked.iter().map(|&b| b as u8));
        }
        Ok(())
    }
}

/// Submits to the compute queue: after one timeline's value, up to another's.
fn submit(
    gpu: &Gpu,
    commands: vk::CommandBuffer,
    after: Option<(vk::Semaphore, u64)>,
    (done, value): (vk::Semaphore, u64),
) -> Result<()> {
    let (waits, wait_values): (Vec<_>, Vec<_>) = after.into_iter().unzip();
    let stages = vec![vk::PipelineStageFlags::COMPUTE_SHADER; waits.len()];
    let (signals, signal_values) = ([done], [value]);
    let mut values = vk::TimelineSemaphoreSubmitInfo::default()
        .wait_semaphore_values(&wait_values)
        .signal_semaphore_values(&signal_values);
    let commands = [commands];
    let submit = vk::SubmitInfo::default()
        .wait_semaphores(&waits)
        .wait_dst_stage_mask(&stages)
        .command_buffers(&commands)
        .signal_semaphores(&signals)
        .push_next(&mut values);
    // SAFETY: the backend has one owner, so the queue is used by one thread; all buffers live.
    unsafe {
        gpu.vk
            .queue_submit(gpu.compute.queue, &[submit], vk::Fence::null())
    }
    .map_err(failed("a submission"))
}

impl Inspect for VulkanBackend {
    fn positions(&mut self) -> Result<Vec<Point>> {
        self.gpu.wait_idle()?;
        let scene = self.scene.take().expect("a scene was loaded");
        let count = scene.animation.vertex_count();
        let result = self.fetch(&scene.positions[self.position], count);
        self.scene = Some(scene);
        result
    }

    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        self.gpu.wait_idle()?;
        let tree = self.tree.take().expect("a scene was loaded");
        let result = self.fetch::<[f32; 8]>(&tree.nodes, tree.node_count as usize);
        self.tree = Some(tree);
        let unscale = f64::from(self.scene().scale_exponent).exp2() as f32;
        let point = |p: &[f32]| [p[0] * unscale, p[1] * unscale, p[2] * unscale];
        Ok(result?
            .iter()
            .map(|n| Aabb {
                min: point(&n[..3]),
                max: point(&n[4..7]),
            })
            .collect())
    }
}

impl Drop for VulkanBackend {
    fn drop(&mut self) {
        // A lost device has nothing to wait for.
        let _ = self.gpu.wait_idle();
        // SAFETY: the device is idle.
        unsafe { self.gpu.vk.destroy_semaphore(self.timeline, None) };
    }
}
