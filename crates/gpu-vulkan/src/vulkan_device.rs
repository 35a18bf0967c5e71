//! The implementation of [`GpuDevice`] for Vulkan.

use crate::adapters::adapters_of;
use crate::encoder::{NativeCommand, RecordingEncoder, VulkanRecording};
use crate::external_inputs::ExternalInputs;
use crate::gpu::{Gpu, Queue};
use crate::instance::VulkanInstance;
use crate::memory::{Buffer, BufferUse};
use crate::pipelines::Pipeline;
use crate::staging::{HostPoints, StagingBuffer, StagingPool};
use crate::timeline::{QueueBatch, SemaphoreValue, Timeline, submit};
use crate::transfer::{BufferCopy, Transfer, upload};
use crate::validation::messages;
use ash::vk;
use backend::{
    Arithmetic, BackendName, Capabilities, Device, FRAMES_IN_FLIGHT, Result, Snapshot, Spares,
    Ticket, TreeFormat,
};
use bytemuck::Pod;
use geom::{KeyFrame, Point};
use gpu_common::{
    BufferSize, Clock, ComputeBackend, DeviceInfo, GpuDevice, KernelCode, LastUse, LentBuffers,
    MemoryReport, Options, Outcome, PendingWork, Pool, Staging, Upload, read_parts,
};
use shaders::{BufferName, Packets};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// The backend that computes through Vulkan.
pub type VulkanBackend = ComputeBackend<VulkanDevice>;

/// Opens a backend.
///
/// # Errors
/// [`backend::BackendError::NoDevice`] with the reason, or [`backend::BackendError::Limit`] if a limit is too low for
/// any scene.
pub fn open(options: &Options) -> Result<VulkanBackend> {
    let instance = VulkanInstance::new(options.validation)?;
    let list = adapters_of(&instance)?;
    let gpu = Gpu::open(instance, &list, options, false)?;
    ComputeBackend::over(VulkanDevice::over(&gpu)?)
}

/// A Vulkan device for one scene: a queue for frames, and queues for uploads and readbacks.
pub struct VulkanDevice {
    /// Timeline of submissions. It reaches a ticket's number when the submission has finished.
    pub done: Timeline,
    /// Timeline of the first parts of submissions. It reaches a ticket's number when the positions that the host
    /// requested are complete.
    first_part: Timeline,
    submitted: u64,
    pub(crate) compute: Arc<Queue>,
    /// Copies to the device.
    pub upload: Transfer,
    /// Copies to the host.
    pub readback: Transfer,
    /// One for each unfinished submission.
    encoders: Vec<RecordingEncoder>,
    /// Host-visible buffers without a pending copy, for later reads of device buffers.
    spare_readbacks: Vec<Buffer>,
    tree_staging: StagingPool,
    key_staging: StagingPool,
    /// Resources that unfinished uploads still use, each with the timeline value of its upload.
    in_use: Vec<(u64, Box<dyn Send>)>,
    spares: Spares<HostPoints>,
    /// Copies of positions that `take_positions` has not returned yet, by the submission that requested them.
    copies: BTreeMap<Ticket, Result<ReadbackCopy>>,
    pub(crate) external: ExternalInputs,
    /// The logical device and its memory.
    pub gpu: Arc<Gpu>,
}

impl VulkanDevice {
    /// Creates the device of one scene. Other scenes may share `gpu`.
    pub fn over(gpu: &Arc<Gpu>) -> Result<Self> {
        let [compute, upload, readback] = gpu.queues.clone();
        Ok(Self {
            done: Timeline::new(gpu)?,
            first_part: Timeline::new(gpu)?,
            submitted: 0,
            compute,
            upload: Transfer::new(gpu, upload)?,
            readback: Transfer::new(gpu, readback)?,
            encoders: (0..FRAMES_IN_FLIGHT)
                .map(|_| RecordingEncoder::new(gpu))
                .collect::<Result<_>>()?,
            spare_readbacks: Vec::new(),
            tree_staging: StagingPool::new("the tree's topology"),
            key_staging: StagingPool::new("key frames"),
            in_use: Vec::new(),
            spares: Spares::default(),
            copies: BTreeMap::new(),
            external: ExternalInputs::default(),
            gpu: Arc::clone(gpu),
        })
    }

    /// Returns whether uploads and readbacks each have a queue of their own.
    pub fn has_queues_for_copies(&self) -> bool {
        let [up, back] = [&self.upload.queue, &self.readback.queue];
        let is_own = |queue| !Arc::ptr_eq(queue, &self.compute);
        is_own(up) && is_own(back) && !Arc::ptr_eq(up, back)
    }

    /// Returns the encoder of a submission.
    fn encoder(&mut self, ticket: Ticket) -> &mut RecordingEncoder {
        let count = self.encoders.len();
        &mut self.encoders[ticket.0 as usize % count]
    }

    /// Returns a host-visible buffer of at least `bytes`: `spare` if it is large enough, or else a new one.
    fn readback_buffer(&self, spare: Option<Buffer>, bytes: u64) -> Result<Buffer> {
        match spare.filter(|buffer| buffer.bytes >= bytes) {
            Some(buffer) => Ok(buffer),
            None => Buffer::new(&self.gpu, "a readback", bytes, BufferUse::Readback),
        }
    }

    fn begin_read(&mut self, from: &Buffer, bytes: Range<u64>) -> Result<ReadbackCopy> {
        let size = bytes.end - bytes.start;
        let fits = self.spare_readbacks.iter().position(|b| b.bytes >= size);
        let spare = match fits {
            Some(i) => Some(self.spare_readbacks.swap_remove(i)),
            None => self.spare_readbacks.pop(),
        };
        let buffer = self.readback_buffer(spare, size)?;
        let copy = BufferCopy::between(from.vk, buffer.vk).range(bytes, 0);
        let done_at = self.readback.start(&copy, &[])?;
        Ok(ReadbackCopy { buffer, done_at })
    }

    /// Starts the upload of runs of a key frame, from the host and from external memory.
    fn send_key(&mut self, key: &KeyFrame, runs: &[Range<usize>], to: &Buffer) -> Result<u64> {
        let sent = if let Some(memory) = key.shared::<HostPoints>() {
            let offset = |vertex: usize| (vertex * size_of::<Point>()) as u64;
            let mut copy = BufferCopy::between(memory.buffer.vk, to.vk);
            for run in self.external.points.host_runs(runs) {
                copy = copy.range(offset(run.start)..offset(run.end), offset(run.start));
            }
            let value = self.upload.start(&copy, &[])?;
            self.retain(KeyFrame::clone(key), value);
            value
        } else {
            let bytes = size_of_val(&key[..]) as u64;
            let (uploads, submissions) = (&self.upload.done, &self.done);
            let has_ended = |last, may_wait| has_ended(uploads, submissions, last, may_wait);
            let mut from = self.key_staging.take(&self.gpu, bytes, has_ended)?;
            from.fill(&[bytemuck::cast_slice(key)]);
            self.key_staging.send(&mut self.upload, from, to)?
        };
        Ok(self.copy_external_points(Some(to))?.unwrap_or(sent))
    }

    /// Keeps a resource until an upload has finished. Reports do not count its memory.
    pub(crate) fn retain(&mut self, resource: impl Send + 'static, upload_value: u64) {
        self.in_use.push((upload_value, Box::new(resource)));
    }

    /// Submits the parts of an encoded recording. Copies of positions wait only for the first of two parts.
    fn submit_parts(&mut self, recording: &VulkanRecording, ticket: Ticket) -> Result<()> {
        let upload_value = Some(recording.after_upload).filter(|&value| value > 0);
        let upload_value = upload_value.map(|value| self.upload.done.at(value));
        let overwritten = recording.overwrites;
        let overwritten = overwritten.and_then(|ticket| self.copies.get(&ticket)?.as_ref().ok());
        let overwritten = overwritten.map(|copy| self.readback.done.at(copy.done_at));
        let after = upload_value.into_iter().chain(overwritten);
        let after: Vec<SemaphoreValue> = after.chain(self.external.waits.iter().copied()).collect();
        let (done, first_part) = (self.done.at(ticket.0), self.first_part.at(ticket.0));
        let parts = self.encoder(ticket).commands.all();
        let batch = |(i, &commands)| QueueBatch {
            commands: Some(commands),
            after: if i == 0 { &after } else { &[] },
            done: if i + 1 == parts.len() {
                done
            } else {
                first_part
            },
        };
        let batches: Vec<_> = parts.iter().enumerate().map(batch).collect();
        submit(&self.gpu, &self.compute, &batches)?;
        // Later submissions to the queue wait as well.
        self.external.waits.clear();
        self.submitted = ticket.0;
        // The submission runs already. The next call reports a lost device.
        if let Ok(reached) = self.upload.done.value() {
            self.in_use.retain(|(value, _)| *value > reached);
        }
        Ok(())
    }
}

/// Returns whether the last use of a buffer has finished. Waits for it first if `may_wait` is set.
fn has_ended(
    uploads: &Timeline,
    submissions: &Timeline,
    last: LastUse,
    may_wait: bool,
) -> Result<bool> {
    if may_wait {
        submissions.wait(last.ticket)?;
        uploads.wait(last.upload_value)?;
    }
    Ok(submissions.has_reached(last.ticket)? && uploads.has_reached(last.upload_value)?)
}

/// A copy to the host by the readback queue.
struct ReadbackCopy {
    buffer: Buffer,
    /// Timeline value of the copy.
    done_at: u64,
}

impl GpuDevice for VulkanDevice {
    type Buffer = Buffer;
    type Binding = vk::Buffer;
    type Pipeline = Pipeline;
    type Native = NativeCommand;
    type Staging = StagingBuffer;

    fn share_device(&self) -> impl FnOnce() -> Result<Self> + Send + use<> {
        let gpu = Arc::clone(&self.gpu);
        move || Self::over(&gpu)
    }

    fn compiler(&self) -> impl Fn(KernelCode) -> Result<Pipeline> + Send + Sync + 'static + use<> {
        let gpu = Arc::clone(&self.gpu);
        move |(kernel, code)| Pipeline::new(&gpu, kernel, code.spirv)
    }

    fn info(&self) -> DeviceInfo {
        let Gpu {
            adapter,
            features,
            limits,
            timestamp_bits,
            ..
        } = &*self.gpu;
        let subgroups = features.subgroups.map(|size| (size, size));
        let name = BackendName::Vulkan.name();
        DeviceInfo {
            device: Device {
                backend: name,
                adapter: adapter.name.clone(),
                driver: adapter.driver.clone(),
                kind: adapter.kind,
                threads: 0,
                arithmetic: Arithmetic::IEEE,
                capabilities: Capabilities::minimal(name, TreeFormat::default()),
            },
            packets: Packets::for_device(subgroups, self.gpu.is_software()),
            rasterizes: features.has_64_bit_atomics,
            clock: Clock::new(*timestamp_bits, limits.tick_ns),
            max_groups: limits.groups,
            kernel_limits: limits.of_kernels(),
            splits: true,
            copies_points: false,
            free_bytes: self.gpu.memory.free_bytes(&self.gpu.instance),
            complaints: messages().clone(),
        }
    }

    fn memory(&self) -> MemoryReport {
        let memory = &self.gpu.memory;
        let staging = [&self.tree_staging, &self.key_staging].map(|s| s.free.held());
        MemoryReport {
            allocated: Some(memory.held()),
            waiting: staging.iter().sum(),
            submissions: 0,
            buffers_made: memory.made(),
        }
    }

    fn buffer(&self, name: BufferName, bytes: u64) -> Result<Buffer> {
        let place = match name {
            BufferName::Rays => BufferUse::Upload,
            _ => BufferUse::Device,
        };
        Buffer::new(&self.gpu, name.name(), bytes, place)
    }

    fn size(buffer: &Buffer) -> BufferSize {
        buffer.size()
    }

    fn bind(buffer: &Buffer) -> vk::Buffer {
        buffer.vk
    }

    fn lent(&mut self) -> &mut LentBuffers<Buffer> {
        &mut self.external.lent
    }

    fn upload(&mut self, all: &[(&[u8], &Buffer)]) -> Result<()> {
        upload(&self.gpu, &mut self.upload, all)
    }

    fn write<T: Pod + Send + Sync>(&mut self, to: &mut Buffer, rows: &[T]) -> Result<()> {
        to.set_rows(rows);
        Ok(())
    }

    fn read<T: Pod>(
        &mut self,
        from: &Buffer,
        count: usize,
        mut each: impl FnMut(usize, &[T]),
    ) -> Result<()> {
        let mut begun = Vec::new();
        for part in read_parts::<T>(count) {
            match self.begin_read(from, part.bytes.clone()) {
                Ok(copy) => begun.push((copy, part)),
                Err(e) => {
                    // The started copies write to buffers that are dropped below.
                    self.readback.wait()?;
                    return Err(e);
                }
            }
        }
        for (copy, part) in begun {
            self.readback.done.wait(copy.done_at)?;
            each(part.first, copy.buffer.read(part.count));
            self.spare_readbacks.push(copy.buffer);
        }
        Ok(())
    }

    fn staging(&mut self, bytes: u64) -> Result<StagingBuffer> {
        let (uploads, submissions) = (&self.upload.done, &self.done);
        let has_ended = |last, may_wait| has_ended(uploads, submissions, last, may_wait);
        self.tree_staging.take(&self.gpu, bytes, has_ended)
    }

    fn send(&mut self, upload: Upload<'_, StagingBuffer>, to: &Buffer) -> Result<u64> {
        match upload {
            Upload::Staged(from) => self.tree_staging.send(&mut self.upload, from, to),
            Upload::KeyFrame { key, runs } => self.send_key(key, runs, to),
        }
    }

    fn submit(&mut self, recording: &mut VulkanRecording, ticket: Ticket) -> Result<()> {
        let positions = recording.positions;
        let to = positions.map(|positions| {
            let spare = self.spares.pop().map(|points| points.buffer);
            self.readback_buffer(spare, positions.bytes)
        });
        let to = to.transpose()?;
        self.encoder(ticket).encode(recording)?;
        self.submit_parts(recording, ticket)?;
        if let Some((positions, buffer)) = positions.zip(to) {
            let copy = BufferCopy::between(positions.from, buffer.vk);
            let copy = copy.range(0..positions.bytes, 0);
            let ready = self.first_part.at(ticket.0);
            // The submission runs already, so an error is returned with the positions.
            let started = self.readback.start(&copy, &[ready]);
            let copy = started.map(|done_at| ReadbackCopy { buffer, done_at });
            self.copies.insert(ticket, copy);
        }
        Ok(())
    }

    fn has_finished(&self, work: PendingWork) -> Result<bool> {
        match work {
            PendingWork::Submission(ticket) => self.done.has_reached(ticket.0),
            PendingWork::Positions(ticket) => match self.copies.get(&ticket) {
                Some(Ok(copy)) => self.readback.done.has_reached(copy.done_at),
                Some(Err(_)) | None => Ok(true),
            },
            PendingWork::Use(last) => has_ended(&self.upload.done, &self.done, last, false),
        }
    }

    fn is_dropped(&self, _: Ticket) -> bool {
        false
    }

    fn wait(&self, until: Option<LastUse>) -> Result<()> {
        if let Some(last) = until {
            return has_ended(&self.upload.done, &self.done, last, true).map(|_| ());
        }
        self.done.wait(self.submitted)?;
        self.upload.wait()?;
        self.readback.wait()?;
        self.external.wait()?;
        if self.gpu.is_software() {
            self.compute.wait_idle(&self.gpu)?;
        }
        Ok(())
    }

    fn finish(&mut self, ticket: Ticket) -> Result<Outcome> {
        self.done.wait(ticket.0)?;
        self.encoder(ticket).finished().map(Outcome::Finished)
    }

    fn take_positions(&mut self, ticket: Ticket, vertices: usize) -> Result<Snapshot> {
        let copy = self.copies.remove(&ticket);
        let buffer = copy.expect("the submission copies positions")?.buffer;
        let count = vertices;
        Ok(self.spares.lend(HostPoints { buffer, count }))
    }

    fn unload(&mut self) -> Result<()> {
        self.wait(None)?;
        self.tree_staging.free = Pool::default();
        self.key_staging.free = Pool::default();
        self.in_use.clear();
        self.spares = Spares::default();
        self.external = ExternalInputs::default();
        self.spare_readbacks.clear();
        self.copies.clear();
        Ok(())
    }
}
