//! The implementation of [`GpuDevice`] for Vulkan.

use crate::gpu::{Gpu, Queue};
use crate::instance::{Host, all};
use crate::lent::Lent;
use crate::memory::{Buffer, BufferUse};
use crate::pipelines::Pipeline;
use crate::slot::Slot;
use crate::staging::{HostCopy, HostPoints, KeysRead, Staging, fill, has_ended};
use crate::timeline::{Batch, Moment, Timeline, submit};
use crate::transfer::{Transfer, load};
use crate::validation::messages;
use backend::{Arithmetic, BackendName, Device, DeviceBytes, Result, Snapshot, Spares, Ticket};
use bytemuck::Pod;
use geom::{KeyFrame, PointBuffer};
use gpu_common::{
    Clock, ComputeBackend, Finished, GpuDevice, KernelCode, LastUse, LentRays, Options, Pool,
};
use shaders::{BufferName, Kernel, Packets};
use std::ops::Range;
use std::sync::Arc;

/// The backend that computes through Vulkan.
pub type VulkanBackend = ComputeBackend<VulkanDevice>;

/// A Vulkan device for one scene: a queue for frames, and queues for uploads and readbacks.
pub struct VulkanDevice {
    backend: &'static str,
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
    /// Host-visible buffers for reads of device buffers.
    windows: Vec<Buffer>,
    tree_staging: Staging,
    pub(crate) key_staging: Staging,
    pub(crate) keys_read: KeysRead,
    /// Discarded buffers that may still be in use.
    pub(crate) outgrown: Pool<Self>,
    spares: Spares<HostPoints>,
    /// The upload that the next submission must wait for.
    pub(crate) arriving: Option<u64>,
    /// The value of `readback` for the copy whose source the recording overwrites.
    overwritten: Option<u64>,
    pub(crate) lent: Lent,
    /// The logical device and its memory.
    pub gpu: Arc<Gpu>,
}

impl VulkanDevice {
    /// Creates the device of one scene for the backend of this name. Other scenes may share `gpu`.
    pub fn over(gpu: &Arc<Gpu>, backend: &'static str) -> Result<Self> {
        let queues = gpu.queues.clone();
        Ok(Self {
            backend,
            done: Timeline::new(gpu)?,
            first_part: Timeline::new(gpu)?,
            submitted: 0,
            compute: queues.compute,
            upload: Transfer::new(gpu, queues.upload)?,
            readback: Transfer::new(gpu, queues.readback)?,
            windows: Vec::new(),
            tree_staging: Staging::new("the tree's record"),
            key_staging: Staging::new("key frames"),
            keys_read: KeysRead::default(),
            outgrown: Pool::default(),
            spares: Spares::default(),
            arriving: None,
            overwritten: None,
            lent: Lent::default(),
            gpu: Arc::clone(gpu),
        })
    }

    /// Returns whether uploads and readbacks each have a queue of their own.
    pub fn has_queues_for_copies(&self) -> bool {
        let [up, back] = [&self.upload.queue, &self.readback.queue];
        let is_own = |queue| !Arc::ptr_eq(queue, &self.compute);
        is_own(up) && is_own(back) && !Arc::ptr_eq(up, back)
    }

    fn copy_to_window(&mut self, from: &Buffer, bytes: Range<u64>) -> Result<HostCopy> {
        let size = bytes.end - bytes.start;
        let buffer = match self.windows.iter().position(|w| w.bytes >= size) {
            Some(i) => self.windows.swap_remove(i),
            None => {
                self.windows.pop();
                let what = "a view for the host";
                Buffer::new(&self.gpu, what, size, BufferUse::Readback)?
            }
        };
        let done_at = self.readback.start([from, &buffer], &[(bytes, 0)], None)?;
        Ok(HostCopy { buffer, done_at })
    }

    /// Returns the last use of a buffer that is discarded now and not part of the recording.
    pub(crate) fn last_use(&self) -> LastUse {
        LastUse {
            arrival: self.upload.last,
            ticket: self.submitted,
        }
    }

    /// Submits the parts of a recording. Copies of positions wait only for the first of two parts.
    fn submit_parts(&mut self, slot: &Slot, ticket: Ticket) -> Result<()> {
        let arrived = self.arriving.map(|value| self.upload.done.at(value));
        let unread = self.overwritten.map(|value| self.readback.done.at(value));
        let after = arrived.into_iter().chain(unread);
        let after: Vec<Moment> = after.chain(self.lent.waits.iter().copied()).collect();
        let parts = slot.commands.all();
        let batch = |(i, &commands)| Batch {
            commands: Some(commands),
            after: if i == 0 { &after } else { &[] },
            done: match i + 1 == parts.len() {
                true => self.done.at(ticket.0),
                false => self.first_part.at(ticket.0),
            },
        };
        let batches: Vec<_> = parts.iter().enumerate().map(batch).collect();
        submit(&self.gpu, &self.compute, &batches)?;
        (self.arriving, self.overwritten) = (None, None);
        // Later submissions to the queue wait as well.
        self.lent.waits.clear();
        self.submitted = ticket.0;
        let done = (&self.upload, &self.done);
        self.outgrown.prune(|last| has_ended(done, last, false))
    }
}

impl GpuDevice for VulkanDevice {
    type Buffer = Buffer;
    type Pipeline = Pipeline;
    type Maker = Arc<Gpu>;
    type Slot = Slot;
    type Copy = HostCopy;

    fn open(options: &Options) -> Result<Self> {
        let host = Host::new(options.validation)?;
        let list = all(&host)?;
        let gpu = Gpu::open(host, &list, options, false)?;
        Self::over(&gpu, BackendName::Vulkan.name())
    }

    fn beside(gpu: Arc<Gpu>) -> Result<Self> {
        Self::over(&gpu, BackendName::Vulkan.name())
    }

    fn device(&self) -> Device {
        let adapter = &self.gpu.adapter;
        Device {
            backend: self.backend,
            adapter: adapter.name.clone(),
            driver: adapter.driver.clone(),
            kind: adapter.kind,
            threads: 0,
            arithmetic: Arithmetic::IEEE,
        }
    }

    fn forms(&self) -> (Option<Packets>, bool) {
        let extras = self.gpu.extras;
        let subgroups = extras.subgroups.map(|size| (size, size));
        let packets = Packets::for_device(subgroups, self.gpu.is_software());
        (packets, extras.has_least_of_64_bits)
    }

    fn clock(&self) -> Clock {
        Clock::new(self.gpu.timestamp_bits, self.gpu.limits.tick_ns)
    }

    fn max_groups(&self) -> u32 {
        self.gpu.limits.groups
    }

    fn check_kernels(&self, wanted: &dyn Fn(&Kernel) -> bool) -> Result<()> {
        self.gpu.limits.admit_kernels(wanted)
    }

    fn buffer(&self, name: BufferName, bytes: u64) -> Result<Buffer> {
        let place = match name {
            BufferName::Rays => BufferUse::Upload,
            _ => BufferUse::Device,
        };
        Buffer::new(&self.gpu, name.name(), bytes, place)
    }

    fn room(&self, what: &'static str, bytes: u64) -> Result<Buffer> {
        Buffer::new(&self.gpu, what, bytes, BufferUse::Device)
    }

    fn size(buffer: &Buffer) -> u64 {
        buffer.bytes
    }

    fn held(buffer: &Buffer) -> u64 {
        buffer.held()
    }

    fn free_bytes(&self) -> Option<u64> {
        self.gpu.memory.free_bytes(&self.gpu.host)
    }

    fn discard(&mut self, buffer: Buffer) {
        // The recording may use the buffer.
        let last = LastUse {
            ticket: self.submitted + 1,
            ..self.last_use()
        };
        self.outgrown.put(buffer, last);
    }

    fn take_lent_rays(&mut self) -> Option<LentRays<Buffer>> {
        self.lent.rays.take()
    }

    fn buffers_made(&self) -> u64 {
        self.gpu.memory.made()
    }

    fn complaints(&self) -> Vec<String> {
        messages().clone()
    }

    fn upload(&mut self, all: &[(&[u8], &Buffer)]) -> Result<()> {
        load(&self.gpu, &mut self.upload, all)
    }

    fn write<T: Pod + Send + Sync>(&mut self, to: &mut Buffer, rows: &[T]) -> Result<()> {
        if to.is_lent() {
            return self.write_lent(to, rows);
        }
        to.set_rows(rows);
        Ok(())
    }

    fn begin_read(&mut self, from: &Buffer, bytes: Range<u64>) -> Result<HostCopy> {
        let begun = self.copy_to_window(from, bytes);
        if begun.is_err() {
            // Copies that are under way are dropped with the failed read.
            self.readback.wait()?;
        }
        begun
    }

    fn end_read(&mut self, copy: HostCopy, bytes: usize, look: impl FnOnce(&[u8])) -> Result<()> {
        self.readback.done.wait(copy.done_at)?;
        look(copy.buffer.read(bytes));
        self.windows.push(copy.buffer);
        Ok(())
    }

    fn staging(&mut self, bytes: u64) -> Result<Buffer> {
        let done = (&self.upload, &self.done);
        self.tree_staging.take(&self.gpu, done, bytes)
    }

    fn fill(staging: &mut Buffer, parts: &[&[u32]]) -> bool {
        fill(staging, parts)
    }

    fn send(&mut self, from: Buffer, bytes: u64, to: &Buffer) -> Result<u64> {
        let road = &mut self.upload;
        self.tree_staging.send(road, (from, bytes), to)
    }

    fn point_buffer(&mut self, points: usize) -> Result<PointBuffer> {
        Ok(PointBuffer::Shared(Box::new(HostPoints::new(
            &self.gpu, points,
        )?)))
    }

    fn send_key(&mut self, key: &KeyFrame, runs: &[Range<usize>], to: &Buffer) -> Result<u64> {
        let sent = self.send_host_key(key, &self.lent.others(runs), to)?;
        let copied = self.copy_points(Some(to))?;
        Ok(copied.unwrap_or(sent))
    }

    fn has_ended(&self, last: LastUse, may_wait: bool) -> Result<bool> {
        has_ended((&self.upload, &self.done), last, may_wait)
    }

    fn expect(&mut self, arrival: u64) {
        let arrival = Some(arrival).filter(|&value| value > 0);
        self.arriving = self.arriving.max(arrival);
    }

    fn pipeline_maker(&self) -> Arc<Gpu> {
        Arc::clone(&self.gpu)
    }

    fn make_pipeline(gpu: &Arc<Gpu>, (kernel, code): KernelCode) -> Result<Pipeline> {
        Pipeline::new(gpu, kernel, code.spirv)
    }

    fn slot(&self) -> Result<Slot> {
        Slot::new(&self.gpu)
    }

    fn submit(
        &mut self,
        slot: &mut Slot,
        ticket: Ticket,
        positions: Option<(&Buffer, u64)>,
    ) -> Result<Option<HostCopy>> {
        let to = positions.map(|(_, bytes)| {
            let spare = self.spares.pop().map(|points| points.buffer);
            let made = || {
                let what = "vertices for the builder";
                Buffer::new(&self.gpu, what, bytes, BufferUse::Readback)
            };
            spare.filter(|b| b.bytes >= bytes).map_or_else(made, Ok)
        });
        let to = to.transpose()?;
        slot.end()?;
        self.submit_parts(slot, ticket)?;
        let Some(((from, bytes), buffer)) = positions.zip(to) else {
            return Ok(None);
        };
        let ready = self.first_part.at(ticket.0);
        let all = [(0..bytes, 0)];
        let done_at = self.readback.start([from, &buffer], &all, Some(ready))?;
        Ok(Some(HostCopy { buffer, done_at }))
    }

    fn finish(&mut self, slot: &mut Slot, ticket: Ticket) -> Result<Finished> {
        self.done.wait(ticket.0)?;
        slot.finished()
    }

    fn is_done(&self, _: &Slot, ticket: Ticket) -> Result<bool> {
        self.done.has_reached(ticket.0)
    }

    fn has_arrived(&self, copy: &HostCopy) -> Result<bool> {
        self.readback.done.has_reached(copy.done_at)
    }

    fn overwrites(&mut self, copy: &HostCopy) {
        self.overwritten = self.overwritten.max(Some(copy.done_at));
    }

    fn take(&mut self, copy: HostCopy, vertices: usize) -> Result<Snapshot> {
        let (buffer, count) = (copy.buffer, vertices);
        Ok(self.spares.lend(HostPoints { buffer, count }))
    }

    fn unload(&mut self) -> Result<()> {
        self.wait_idle()?;
        self.tree_staging.free = Pool::default();
        self.key_staging.free = Pool::default();
        self.outgrown = Pool::default();
        self.keys_read = KeysRead::default();
        (self.spares, self.lent) = (Spares::default(), Lent::default());
        self.windows.clear();
        (self.arriving, self.overwritten) = (None, None);
        Ok(())
    }

    fn wait_idle(&self) -> Result<()> {
        self.done.wait(self.submitted)?;
        self.upload.wait()?;
        self.readback.wait()?;
        self.lent.wait()?;
        if self.gpu.is_software() {
            self.compute.wait_idle(&self.gpu)?;
        }
        Ok(())
    }

    fn with_own_bytes(&self, bytes: DeviceBytes) -> DeviceBytes {
        let staging = [&self.tree_staging, &self.key_staging].map(|s| s.free.held());
        let waiting = staging.iter().sum::<u64>() + self.outgrown.held();
        let scratch = bytes.scratch + waiting;
        // All other buffers.
        let others = bytes.tree + scratch + bytes.scene;
        DeviceBytes {
            scratch,
            frames: self.gpu.memory.held().saturating_sub(others),
            ..bytes
        }
    }
}
