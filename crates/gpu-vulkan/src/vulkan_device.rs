//! What Vulkan does for a backend.

use crate::gpu::{Gpu, Queue};
use crate::host_points::{HostPoints, KeysRead, PositionsCopy};
use crate::instance::{Host, all};
use crate::lent::Lent;
use crate::memory::{Buffer, BufferUse};
use crate::pipelines::Pipeline;
use crate::pool::{LastUse, Pool, Sender, Staging};
use crate::slot::Slot;
use crate::timeline::{Batch, Moment, Timeline, submit};
use crate::transfer::{Transfer, Windows, load};
use crate::validation::messages;
use backend::{Arithmetic, Device, DeviceBytes, Result, Snapshot, Spares, Ticket};
use bytemuck::Pod;
use geom::{KeyFrame, PointBuffer};
use gpu_common::{Clock, ComputeBackend, Finished, GpuDevice, KernelCode, LentRays, Options, Sent};
use shaders::{BufferName, Kernel, Packets};
use std::ops::Range;
use std::sync::Arc;

/// The backend that computes through Vulkan.
pub type VulkanBackend = ComputeBackend<VulkanDevice>;

/// A device of Vulkan's: frames on one queue, trees that go up and positions that come back on others.
pub struct VulkanDevice {
    backend: &'static str,
    /// Reaches a ticket's number when its submission is done.
    pub done: Timeline,
    /// Likewise, when the part of it is that positions wait for alone.
    first_part: Timeline,
    submitted: u64,
    pub(crate) compute: Arc<Queue>,
    /// Copies to the device.
    pub upload: Transfer,
    /// Copies to the host.
    pub readback: Transfer,
    pub(crate) windows: Windows,
    /// One a [`Sent`].
    pub(crate) senders: [Sender; 2],
    pub(crate) keys_read: KeysRead,
    /// Buffers that were too small.
    pub(crate) outgrown: Pool,
    spares: Spares<HostPoints>,
    /// The upload that the next submission has to wait for.
    pub(crate) arriving: Option<u64>,
    /// The copy (of `readback`) that reads what the recording overwrites.
    overwritten: Option<u64>,
    pub(crate) lent: Lent,
    /// The device and its memory.
    pub gpu: Arc<Gpu>,
}

impl VulkanDevice {
    /// The device of a backend of that name, for one scene: others may take it besides.
    pub fn over(gpu: &Arc<Gpu>, backend: &'static str) -> Result<Self> {
        let queues = gpu.take_queues();
        Ok(Self {
            backend,
            done: Timeline::new(gpu)?,
            first_part: Timeline::new(gpu)?,
            submitted: 0,
            compute: queues.compute,
            upload: Transfer::new(gpu, queues.upload)?,
            readback: Transfer::new(gpu, queues.readback)?,
            windows: Windows::default(),
            senders: Sender::all(gpu),
            keys_read: KeysRead::default(),
            outgrown: Pool::default(),
            spares: Spares::default(),
            arriving: None,
            overwritten: None,
            lent: Lent::default(),
            gpu: Arc::clone(gpu),
        })
    }

    /// Whether copies up and down each have a queue of their own.
    pub fn has_queues_for_copies(&self) -> bool {
        let [up, back] = [&self.upload.queue, &self.readback.queue];
        let is_own = |queue| !Arc::ptr_eq(queue, &self.compute);
        is_own(up) && is_own(back) && !Arc::ptr_eq(up, back)
    }

    /// That of a buffer given up now, which no recording has.
    pub(crate) fn last_use(&self) -> LastUse {
        LastUse {
            filled_at: self.upload.last,
            ticket: self.submitted,
        }
    }

    /// Sends the parts of a recording; others may wait for the first of two alone.
    fn submit_parts(&mut self, slot: &Slot, ticket: Ticket) -> Result<()> {
        let arrived = self.arriving.map(|value| self.upload.done.at(value));
        let unread = self.overwritten.map(|value| self.readback.done.at(value));
        let after = arrived.into_iter().chain(unread);
        let after: Vec<Moment> = after.chain(self.lent.waits()).collect();
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
        self.lent.are_awaited();
        self.submitted = ticket.0;
        self.outgrown.prune((&self.upload, &self.done))
    }
}

impl GpuDevice for VulkanDevice {
    type Buffer = Buffer;
    type Pipeline = Pipeline;
    type Maker = Arc<Gpu>;
    type Slot = Slot;
    type Copy = PositionsCopy;
    type Staging = Staging;

    fn open(options: &Options) -> Result<Self> {
        let host = Host::new(options.validation)?;
        let list = all(&host)?;
        let gpu = Gpu::open(host, &list, options, false)?;
        Self::over(&gpu, "vulkan")
    }

    fn beside(gpu: Arc<Gpu>) -> Result<Self> {
        Self::over(&gpu, "vulkan")
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

    fn max_buffer_bytes(&self) -> u64 {
        self.gpu.limits.buffer_bytes()
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
        // The recording may use it.
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

    fn write<T: Pod + Send>(
        &mut self,
        to: &mut Buffer,
        count: usize,
        row: impl Fn(usize) -> T + Sync,
    ) -> Result<()> {
        if to.is_lent() {
            return self.write_lent(to, count, row);
        }
        to.set_rows(count, row);
        Ok(())
    }

    fn read<T: Pod>(
        &mut self,
        from: &Buffer,
        count: usize,
        look: impl FnMut(usize, &[T]),
    ) -> Result<()> {
        let road = &mut self.readback;
        self.windows.read(&self.gpu, road, from, count, look)
    }

    fn send(&mut self, what: Sent, parts: &[&[u32]]) -> Result<(Buffer, u64)> {
        let road = (&mut self.upload, &self.done);
        self.senders[what as usize].send(road, parts)
    }

    fn staging(&mut self, what: Sent) -> Result<Option<Staging>> {
        let done = (&self.upload, &self.done);
        self.senders[what as usize].staging(done)
    }

    fn fill(staging: &mut Staging, parts: &[&[u32]]) -> bool {
        staging.fill(parts)
    }

    fn send_filled(&mut self, what: Sent, staging: Staging) -> Result<(Buffer, u64)> {
        let road = (&mut self.upload, &self.done);
        self.senders[what as usize].send_filled(road, staging)
    }

    fn point_buffer(&mut self, points: usize) -> Result<PointBuffer> {
        Ok(PointBuffer::Shared(Box::new(HostPoints::new(
            &self.gpu, points,
        )?)))
    }

    fn send_key(&mut self, key: &KeyFrame, moving: &[Range<usize>]) -> Result<(Buffer, u64)> {
        let (buffer, sent) = self.send_host_key(key, moving)?;
        let copied = self.copy_points(Some(&buffer))?;
        Ok((buffer, copied.unwrap_or(sent)))
    }

    fn has_been_sent(&self, arrival: u64) -> Result<bool> {
        self.upload.done.has_reached(arrival)
    }

    fn expect(&mut self, arrival: u64) {
        let arrival = Some(arrival).filter(|&value| value > 0);
        self.arriving = self.arriving.max(arrival);
    }

    fn recycle(&mut self, what: Sent, buffer: Buffer, unused_for: u64) {
        let last = LastUse {
            ticket: self.submitted.saturating_sub(unused_for),
            ..self.last_use()
        };
        self.senders[what as usize].free.put(buffer, last);
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
    ) -> Result<Option<PositionsCopy>> {
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
        let done_at = self
            .readback
            .start([from, &buffer], (0, bytes), Some(ready))?;
        Ok(Some(PositionsCopy { buffer, done_at }))
    }

    fn finish(&mut self, slot: &mut Slot, ticket: Ticket) -> Result<Finished> {
        self.done.wait(ticket.0)?;
        slot.finished()
    }

    fn has_arrived(&self, copy: &PositionsCopy) -> Result<bool> {
        self.readback.done.has_reached(copy.done_at)
    }

    fn overwrites(&mut self, copy: &PositionsCopy) {
        self.overwritten = self.overwritten.max(Some(copy.done_at));
    }

    fn take(&mut self, copy: PositionsCopy, vertices: usize) -> Result<Snapshot> {
        let (buffer, count) = (copy.buffer, vertices);
        Ok(self.spares.lend(HostPoints { buffer, count }))
    }

    fn abandon(&mut self) {
        self.overwritten = None;
    }

    fn unload(&mut self) -> Result<()> {
        self.wait_idle()?;
        (self.senders, self.outgrown) = (Sender::all(&self.gpu), Pool::default());
        self.keys_read = KeysRead::default();
        (self.spares, self.lent) = (Spares::default(), Lent::default());
        self.windows = Windows::default();
        (self.arriving, self.overwritten) = (None, None);
        Ok(())
    }

    fn wait_idle(&self) -> Result<()> {
        self.done.wait(self.submitted)?;
        self.upload.wait()?;
        self.readback.wait()?;
        self.lent.wait()
    }

    fn with_own_bytes(&self, bytes: DeviceBytes) -> DeviceBytes {
        let [[trees, staging], [keys, key_staging]] = self.senders.each_ref().map(Sender::held);
        let (tree, scene) = (bytes.tree + trees, bytes.scene + keys);
        let scratch = bytes.scratch + staging + key_staging + self.outgrown.held();
        // Whatever else there is.
        let others = tree + scratch + scene;
        DeviceBytes {
            tree,
            scratch,
            scene,
            frames: self.gpu.memory.held().saturating_sub(others),
        }
    }
}
