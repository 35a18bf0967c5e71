//! The implementation of [`GpuDevice`] for wgpu.

use crate::adapters::{driver, kind};
use crate::buffers::{Arrived, HostCopy, STORAGE, make, unmap, unreadable, upload, write};
use crate::faults::layer_messages;
use crate::gpu::Gpu;
use crate::lent::{DevicePoints, DeviceRays};
use crate::lent_encoder::LentEncoder;
use crate::limits::{LEAST_OF_64_BITS, check_kernels};
use crate::pipelines::Pipeline;
use crate::slot::Slot;
use crate::staging::{Staging, fill};
use backend::{Arithmetic, BackendName, Device, Result, Snapshot, Spares, Ticket};
use bytemuck::Pod;
use geom::{KeyFrame, Point};
use gpu_common::{
    Clock, ComputeBackend, Finished, GpuDevice, KernelCode, LastUse, LentRays, Options, PointsCopy,
};
use shaders::{BufferName, Kernel, Packets, Params};
use std::ops::Range;
use std::sync::Arc;
use wgpu::Buffer;

/// The backend that computes through wgpu.
pub type WgpuBackend = ComputeBackend<WgpuDevice>;

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
    let gpu = Gpu::lent(device, queue, info)?;
    ComputeBackend::over(WgpuDevice::over(Arc::new(gpu)))
}

/// A wgpu device with its one queue. Writes and copies run in order with submissions.
pub struct WgpuDevice {
    pub(crate) scene: SceneState,
    /// Parameters that the program's shaders read last, and their buffer.
    pub(crate) module: Option<(Params, Buffer)>,
    pub(crate) gpu: Arc<Gpu>,
}

/// State that is dropped with a scene.
#[derive(Default)]
pub(crate) struct SceneState {
    /// Host-visible buffers for reads of device buffers.
    windows: Vec<Buffer>,
    staging: Staging,
    pub(crate) spares: Spares<Arrived>,
    pub(crate) points: DevicePoints,
    pub(crate) rays: DeviceRays,
    pub(crate) encoder: LentEncoder,
}

impl WgpuDevice {
    fn over(gpu: Arc<Gpu>) -> Self {
        Self {
            scene: SceneState::default(),
            module: None,
            gpu,
        }
    }
}

impl GpuDevice for WgpuDevice {
    type Buffer = Buffer;
    type Pipeline = Pipeline;
    type Maker = Arc<Gpu>;
    type Slot = Slot;
    type Copy = HostCopy;

    fn open(options: &Options) -> Result<Self> {
        Gpu::open(options).map(|gpu| Self::over(Arc::new(gpu)))
    }

    fn beside(gpu: Arc<Gpu>) -> Result<Self> {
        Ok(Self::over(gpu))
    }

    fn device(&self) -> Device {
        let info = &self.gpu.info;
        Device {
            backend: BackendName::Wgpu.name(),
            adapter: info.name.clone(),
            driver: driver(info),
            kind: kind(info),
            threads: 0,
            arithmetic: Arithmetic::IEEE,
        }
    }

    fn forms(&self) -> (Option<Packets>, bool) {
        let rasterizes = self.gpu.features.contains(LEAST_OF_64_BITS);
        (self.gpu.packets(), rasterizes)
    }

    fn clock(&self) -> Clock {
        Clock::new(u64::BITS, self.gpu.tick_ns)
    }

    fn max_groups(&self) -> u32 {
        self.gpu.limits.max_compute_workgroups_per_dimension
    }

    fn check_kernels(&self, wanted: &dyn Fn(&Kernel) -> bool) -> Result<()> {
        check_kernels(&self.gpu.limits, wanted)
    }

    fn buffer(&self, name: BufferName, bytes: u64) -> Result<Buffer> {
        make(&self.gpu, name.name(), bytes, STORAGE)
    }

    fn room(&self, what: &'static str, bytes: u64) -> Result<Buffer> {
        make(&self.gpu, what, bytes, STORAGE)
    }

    fn size(buffer: &Buffer) -> u64 {
        buffer.size()
    }

    fn take_lent_rays(&mut self) -> Option<LentRays<Buffer>> {
        self.scene.rays.due.pop_front()
    }

    const COPIES: bool = true;

    fn take_copies(&mut self) -> Vec<PointsCopy<Buffer>> {
        let largest = self.gpu.limits.max_storage_buffer_binding_size;
        self.scene.points.take_copies(largest)
    }

    fn buffers_made(&self) -> u64 {
        self.gpu.buffers_made()
    }

    /// wgpu reports the layer's errors only in builds with debug assertions, and for the whole process. Without the
    /// layer there are no messages.
    fn complaints(&self) -> Vec<String> {
        let mut messages = self.gpu.faults.messages();
        if self.gpu.is_validated {
            messages.extend(layer_messages());
        }
        messages
    }

    fn upload(&mut self, all: &[(&[u8], &Buffer)]) -> Result<()> {
        upload(&self.gpu, all)
    }

    fn write<T: Pod + Send + Sync>(&mut self, to: &mut Buffer, rows: &[T]) -> Result<()> {
        self.scene.staging.write(&self.gpu, to, rows)
    }

    fn begin_read(&mut self, from: &Buffer, bytes: Range<u64>) -> Result<HostCopy> {
        let (gpu, windows) = (&self.gpu, &mut self.scene.windows);
        let (what, size) = ("a view for the host", bytes.end - bytes.start);
        let fits = windows.iter().position(|w| w.size() >= size);
        let spare = fits.map(|i| windows.swap_remove(i));
        let mut encoder = gpu.encoder(what)?;
        let copy = HostCopy::record(gpu, &mut encoder, (from, bytes), (what, spare))?;
        let place = Some(gpu.submit([encoder])?);
        Ok(HostCopy { place, ..copy })
    }

    fn end_read(&mut self, read: HostCopy, bytes: usize, look: impl FnOnce(&[u8])) -> Result<()> {
        if let Some(place) = read.place {
            self.gpu.wait_for(place)?;
        }
        read.mapping.expect(&self.gpu)?;
        let view = read.buffer.get_mapped_range(..bytes as u64);
        look(&view.map_err(unreadable)?);
        if unmap(&self.gpu.device, &read.buffer) {
            self.scene.windows.push(read.buffer);
        }
        Ok(())
    }

    fn staging(&mut self, bytes: u64) -> Result<Buffer> {
        self.scene.staging.take(&self.gpu, bytes)
    }

    fn fill(staging: &mut Buffer, parts: &[&[u32]]) -> bool {
        fill(staging, parts)
    }

    fn send(&mut self, from: Buffer, bytes: u64, to: &Buffer) -> Result<u64> {
        let staging = &mut self.scene.staging;
        staging.send(&self.gpu, (from, bytes), (to, 0))?;
        Ok(0)
    }

    fn send_key(&mut self, key: &KeyFrame, runs: &[Range<usize>], to: &Buffer) -> Result<u64> {
        for run in self.scene.points.others(runs) {
            let at = (run.start * size_of::<Point>()) as u64;
            write(&self.gpu, to, at, &key[run])?;
        }
        self.scene.points.copy_to(to);
        Ok(0)
    }

    fn has_ended(&self, last: LastUse, _: bool) -> Result<bool> {
        Ok(self.scene.encoder.is_past(last.ticket))
    }

    fn pipeline_maker(&self) -> Arc<Gpu> {
        Arc::clone(&self.gpu)
    }

    fn make_pipeline(gpu: &Arc<Gpu>, kernel: KernelCode) -> Result<Pipeline> {
        Pipeline::new(gpu, kernel)
    }

    fn slot(&self) -> Result<Slot> {
        Slot::new(&self.gpu)
    }

    /// Submits the recording, or leaves it in the program's encoder if one was lent.
    fn submit(
        &mut self,
        slot: &mut Slot,
        ticket: Ticket,
        positions: Option<(&Buffer, u64)>,
    ) -> Result<Option<HostCopy>> {
        let (place, (report, copy)) = if let Some(mut encoder) = self.take_encoder() {
            let encoded = self.encode(&mut encoder, (slot, Some(ticket)), positions);
            self.scene.encoder.encoder = Some(encoder);
            let encoded = encoded?;
            self.scene.encoder.under_way.push_back((ticket, None));
            (None, encoded)
        } else {
            let mut encoder = self.gpu.encoder("a frame")?;
            let encoded = self.encode(&mut encoder, (slot, None), positions)?;
            let place = self.gpu.submit([encoder]);
            (Some(place.inspect_err(|_| slot.recall())?), encoded)
        };
        slot.sent = Some((place, report));
        Ok(copy)
    }

    fn finish(&mut self, slot: &mut Slot, ticket: Ticket) -> Result<Finished> {
        self.scene.encoder.wait(&self.gpu, ticket)?;
        let finished = slot.finish()?;
        self.scene.encoder.finished(ticket);
        Ok(finished)
    }

    fn give_up_dropped(&mut self, slot: &mut Slot, ticket: Ticket) -> bool {
        let is_dropped = slot.give_up_dropped();
        if is_dropped {
            self.scene.encoder.dropped(ticket);
        }
        is_dropped
    }

    fn is_done(&self, slot: &Slot, _: Ticket) -> Result<bool> {
        self.gpu.poll()?;
        // After a failed wait there is no report, and another wait fails at once.
        let report = slot.sent.as_ref();
        report.map_or(Ok(true), |(_, mapping)| mapping.poll(&self.gpu))
    }

    fn has_arrived(&self, copy: &HostCopy) -> Result<bool> {
        self.gpu.poll()?;
        copy.mapping.poll(&self.gpu)
    }

    fn take(&mut self, copy: HostCopy, vertices: usize) -> Result<Snapshot> {
        Ok(self.scene.spares.lend(Arrived::new(copy, vertices)?))
    }

    fn unload(&mut self) -> Result<()> {
        self.gpu.wait_idle()?;
        self.scene = SceneState::default();
        Ok(())
    }

    fn wait_idle(&self) -> Result<()> {
        self.gpu.wait_idle()
    }
}
