//! The implementation of [`GpuDevice`] for wgpu.

use crate::adapters::{driver, kind};
use crate::buffer_points::BufferPoints;
use crate::buffers::{Arrived, MappedCopy, Mapping, inaccessible, upload, write};
use crate::caller_encoder::CallerEncoder;
use crate::faults::layer_messages;
use crate::gpu::{OpenGpu, STORAGE, make, unmap};
use crate::launches::WgpuRecording;
use crate::limits::{ATOMIC_MIN_64_BITS, kernel_limits};
use crate::pipelines::Pipeline;
use crate::staging::{MappedPool, MappedStaging};
use crate::submission::SubmissionEncoder;
use backend::{
    Arithmetic, BackendError, BackendName, Capabilities, Device, FRAMES_IN_FLIGHT, Result,
    Snapshot, Spares, Ticket, TreeFormat,
};
use bytemuck::Pod;
use geom::Point;
use gpu_common::{
    BufferSize, Clock, ComputeBackend, DeviceInfo, GpuDevice, KernelCode, LastUse, LentBuffers,
    LentRays, MemoryReport, Options, Outcome, PendingWork, Upload, read_parts,
};
use shaders::{BufferName, Params};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use wgpu::{Buffer, BufferSlice, BufferUsages, CommandEncoder, SubmissionIndex};

/// The backend that computes through wgpu.
pub type WgpuBackend = ComputeBackend<WgpuDevice>;

/// Opens a backend.
///
/// # Errors
/// [`BackendError::NoDevice`] with the reason, or [`BackendError::Limit`] if a limit is too low for any scene.
pub fn open(options: &Options) -> Result<WgpuBackend> {
    let gpu = OpenGpu::open(options)?;
    ComputeBackend::over(WgpuDevice::over(Arc::new(gpu))?)
}

/// Creates a backend on a device that the program opened, with its features and limits. See
/// [`crate::required_features`], [`crate::useful_features`] and [`crate::required_limits`]. Leaves the program's error
/// handler and its callback for a lost device unchanged.
///
/// # Errors
/// [`BackendError::Limit`] with the limit that is too low, or [`BackendError::NoDevice`] if the device's arithmetic is
/// wrong.
pub fn from_device(
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
) -> Result<WgpuBackend> {
    let gpu = OpenGpu::over(device, queue, info)?;
    ComputeBackend::over(WgpuDevice::over(Arc::new(gpu))?)
}

/// A wgpu device with its one queue. Writes and copies run in order with submissions.
pub struct WgpuDevice {
    pub(crate) scene: DeviceScene,
    /// One for each unfinished submission.
    submissions: Vec<SubmissionEncoder>,
    /// Parameters that the program's shaders read last, and their buffer.
    pub(crate) module_params: Option<(Params, Buffer)>,
    pub(crate) gpu: Arc<OpenGpu>,
}

/// State that is dropped with a scene.
#[derive(Default)]
pub(crate) struct DeviceScene {
    /// Host-visible buffers without a pending copy, for later reads of device buffers.
    spare_readbacks: Vec<Buffer>,
    staging: MappedPool,
    spares: Spares<Arrived>,
    /// Copies of positions that `take_positions` has not returned yet, by the submission that requested them.
    copies: BTreeMap<Ticket, MappedCopy>,
    pub(crate) points: BufferPoints,
    /// Buffers of the program for the next recording.
    pub(crate) caller_buffers: LentBuffers<Buffer>,
    /// The ray buffers that were set last.
    pub(crate) rays: Vec<LentRays<Buffer>>,
    pub(crate) encoder: CallerEncoder,
}

impl WgpuDevice {
    fn over(gpu: Arc<OpenGpu>) -> Result<Self> {
        let submissions = (0..FRAMES_IN_FLIGHT).map(|_| SubmissionEncoder::new(&gpu));
        Ok(Self {
            scene: DeviceScene::default(),
            submissions: submissions.collect::<Result<_>>()?,
            module_params: None,
            gpu,
        })
    }

    /// Returns rejected calls and messages of the validation layer. wgpu reports the layer's errors only in builds with
    /// debug assertions, and for the whole process.
    fn complaints(&self) -> Vec<String> {
        let mut messages = self.gpu.faults.messages();
        if self.gpu.is_validated {
            messages.extend(layer_messages());
        }
        messages
    }

    /// Returns the index of the encoder of a submission.
    fn slot(&self, ticket: Ticket) -> usize {
        ticket.0 as usize % self.submissions.len()
    }

    /// Encodes a recording and the copy of its positions. Returns the mapping of its report, and the copy of positions
    /// if one was requested. If the encoder is the program's, `stamp` must be the ticket: see
    /// [`SubmissionEncoder::encode`].
    fn encode(
        &mut self,
        encoder: &mut CommandEncoder,
        recording: &mut WgpuRecording,
        ticket: Ticket,
        stamp: Option<Ticket>,
    ) -> Result<(Mapping, Option<MappedCopy>)> {
        let slot = self.slot(ticket);
        let (gpu, submission) = (&self.gpu, &mut self.submissions[slot]);
        self.scene.points.encode(gpu, encoder)?;
        submission.encode(encoder, recording, stamp)?;
        let copy = recording.positions.as_ref().map(|positions| {
            let spare = self.scene.spares.pop();
            let spare = spare.and_then(|s| s.unmapped(&gpu.device));
            let from = positions.from.slice(..positions.bytes);
            MappedCopy::record(gpu, encoder, from, spare)
        });
        let copy = copy.transpose()?;
        Ok((submission.report(encoder), copy))
    }

    /// Starts the copy of a part of a buffer to the host. Also returns its submission.
    fn begin_read(&mut self, from: BufferSlice<'_>) -> Result<(MappedCopy, SubmissionIndex)> {
        let (gpu, spares) = (&self.gpu, &mut self.scene.spare_readbacks);
        let fits = spares.iter().position(|b| b.size() >= from.size());
        let spare = fits.map(|i| spares.swap_remove(i));
        let mut encoder = gpu.encoder("a readback")?;
        let copy = MappedCopy::record(gpu, &mut encoder, from, spare)?;
        Ok((copy, gpu.submit([encoder])?))
    }
}

impl GpuDevice for WgpuDevice {
    type Buffer = Buffer;
    type Binding = Buffer;
    type Pipeline = Pipeline;
    type Native = Infallible;
    type Staging = MappedStaging;

    fn share_device(&self) -> impl FnOnce() -> Result<Self> + Send + use<> {
        let gpu = Arc::clone(&self.gpu);
        move || Self::over(gpu)
    }

    fn compiler(&self) -> impl Fn(KernelCode) -> Result<Pipeline> + Send + Sync + 'static + use<> {
        let gpu = Arc::clone(&self.gpu);
        move |kernel| Pipeline::new(&gpu, kernel)
    }

    fn info(&self) -> DeviceInfo {
        let (info, limits) = (&self.gpu.info, &self.gpu.limits);
        let name = BackendName::Wgpu.name();
        DeviceInfo {
            device: Device {
                backend: name,
                adapter: info.name.clone(),
                driver: driver(info),
                kind: kind(info),
                threads: 0,
                arithmetic: Arithmetic::IEEE,
                capabilities: Capabilities::minimal(name, TreeFormat::default()),
            },
            packets: self.gpu.packets(),
            rasterizes: self.gpu.features.contains(ATOMIC_MIN_64_BITS),
            clock: Clock::new(u64::BITS, self.gpu.tick_ns),
            max_groups: limits.max_compute_workgroups_per_dimension,
            kernel_limits: kernel_limits(limits),
            splits: false,
            copies_points: true,
            free_bytes: None,
            complaints: self.complaints(),
        }
    }

    /// The byte counts include neither the program's own buffers on its device nor host memory.
    fn memory(&self) -> MemoryReport {
        let submissions = self.submissions.iter();
        MemoryReport {
            submissions: submissions.map(SubmissionEncoder::bytes).sum(),
            buffers_made: self.gpu.buffers_made(),
            ..MemoryReport::default()
        }
    }

    fn buffer(&self, name: BufferName, bytes: u64) -> Result<Buffer> {
        make(&self.gpu, name.name(), bytes, STORAGE)
    }

    fn size(buffer: &Buffer) -> BufferSize {
        BufferSize {
            bytes: buffer.size(),
            allocated: buffer.size(),
        }
    }

    fn bind(buffer: &Buffer) -> Buffer {
        buffer.clone()
    }

    fn lent(&mut self) -> &mut LentBuffers<Buffer> {
        &mut self.scene.caller_buffers
    }

    fn upload(&mut self, all: &[(&[u8], &Buffer)]) -> Result<()> {
        upload(&self.gpu, all)
    }

    fn write<T: Pod + Send + Sync>(&mut self, to: &mut Buffer, rows: &[T]) -> Result<()> {
        self.scene.staging.write(&self.gpu, to, rows)
    }

    fn read<T: Pod>(
        &mut self,
        from: &Buffer,
        count: usize,
        mut each: impl FnMut(usize, &[T]),
    ) -> Result<()> {
        if !from.usage().contains(BufferUsages::COPY_SRC) {
            let why = "results in a buffer without the usage COPY_SRC cannot be read";
            return Err(BackendError::Misuse(why.into()));
        }
        let begun = read_parts::<T>(count)
            .map(|part| Ok((self.begin_read(from.slice(part.bytes.clone()))?, part)));
        for ((copy, submission), part) in begun.collect::<Result<Vec<_>>>()? {
            let MappedCopy { buffer, mapping } = copy;
            self.gpu.wait_for(submission)?;
            mapping.wait(&self.gpu)?;
            let bytes = (part.count * size_of::<T>()) as u64;
            let view = buffer.get_mapped_range(..bytes).map_err(inaccessible)?;
            each(part.first, bytemuck::cast_slice(&view));
            drop(view);
            if unmap(&self.gpu.device, &buffer) {
                self.scene.spare_readbacks.push(buffer);
            }
        }
        Ok(())
    }

    fn staging(&mut self, bytes: u64) -> Result<MappedStaging> {
        let buffer = self.scene.staging.take(&self.gpu, bytes)?;
        Ok(MappedStaging::new(&self.gpu, buffer, 0))
    }

    fn send(&mut self, upload: Upload<'_, MappedStaging>, to: &Buffer) -> Result<u64> {
        let scene = &mut self.scene;
        match upload {
            Upload::Staged(from) => scene.staging.send(&self.gpu, from, to, 0)?,
            Upload::KeyFrame { key, runs } => {
                for run in scene.points.points.host_runs(runs) {
                    let at = (run.start * size_of::<Point>()) as u64;
                    write(&self.gpu, to, at, &key[run])?;
                }
                let copies = &mut scene.caller_buffers.copies;
                scene.points.copy_to(to, &self.gpu.limits, copies);
            }
        }
        Ok(0)
    }

    /// Submits the recording, or leaves it in the program's encoder if one was set.
    fn submit(&mut self, recording: &mut WgpuRecording, ticket: Ticket) -> Result<()> {
        let slot = self.slot(ticket);
        let (submission, (report, copy)) = if let Some(mut encoder) = self.take_encoder() {
            let encoded = self.encode(&mut encoder, recording, ticket, Some(ticket));
            self.scene.encoder.encoder = Some(encoder);
            let encoded = encoded?;
            self.scene.encoder.under_way.insert(ticket, None);
            (None, encoded)
        } else {
            let mut encoder = self.gpu.encoder("a frame")?;
            let encoded = self.encode(&mut encoder, recording, ticket, None)?;
            let submission = self.gpu.submit([encoder]);
            let unmap = |_: &_| self.submissions[slot].unmap_report();
            (Some(submission.inspect_err(unmap)?), encoded)
        };
        self.submissions[slot].sent = Some((submission, report));
        self.scene.copies.extend(copy.map(|copy| (ticket, copy)));
        Ok(())
    }

    fn has_finished(&self, work: PendingWork) -> Result<bool> {
        match work {
            PendingWork::Submission(ticket) => {
                self.gpu.poll()?;
                self.submissions[self.slot(ticket)].has_finished()
            }
            PendingWork::Positions(ticket) => {
                self.gpu.poll()?;
                let copy = self.scene.copies.get(&ticket);
                copy.map_or(Ok(true), |copy| copy.mapping.is_mapped(&self.gpu))
            }
            // A queue write would run before an encoder that the program submits later. So the buffer can be written
            // only if no unfinished encoder uses it.
            PendingWork::Use(last) => Ok(self.scene.encoder.is_past(last.ticket)),
        }
    }

    fn is_dropped(&self, ticket: Ticket) -> bool {
        self.submissions[self.slot(ticket)].is_dropped()
    }

    fn wait(&self, until: Option<LastUse>) -> Result<()> {
        match until {
            // Writes run in order with submissions.
            Some(_) => Ok(()),
            None => self.gpu.wait_idle(),
        }
    }

    fn finish(&mut self, ticket: Ticket) -> Result<Outcome> {
        self.scene.encoder.wait(&self.gpu, ticket)?;
        let slot = self.slot(ticket);
        let outcome = self.submissions[slot].finish()?;
        self.scene.encoder.under_way.remove(&ticket);
        if matches!(outcome, Outcome::Dropped(_)) {
            self.scene.copies.remove(&ticket);
        }
        Ok(outcome)
    }

    fn take_positions(&mut self, ticket: Ticket, vertices: usize) -> Result<Snapshot> {
        let copy = self.scene.copies.remove(&ticket);
        let copy = copy.expect("the submission copies positions");
        let arrived = Arrived::new(&self.gpu, copy, vertices)?;
        Ok(self.scene.spares.lend(arrived))
    }

    fn unload(&mut self) -> Result<()> {
        self.gpu.wait_idle()?;
        self.scene = DeviceScene::default();
        for submission in &mut self.submissions {
            submission.launches.unload();
        }
        Ok(())
    }
}
