//! What a GPU interface has to do.

use crate::{Clock, KernelCode, LastUse, Stage};
use backend::{Device, DeviceBytes, Result, Snapshot, Ticket};
use bytemuck::Pod;
use geom::{KeyFrame, PointBuffer};
use shaders::work::Work;
use shaders::{BufferName, Counts, Kernel, Packets};
use std::ops::Range;
use std::path::PathBuf;

/// How to open a device.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// An adapter's index; the first GPU, else the first adapter, if not given.
    pub adapter: Option<usize>,
    /// Folder in which compiled kernels are kept for runs to come, where the device can; nothing is kept without one.
    pub cache: Option<PathBuf>,
    /// Whether to run under the interface's validation layer.
    pub validation: Validation,
    /// Whether kernels go in as WGSL with checks of bounds and loops added, where the interface takes that. Else they are SPIR-V
    /// where the device takes it, or WGSL without checks.
    pub checks_kernels: bool,
}

/// Whether to run under a validation layer, with synchronisation validation where the interface has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validation {
    /// Without it.
    #[default]
    Off,
    /// With it where it is installed.
    IfInstalled,
    /// With it, or not at all. wgpu cannot tell whether it is installed.
    Required,
}

/// A kernel to be recorded.
pub struct Dispatch<'a, D: GpuDevice> {
    /// Its parameters, and whether it may run beside the one before it.
    pub work: &'a Work,
    /// What was made of its kernel.
    pub pipeline: &'a D::Pipeline,
    /// Workgroups along both axes.
    pub groups: [u32; 2],
}

/// Gives the buffers of a dispatch, but for parameters and counts, which are the slot's.
pub type Find<'f, 'a, B> = &'f dyn Fn(BufferName) -> &'a B;

/// What a finished submission left behind.
#[derive(Clone, Debug, Default)]
pub struct Finished {
    /// What its kernels counted.
    pub counts: Counts,
    /// For each mark of time what runs from it to the next; `None` where nothing does that is timed.
    pub marks: Vec<Option<Stage>>,
    /// When each mark was passed, in ticks of [`GpuDevice::clock`]; `None` without a clock.
    pub ticks: Option<Vec<u64>>,
}

/// Rays that the device's owner has there, and room for what they meet: see [`backend::Rays::OnDevice`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LentRays<B> {
    /// One a ray, as [`geom::Ray`] lies in memory.
    pub rays: B,
    /// As [`geom::Hit`] lies in memory, or a word that is not 0 for any hit; none if the backend is to have it.
    pub answers: Option<B>,
}

/// Positions that the device's owner has there, on their way to a key frame: from a byte of a buffer to a byte of another.
pub struct PointsCopy<B> {
    /// Where they are.
    pub from: (B, u64),
    /// Where they belong.
    pub to: (B, u64),
    /// How much they take.
    pub bytes: u64,
}

/// A device that runs kernels, for one scene. That has one owner, so nothing of it needs a lock but what others share.
///
/// Only `upload`, `end_read`, `finish`, `unload`, `wait_idle` and what hands out used buffers (`has_ended`, `staging`,
/// `send_key`) may wait, for what this scene had the device do. Submissions run in their order; what is recorded reads what
/// was recorded before. Where copies have queues of their own, the device puts them in order with the submissions that need
/// them; what does nothing here is for such devices.
pub trait GpuDevice: Send + Sized + 'static {
    /// A buffer. Dropping one need not wait: see [`GpuDevice::discard`].
    type Buffer: Send + 'static;
    /// A kernel ready to be bound.
    type Pipeline: Send + Sync + 'static;
    /// On any thread, makes kernels ready beside the device's owner, or has the device take [another scene](GpuDevice::beside).
    type Maker: Send + Sync + 'static;
    /// What one submission needs for itself.
    type Slot: GpuSlot<Self>;
    /// Positions, or other bytes, on their way to the host.
    type Copy: Send;

    /// Opens a device.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] with the reason, or [`backend::BackendError::Limit`] with what the device lacks for
    /// any scene. What else may go wrong, here and in all other methods: see [`backend::BackendError`].
    fn open(options: &Options) -> Result<Self>;

    /// The device of a maker for another scene, which is traced beside those that it has.
    fn beside(maker: Self::Maker) -> Result<Self>;

    /// Who is at work. How it computes is found out later.
    fn device(&self) -> Device;

    /// How invocations search together, and whether pictures may be rasterized: see [`shaders::Traits`].
    fn forms(&self) -> (Option<Packets>, bool);

    /// The clock of its marks.
    fn clock(&self) -> Clock;

    /// Workgroups that a dispatch may have along an axis.
    fn max_groups(&self) -> u32;

    /// Refuses, by the limit's name, a device on which one of these kernels cannot run.
    fn check_kernels(&self, wanted: &dyn Fn(&Kernel) -> bool) -> Result<()>;

    /// A buffer of so many bytes, and of at least 16, so that an empty scene has buffers to bind. The host
    /// [writes](GpuDevice::write) [`BufferName::Rays`]; the others kernels write, or the host while nothing is under way. What
    /// is too large is refused with the need.
    fn buffer(&self, name: BufferName, bytes: u64) -> Result<Self::Buffer>;

    /// Likewise, of a name for messages, to [send](GpuDevice::send) to.
    fn room(&self, what: &'static str, bytes: u64) -> Result<Self::Buffer>;

    /// Bytes that kernels may use.
    fn size(buffer: &Self::Buffer) -> u64;

    /// Bytes that it takes of the device's memory.
    fn held(buffer: &Self::Buffer) -> u64 {
        Self::size(buffer)
    }

    /// Bytes of the device's memory that may still be had, where the driver tells.
    fn free_bytes(&self) -> Option<u64> {
        None
    }

    /// Drops a buffer once all that was recorded so far is done with it.
    fn discard(&mut self, _buffer: Self::Buffer) {}

    /// The rays that its owner told it of last, once.
    fn take_lent_rays(&mut self) -> Option<LentRays<Self::Buffer>>;

    /// Whether it may ever have a kernel [copy positions](GpuDevice::take_copies).
    const COPIES: bool = false;

    /// Positions that a kernel is to copy before key frames are read, once.
    fn take_copies(&mut self) -> Vec<PointsCopy<Self::Buffer>> {
        Vec::new()
    }

    /// Buffers made so far, of any purpose.
    fn buffers_made(&self) -> u64;

    /// See [`backend::Inspect::complaints`].
    fn complaints(&self) -> Vec<String>;

    /// Fills buffers from their beginning, and waits until that is done.
    fn upload(&mut self, all: &[(&[u8], &Self::Buffer)]) -> Result<()>;

    /// Fills so many rows of a buffer of rays, or of answers lent with them, for the next submission, by all threads. Nothing
    /// under way may use it.
    fn write<T: Pod + Send>(
        &mut self,
        to: &mut Self::Buffer,
        count: usize,
        row: impl Fn(usize) -> T + Sync,
    ) -> Result<()>;

    /// Begins to copy bytes of a buffer to the host. What fills the buffer must be finished.
    fn begin_read(&mut self, from: &Self::Buffer, bytes: Range<u64>) -> Result<Self::Copy>;

    /// Waits for a copy of so many bytes, and shows them.
    fn end_read(&mut self, copy: Self::Copy, bytes: usize, look: impl FnOnce(&[u8])) -> Result<()>;

    /// Shows the first `count` elements of a buffer in parts, each with the number of those before it: one is looked at while
    /// the next ones are copied.
    fn read<T: Pod>(
        &mut self,
        from: &Self::Buffer,
        count: usize,
        mut look: impl FnMut(usize, &[T]),
    ) -> Result<()> {
        const BYTES: usize = 8 << 20;
        let most = BYTES / size_of::<T>();
        let parts = (0..count).step_by(most);
        let parts = parts.map(|start| start..count.min(start + most));
        let begun = parts.map(|part| {
            let bytes = [part.start, part.end].map(|n| (n * size_of::<T>()) as u64);
            Ok((self.begin_read(from, bytes[0]..bytes[1])?, part))
        });
        for (copy, part) in begun.collect::<Result<Vec<_>>>()? {
            let bytes = part.len() * size_of::<T>();
            self.end_read(copy, bytes, |bytes| {
                look(part.start, bytemuck::cast_slice(bytes));
            })?;
        }
        Ok(())
    }

    /// Likewise, all of them together.
    fn read_all<T: Pod>(&mut self, from: &Self::Buffer, count: usize) -> Result<Vec<T>> {
        let mut all = Vec::with_capacity(count);
        self.read(from, count, |_, part| all.extend_from_slice(part))?;
        Ok(all)
    }

    /// Memory of the host to send a tree of so many bytes from, and perhaps a larger one.
    fn staging(&mut self, bytes: u64) -> Result<Self::Buffer>;

    /// Writes what is to be sent, part by part, on any thread; says whether there was room.
    fn fill(staging: &mut Self::Buffer, parts: &[&[u32]]) -> bool;

    /// Begins to send so many bytes that were filled, beside the frames. Gives a number to be [expected](GpuDevice::expect)
    /// before they are read. Never copies on this thread.
    fn send(&mut self, from: Self::Buffer, bytes: u64, to: &Self::Buffer) -> Result<u64>;

    /// Memory for a key frame that is [sent](GpuDevice::send_key) from there.
    fn point_buffer(&mut self, points: usize) -> Result<PointBuffer> {
        Ok(vec![[0.0; 3]; points].into())
    }

    /// As [`GpuDevice::send`], of runs of a key frame's vertices.
    fn send_key(&mut self, key: &KeyFrame, runs: &[Range<usize>], to: &Self::Buffer)
    -> Result<u64>;

    /// Whether a buffer's last use is over, so that others may follow. Waits for that only if it `may_wait`.
    fn has_ended(&self, last: LastUse, may_wait: bool) -> Result<bool>;

    /// The next submission waits until this was sent, and all before it.
    fn expect(&mut self, _arrival: u64) {}

    /// What makes kernels ready.
    fn pipeline_maker(&self) -> Self::Maker;

    /// Makes a kernel ready; several threads may do so at a time.
    fn make_pipeline(maker: &Self::Maker, kernel: KernelCode) -> Result<Self::Pipeline>;

    /// What a submission needs for itself.
    fn slot(&self) -> Result<Self::Slot>;

    /// Submits a recording. Where `positions` are given with their bytes, has them copied to the host.
    fn submit(
        &mut self,
        slot: &mut Self::Slot,
        ticket: Ticket,
        positions: Option<(&Self::Buffer, u64)>,
    ) -> Result<Option<Self::Copy>>;

    /// Waits for a submission, and says what it left behind. Asked once for each, in their order.
    fn finish(&mut self, slot: &mut Self::Slot, ticket: Ticket) -> Result<Finished>;

    /// Forgets a submission if the program dropped the commands that hold it, so that it never runs. Returns whether it did.
    fn give_up_dropped(&mut self, _slot: &mut Self::Slot, _ticket: Ticket) -> bool {
        false
    }

    /// Returns whether a submission is done, so that [`GpuDevice::finish`] would not wait. Never waits.
    fn is_done(&self, slot: &Self::Slot, ticket: Ticket) -> Result<bool>;

    /// Whether positions have arrived. Never waits.
    fn has_arrived(&self, copy: &Self::Copy) -> Result<bool>;

    /// Notes that the next submission overwrites what a copy reads.
    fn overwrites(&mut self, _copy: &Self::Copy) {}

    /// Positions that have arrived, which may outlive the device.
    fn take(&mut self, copy: Self::Copy, vertices: usize) -> Result<Snapshot>;

    /// Waits for all that is under way, and lets go of all that belongs to the scene, but for what [slots](GpuSlot::forget) have.
    fn unload(&mut self) -> Result<()>;

    /// Waits until the device has nothing left to do.
    fn wait_idle(&self) -> Result<()>;

    /// Adds what the device keeps by itself to the bytes of the buffers that were made for a scene and its frames. An engine's
    /// own on a lent device do not count, nor does memory of the host.
    fn with_own_bytes(&self, bytes: DeviceBytes) -> DeviceBytes {
        bytes
    }
}

/// Commands, parameters, counts and marks of time of one submission.
pub trait GpuSlot<D: GpuDevice>: Send {
    /// Whether positions set out while the rest of their submission runs: then a recording is [split](GpuSlot::split).
    const SPLITS: bool = false;

    /// Begins a recording, with all counts 0 and a mark of time. The last submission must have been finished.
    fn begin(&mut self) -> Result<()>;

    /// Records dispatches, each after those before it unless [`Work::alongside`] says otherwise.
    /// The first may run beside the last of the call before, if it says so and no stage was ended between.
    fn dispatch(&mut self, all: &[Dispatch<'_, D>], find: Find<'_, '_, D::Buffer>) -> Result<()>;

    /// Ends a stage: all that was recorded since the last one ended is timed as its work.
    fn end_stage(&mut self, stage: Stage) -> Result<()>;

    /// Records that the first so many bytes of counts are 0 again.
    fn clear_counts(&mut self, bytes: u64) -> Result<()>;

    /// Ends the part of a recording for which positions that go to the host wait, and begins the rest.
    fn split(&mut self) -> Result<()> {
        Ok(())
    }

    /// Lets go of all that belongs to the scene.
    fn forget(&mut self) {}

    /// Bytes of device memory, unless the device counts them.
    fn bytes(&self) -> u64 {
        0
    }
}
