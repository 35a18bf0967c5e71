//! What wgpu does for a backend.

use crate::adapters::{driver, kind};
use crate::buffers::{Arrived, PositionsCopy, STORAGE, Windows, make, upload, write};
use crate::faults::layer_messages;
use crate::gpu::{CallCounts, Gpu};
use crate::lent::{DevicePoints, DeviceRays};
use crate::lent_encoder::LentEncoder;
use crate::limits::{LEAST_OF_64_BITS, check_kernels, span};
use crate::pipelines::Pipeline;
use crate::slot::Slot;
use crate::staging::{Filled, Staging};
use backend::{Arithmetic, Device, DeviceBytes, Result, Snapshot, Spares, Ticket};
use bytemuck::Pod;
use geom::{KeyFrame, Point};
use gpu_common::{Clock, ComputeBackend, Finished, GpuDevice, KernelCode, LentRays, Options, Sent};
use shaders::{BufferName, Kernel, Packets, Params};
use std::ops::Range;
use std::sync::Arc;
use wgpu::Buffer;

/// The backend that computes through wgpu.
pub type WgpuBackend = ComputeBackend<WgpuDevice>;

/// Computes on a device that an engine opened, with the features and limits it has: see [`crate::required_features`],
/// [`crate::useful_features`] and [`crate::required_limits`]. The engine's error handler and its callback for a lost device
/// are left alone.
///
/// # Errors
/// [`BackendError::Limit`](backend::BackendError::Limit) with the limit that the device does not reach,
/// or [`BackendError::NoDevice`](backend::BackendError::NoDevice) if its arithmetic is wrong.
pub fn from_device(
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
) -> Result<WgpuBackend> {
    let gpu = Gpu::lent(device, queue, info)?;
    ComputeBackend::over(WgpuDevice::over(Arc::new(gpu)))
}

/// A device of wgpu's, with its one queue: what is written to a buffer or copied goes in order with submissions.
pub struct WgpuDevice {
    pub(crate) scene: SceneState,
    /// What the program's shaders read last.
    pub(crate) module: Option<(Params, Buffer)>,
    pub(crate) gpu: Arc<Gpu>,
}

/// What is let go of with a scene.
#[derive(Default)]
pub(crate) struct SceneState {
    windows: Windows,
    staging: Staging,
    /// Bytes that were sent last, of each [`Sent`].
    last_sent: [u64; 2],
    /// Buffers that are not in use, of each [`Sent`].
    free: [Vec<Buffer>; 2],
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

    /// A buffer for so many bytes, and whether it held another thing of its kind.
    fn room(&mut self, what: Sent, bytes: u64) -> Result<(Buffer, bool)> {
        let spare = self.scene.free[what as usize].pop();
        match spare.filter(|buffer| buffer.size() >= bytes) {
            Some(buffer) => Ok((buffer, true)),
            None => {
                let made = make(&self.gpu, what.what(), what.room(bytes), STORAGE)?;
                Ok((made, false))
            }
        }
    }

    /// What was asked of wgpu since the device was opened.
    #[must_use]
    pub fn call_counts(&self) -> CallCounts {
        self.gpu.call_counts()
    }
}

impl GpuDevice for WgpuDevice {
    type Buffer = Buffer;
    type Pipeline = Pipeline;
    type Maker = Arc<Gpu>;
    type Slot = Slot;
    type Copy = PositionsCopy;
    type Staging = Filled;

    fn open(options: &Options) -> Result<Self> {
        Gpu::open(options).map(|gpu| Self::over(Arc::new(gpu)))
    }

    fn beside(gpu: Arc<Gpu>) -> Result<Self> {
        Ok(Self::over(gpu))
    }

    fn device(&self) -> Device {
        let info = &self.gpu.info;
        Device {
            backend: "wgpu",
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

    fn max_buffer_bytes(&self) -> u64 {
        span(&self.gpu.limits)
    }

    fn check_kernels(&self, wanted: &dyn Fn(&Kernel) -> bool) -> Result<()> {
        check_kernels(&self.gpu.limits, wanted)
    }

    fn buffer(&self, name: BufferName, bytes: u64) -> Result<Buffer> {
        make(&self.gpu, name.name(), bytes, STORAGE)
    }

    fn size(buffer: &Buffer) -> u64 {
        buffer.size()
    }

    fn take_lent_rays(&mut self) -> Option<LentRays<Buffer>> {
        self.scene.rays.due.pop_front()
    }

    fn buffers_made(&self) -> u64 {
        self.call_counts().buffers
    }

    /// wgpu passes on the layer's errors in builds with debug assertions alone, and for the process as a whole. Where the layer
    /// is not installed, it has nothing to say.
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

    fn write<T: Pod + Send>(
        &mut self,
        to: &mut Buffer,
        count: usize,
        row: impl Fn(usize) -> T + Sync,
    ) -> Result<()> {
        self.scene.staging.write(&self.gpu, to, count, row)
    }

    fn read<T: Pod>(
        &mut self,
        from: &Buffer,
        count: usize,
        look: impl FnMut(usize, &[T]),
    ) -> Result<()> {
        self.scene.windows.read(&self.gpu, from, count, look)
    }

    fn send(&mut self, what: Sent, parts: &[&[u32]]) -> Result<(Buffer, u64)> {
        let bytes = parts.iter().map(|p| size_of_val(*p) as u64).sum();
        let mut filled = self.scene.staging.take(&self.gpu, what.room(bytes))?;
        match filled.fill(parts) {
            true => self.send_filled(what, filled),
            false => Err(self.gpu.faults.lose("nothing can be written".into())),
        }
    }

    fn staging(&mut self, what: Sent) -> Result<Option<Filled>> {
        match self.scene.last_sent[what as usize] {
            0 => Ok(None),
            bytes => self
                .scene
                .staging
                .take(&self.gpu, what.room(bytes))
                .map(Some),
        }
    }

    fn fill(staging: &mut Filled, parts: &[&[u32]]) -> bool {
        staging.fill(parts)
    }

    fn send_filled(&mut self, what: Sent, filled: Filled) -> Result<(Buffer, u64)> {
        let (buffer, _) = self.room(what, filled.bytes)?;
        self.scene.last_sent[what as usize] = filled.bytes;
        self.scene.staging.send(&self.gpu, filled, (&buffer, 0))?;
        Ok((buffer, 0))
    }

    fn send_key(&mut self, key: &KeyFrame, moving: &[Range<usize>]) -> Result<(Buffer, u64)> {
        let (buffer, held_another) = self.room(Sent::KeyFrame, size_of_val(&key[..]) as u64)?;
        let all = 0..key.len();
        let all = std::slice::from_ref(&all);
        let runs = if held_another { moving } else { all };
        for run in self.scene.points.others(runs) {
            let at = (run.start * size_of::<Point>()) as u64;
            write(&self.gpu, &buffer, at, &key[run])?;
        }
        self.scene.points.copy_to(&buffer);
        Ok((buffer, 0))
    }

    fn recycle(&mut self, what: Sent, buffer: Buffer, _: u64) {
        if !self.scene.encoder.holds(what, &buffer) {
            self.scene.free[what as usize].push(buffer);
        }
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

    fn submit(
        &mut self,
        slot: &mut Slot,
        ticket: Ticket,
        positions: Option<(&Buffer, u64)>,
    ) -> Result<Option<PositionsCopy>> {
        self.submit_or_leave(slot, ticket, positions)
    }

    fn finish(&mut self, slot: &mut Slot, ticket: Ticket) -> Result<Finished> {
        self.scene.encoder.wait(&self.gpu, ticket)?;
        let finished = slot.finish(&self.gpu)?;
        for (what, buffer) in self.scene.encoder.finished(ticket) {
            self.scene.free[what as usize].push(buffer);
        }
        Ok(finished)
    }

    fn poll(&mut self) -> Result<()> {
        self.gpu.poll()
    }

    fn has_arrived(&self, copy: &PositionsCopy) -> Result<bool> {
        copy.mapping.poll(&self.gpu)
    }

    fn take(&mut self, copy: PositionsCopy, vertices: usize) -> Result<Snapshot> {
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

    /// Of buffers that kernels use: an engine's own on a lent device do not count, nor does memory of the host.
    fn with_own_bytes(&self, bytes: DeviceBytes) -> DeviceBytes {
        let size = |all: &Vec<Buffer>| all.iter().map(Buffer::size).sum::<u64>();
        let [trees, keys] = self.scene.free.each_ref().map(size);
        DeviceBytes {
            tree: bytes.tree + trees,
            scene: bytes.scene + keys,
            ..bytes
        }
    }
}
