//! The implementation of [`GpuDevice`] for wgpu.

use crate::adapters::{driver, kind};
use crate::buffers::{Arrived, MappedCopy, Mapping, unreadable, upload, write};
use crate::faults::layer_messages;
use crate::gpu::{OpenGpu, STORAGE, make, unmap};
use crate::launches::WgpuRecording;
use crate::lent_encoder::LentEncoder;
use crate::lent_points::DevicePoints;
use crate::limits::{LEAST_OF_64_BITS, kernel_limits};
use crate::pipelines::Pipeline;
use crate::staging::{MappedPool, MappedStaging};
use crate::submission::SubmissionEncoder;
use backend::{
    Arithmetic, BackendName, Capabilities, Device, FRAMES_IN_FLIGHT, Result, Snapshot, Spares,
    Ticket, TreeFormat,
};
use bytemuck::Pod;
use geom::Point;
use gpu_common::{
    BufferSize, Clock, ComputeBackend, DeviceInfo, GpuDevice, KernelCode, LastUse, LentBuffers,
    LentRays, MemoryReport, Options, Outcome, PendingWork, Upload, read_parts,
};
use shaders::{BufferName, Params};
use std::collections::VecDeque;
use std::convert::Infallible;
use std::ops::Range;
use std::sync::Arc;
use wgpu::{Buffer, CommandEncoder};

/// The backend that computes through wgpu.
pub type WgpuBackend = ComputeBackend<WgpuDevice>;

/// Opens a backend.
///
/// # Errors
/// [`BackendError::NoDevice`](backend::BackendError::NoDevice) with the reason, or
/// [`BackendError::Limit`](backend::BackendError::Limit) if a limit is too low for any scene.
pub fn open(options: &Options) -> Result<WgpuBackend> {
    let gpu = OpenGpu::open(options)?;
    ComputeBackend::over(WgpuDevice::over(Arc::new(gpu))?)
}

/// Creates a backend on a device that an engine opened, with its features and limits. See [`crate::required_features`],
/// [`crate::useful_features`] and [`crate::required_limits`]. Leaves the engine's error handler and its callback for a
/// lost device unchanged.
///
/// # Errors
/// [`BackendError::Limit`](backend::BackendError::Limit) with the limit that is too low, or
/// [`BackendError::NoDevice`](backend::BackendError::NoDevice) if the device's arithmetic is wrong.
pub fn from_device(
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
) -> Result<WgpuBackend> {
    let gpu = OpenGpu::lent(device, queue, info)?;
    ComputeBackend::over(WgpuDevice::over(Arc::new(gpu))?)
}

/// A wgpu device with its one queue. Writes and copies run in order with submissions.
pub struct WgpuDevice {
    pub(crate) scene: DeviceScene,
    /// One for each unfinished submission.
    submissions: Vec<SubmissionEncoder>,
    /// Parameters that the program's shaders read last, and their buffer.
    pub(crate) module: Option<(Params, Buffer)>,
    pub(crate) gpu: Arc<OpenGpu>,
}

/// State that is dropped with a scene.
#[derive(Default)]
pub(crate) struct DeviceScene {
    /// Host-visible buffers for reads of device buffers.
    views: Vec<Buffer>,
    staging: MappedPool,
    spares: Spares<Arrived>,
    /// Copies of positions that were not taken, by the submission that requested them.
    copies: VecDeque<(Ticket, MappedCopy)>,
    pub(crate) points: DevicePoints,
    pub(crate) lent: LentBuffers<Buffer>,
    /// The rays lent last.
    pub(crate) rays: Vec<LentRays<Buffer>>,
    pub(crate) encoder: LentEncoder,
}

impl WgpuDevice {
    fn over(gpu: Arc<OpenGpu>) -> Result<Self> {
        let submissions = (0..FRAMES_IN_FLIGHT).map(|_| SubmissionEncoder::new(&gpu));
        Ok(Self {
            scene: DeviceScene::default(),
            submissions: submissions.collect::<Result<_>>()?,
            module: None,
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
    fn place(&self, ticket: Ticket) -> usize {
        ticket.0 as usize % self.submissions.len()
    }

    /// Encodes a recording and the copy of its positions. Returns the mapping of its report. In a program's encoder, the
    /// report contains the ticket as a `stamp`.
    fn encode(
        &mut self,
        encoder: &mut CommandEncoder,
        recording: &mut WgpuRecording,
        ticket: Ticket,
        stamp: Option<Ticket>,
    ) -> Result<(Mapping, Option<MappedCopy>)> {
        let place = self.place(ticket);
        let (gpu, submission) = (&self.gpu, &mut self.submissions[place]);
        self.scene.points.encode(gpu, encoder)?;
        submission.encode(encoder, recording, stamp)?;
        let copy = recording.positions.as_ref().map(|positions| {
            let spare = self.scene.spares.pop();
            let spare = spare.and_then(|s| s.unmapped(&gpu.device));
            let to = ("vertices for the builder", spare);
            let from = (&positions.from, 0..positions.bytes);
            MappedCopy::record(gpu, encoder, from, to)
        });
        let copy = copy.transpose()?;
        Ok((submission.report(encoder), copy))
    }

    fn begin_read(&mut self, from: &Buffer, bytes: Range<u64>) -> Result<MappedCopy> {
        let (gpu, views) = (&self.gpu, &mut self.scene.views);
        let (what, size) = ("a view for the host", bytes.end - bytes.start);
        let fits = views.iter().position(|view| view.size() >= size);
        let spare = fits.map(|i| views.swap_remove(i));
        let mut encoder = gpu.encoder(what)?;
        let copy = MappedCopy::record(gpu, &mut encoder, (from, bytes), (what, spare))?;
        let place = Some(gpu.submit([encoder])?);
        Ok(MappedCopy { place, ..copy })
    }

    fn end_read(&mut self, read: MappedCopy, bytes: usize, each: impl FnOnce(&[u8])) -> Result<()> {
        if let Some(place) = read.place {
            self.gpu.wait_for(place)?;
        }
        read.mapping.expect(&self.gpu)?;
        let view = read.buffer.get_mapped_range(..bytes as u64);
        each(&view.map_err(unreadable)?);
        if unmap(&self.gpu.device, &read.buffer) {
            self.scene.views.push(read.buffer);
        }
        Ok(())
    }
}

impl GpuDevice for WgpuDevice {
    type Buffer = Buffer;
    type Binding = Buffer;
    type Pipeline = Pipeline;
    type Native = Infallible;
    type Staging = MappedStaging;

    fn another(&self) -> impl FnOnce() -> Result<Self> + Send + use<> {
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
            rasterizes: self.gpu.features.contains(LEAST_OF_64_BITS),
            clock: Clock::new(u64::BITS, self.gpu.tick_ns),
            max_groups: limits.max_compute_workgroups_per_dimension,
            kernel_limits: kernel_limits(limits),
            splits: false,
            copies_points: true,
            free_bytes: None,
            complaints: self.complaints(),
        }
    }

    /// Counts neither an engine's own buffers on a lent device nor host memory.
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
        &mut self.scene.lent
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
        let begun = read_parts::<T>(count)
            .map(|part| Ok((self.begin_read(from, part.bytes.clone())?, part)));
        for (copy, part) in begun.collect::<Result<Vec<_>>>()? {
            let bytes = part.count * size_of::<T>();
            self.end_read(copy, bytes, |bytes| {
                each(part.first, bytemuck::cast_slice(bytes));
            })?;
        }
        Ok(())
    }

    fn staging(&mut self, bytes: u64) -> Result<MappedStaging> {
        let buffer = self.scene.staging.take(&self.gpu, bytes)?;
        Ok(MappedStaging { buffer, filled: 0 })
    }

    fn send(&mut self, upload: Upload<'_, MappedStaging>, to: &Buffer) -> Result<u64> {
        let scene = &mut self.scene;
        match upload {
            Upload::Staged(from) => scene.staging.send(&self.gpu, from, (to, 0))?,
            Upload::KeyFrame { key, runs } => {
                for run in scene.points.others(runs) {
                    let at = (run.start * size_of::<Point>()) as u64;
                    write(&self.gpu, to, at, &key[run])?;
                }
                let largest = self.gpu.limits.max_storage_buffer_binding_size;
                scene.points.copy_to(to, largest, &mut scene.lent.copies);
            }
        }
        Ok(0)
    }

    /// Submits the recording, or leaves it in the program's encoder if one was lent.
    fn submit(&mut self, recording: &mut WgpuRecording, ticket: Ticket) -> Result<()> {
        let slot = self.place(ticket);
        let (place, (report, copy)) = if let Some(mut encoder) = self.take_encoder() {
            let encoded = self.encode(&mut encoder, recording, ticket, Some(ticket));
            self.scene.encoder.encoder = Some(encoder);
            let encoded = encoded?;
            self.scene.encoder.under_way.push_back((ticket, None));
            (None, encoded)
        } else {
            let mut encoder = self.gpu.encoder("a frame")?;
            let encoded = self.encode(&mut encoder, recording, ticket, None)?;
            let place = self.gpu.submit([encoder]);
            let recall = |_: &_| self.submissions[slot].recall();
            (Some(place.inspect_err(recall)?), encoded)
        };
        self.submissions[slot].sent = Some((place, report));
        self.scene.copies.extend(copy.map(|copy| (ticket, copy)));
        Ok(())
    }

    fn has_finished(&self, work: PendingWork) -> Result<bool> {
        match work {
            PendingWork::Submission(ticket) => {
                self.gpu.poll()?;
                self.submissions[self.place(ticket)].has_finished()
            }
            PendingWork::Positions(ticket) => {
                self.gpu.poll()?;
                let copy = self.scene.copies.iter().find(|(of, _)| *of == ticket);
                copy.map_or(Ok(true), |(_, copy)| copy.mapping.poll(&self.gpu))
            }
            // Queue writes run before the program submits its encoder.
            PendingWork::Use(last) => Ok(self.scene.encoder.is_past(last.ticket)),
        }
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
        let slot = self.place(ticket);
        let outcome = self.submissions[slot].finish()?;
        match outcome {
            Outcome::Finished(_) => self.scene.encoder.finished(ticket),
            Outcome::Dropped => {
                self.scene.encoder.dropped(ticket);
                self.scene.copies.retain(|(of, _)| *of != ticket);
            }
        }
        Ok(outcome)
    }

    fn take_positions(&mut self, ticket: Ticket, vertices: usize) -> Result<Snapshot> {
        let copies = &mut self.scene.copies;
        let found = copies.iter().position(|(of, _)| *of == ticket);
        let found = found.and_then(|i| copies.remove(i));
        let (_, copy) = found.expect("the submission copies positions");
        Ok(self.scene.spares.lend(Arrived::new(copy, vertices)?))
    }

    fn unload(&mut self) -> Result<()> {
        self.gpu.wait_idle()?;
        self.scene = DeviceScene::default();
        self.submissions
            .iter_mut()
            .for_each(SubmissionEncoder::forget);
        Ok(())
    }
}
