//! The operations that a GPU interface implements.

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
    /// Index of an adapter. By default the first GPU, or the first adapter if there is no GPU.
    pub adapter: Option<usize>,
    /// Folder for compiled kernels, if the device can store them. By default nothing is stored.
    pub cache: Option<PathBuf>,
    /// Use of the interface's validation layer.
    pub validation: Validation,
    /// Whether to pass kernels as WGSL with checks of bounds and loops, if the interface accepts it. Otherwise they are
    /// passed as SPIR-V if the device accepts it, or as WGSL without checks.
    pub checks_kernels: bool,
}

/// Use of a validation layer, including synchronisation validation if the interface has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validation {
    /// Without the layer.
    #[default]
    Off,
    /// With the layer if it is installed.
    IfInstalled,
    /// With the layer; opening fails if it is not installed. wgpu cannot detect whether it is installed.
    Required,
}

/// A kernel to record.
pub struct Dispatch<'a, D: GpuDevice> {
    /// Its parameters, and whether it may run concurrently with the previous kernel.
    pub work: &'a Work,
    /// Pipeline of the kernel.
    pub pipeline: &'a D::Pipeline,
    /// Number of workgroups along both axes.
    pub groups: [u32; 2],
}

/// Returns the buffers of a dispatch by name. The slot owns those of parameters and counts.
pub type Find<'f, 'a, B> = &'f dyn Fn(BufferName) -> &'a B;

/// Output of a finished submission.
#[derive(Clone, Debug, Default)]
pub struct Finished {
    /// Counts written by its kernels.
    pub counts: Counts,
    /// For each timestamp, the stage that runs from it to the next; `None` for work that is not timed.
    pub marks: Vec<Option<Stage>>,
    /// Value of each timestamp, in ticks of [`GpuDevice::clock`]; `None` without a clock.
    pub ticks: Option<Vec<u64>>,
}

/// Buffers of the device's owner with rays and memory for their results. See [`backend::Rays::OnDevice`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LentRays<B> {
    /// One ray per element, in the memory layout of [`geom::Ray`].
    pub rays: B,
    /// One result per ray: [`geom::Hit`] in its memory layout, or for any-hit queries a word that is not 0 for a hit.
    /// `None` if the backend allocates the results.
    pub answers: Option<B>,
}

/// A copy of positions from a buffer of the device's owner to a key frame. Both ends are a buffer and an offset in
/// bytes.
pub struct PointsCopy<B> {
    /// Source.
    pub from: (B, u64),
    /// Destination.
    pub to: (B, u64),
    /// Number of bytes.
    pub bytes: u64,
}

/// A device that runs the kernels of one scene. It has one owner, so only state that several scenes share needs a lock.
///
/// Only `upload`, `end_read`, `finish`, `unload`, `wait_idle` and the methods that reuse buffers (`has_ended`,
/// `staging`, `send_key`) may block. They wait only for work of this scene. Submissions run in order, and recorded work
/// reads the results of work recorded earlier. If copies run on queues of their own, the device orders them with the
/// submissions that need them. Methods with an empty default body are for such devices.
pub trait GpuDevice: Send + Sized + 'static {
    /// A buffer. Dropping it need not wait for the device: see [`GpuDevice::discard`].
    type Buffer: Send + 'static;
    /// A compiled kernel.
    type Pipeline: Send + Sync + 'static;
    /// Handle with which any thread compiles kernels, or opens the device for [another scene](GpuDevice::beside).
    type Maker: Send + Sync + 'static;
    /// Resources of one submission.
    type Slot: GpuSlot<Self>;
    /// A copy of positions or other bytes to the host.
    type Copy: Send;

    /// Opens a device.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] with the reason, or [`backend::BackendError::Limit`] if a limit is too low
    /// for any scene. `# Errors` sections list only errors specific to a method; [`backend::BackendError`] lists all.
    fn open(options: &Options) -> Result<Self>;

    /// Opens the device of `maker` for another scene, which is traced in addition to its other scenes.
    fn beside(maker: Self::Maker) -> Result<Self>;

    /// Returns the name, driver and kind of the device. Its arithmetic is tested later.
    fn device(&self) -> Device;

    /// Returns how invocations traverse in packets, and whether the device may rasterize. See [`shaders::Traits`].
    fn forms(&self) -> (Option<Packets>, bool);

    /// Returns the clock of the timestamps.
    fn clock(&self) -> Clock;

    /// Returns the maximum number of workgroups per dispatch along an axis.
    fn max_groups(&self) -> u32;

    /// Checks that all `wanted` kernels can run on the device. The error names the limit that is too low.
    fn check_kernels(&self, wanted: &dyn Fn(&Kernel) -> bool) -> Result<()>;

    /// Creates a buffer of `bytes`, rounded up to 16 because zero-sized buffers cannot be bound. The host
    /// [writes](GpuDevice::write) [`BufferName::Rays`]. Kernels write all other buffers, or the host does while no
    /// submission is unfinished. Returns an error with the required bytes if the buffer is too large.
    fn buffer(&self, name: BufferName, bytes: u64) -> Result<Self::Buffer>;

    /// Creates a buffer of `bytes`, rounded up to 16, as a destination of [`GpuDevice::send`]. Error messages name it
    /// `what`.
    fn room(&self, what: &'static str, bytes: u64) -> Result<Self::Buffer>;

    /// Returns the number of bytes that kernels may use.
    fn size(buffer: &Self::Buffer) -> u64;

    /// Returns the number of bytes of device memory that the buffer occupies.
    fn held(buffer: &Self::Buffer) -> u64 {
        Self::size(buffer)
    }

    /// Returns the bytes of device memory that are still available, or `None` if the driver does not report them.
    fn free_bytes(&self) -> Option<u64> {
        None
    }

    /// Drops a buffer once the work recorded so far no longer uses it.
    fn discard(&mut self, _buffer: Self::Buffer) {}

    /// Takes the buffers of rays that the device's owner set last.
    fn take_lent_rays(&mut self) -> Option<LentRays<Self::Buffer>>;

    /// Whether positions can be [copied](GpuDevice::take_copies) by a compute kernel.
    const COPIES: bool = false;

    /// Takes the copies of positions that a kernel performs before key frames are read.
    fn take_copies(&mut self) -> Vec<PointsCopy<Self::Buffer>> {
        Vec::new()
    }

    /// Returns the number of buffers created so far, for any purpose.
    fn buffers_made(&self) -> u64;

    /// See [`backend::Inspect::complaints`].
    fn complaints(&self) -> Vec<String>;

    /// Fills buffers from their beginning. Blocks until the copy has finished.
    fn upload(&mut self, all: &[(&[u8], &Self::Buffer)]) -> Result<()>;

    /// Writes the first rows of a buffer of rays, or of lent results, for the next submission. No unfinished submission
    /// may use the buffer.
    fn write<T: Pod + Send + Sync>(&mut self, to: &mut Self::Buffer, rows: &[T]) -> Result<()>;

    /// Starts a copy of bytes of a buffer to the host. The work that fills the buffer must have finished.
    fn begin_read(&mut self, from: &Self::Buffer, bytes: Range<u64>) -> Result<Self::Copy>;

    /// Blocks until a copy of `bytes` bytes has arrived and passes them to `look`.
    fn end_read(&mut self, copy: Self::Copy, bytes: usize, look: impl FnOnce(&[u8])) -> Result<()>;

    /// Passes the first `count` elements of a buffer to `look` in parts, each with the index of its first element. A
    /// part is processed while later parts are copied.
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

    /// Reads the first `count` elements of a buffer.
    fn read_all<T: Pod>(&mut self, from: &Self::Buffer, count: usize) -> Result<Vec<T>> {
        let mut all = Vec::with_capacity(count);
        self.read(from, count, |_, part| all.extend_from_slice(part))?;
        Ok(all)
    }

    /// Returns a host-visible staging buffer of at least `bytes` for a tree.
    fn staging(&mut self, bytes: u64) -> Result<Self::Buffer>;

    /// Writes the parts of an upload one after another, on any thread. Returns `false` if they do not fit.
    fn fill(staging: &mut Self::Buffer, parts: &[&[u32]]) -> bool;

    /// Starts the upload of the first `bytes` bytes of a staging buffer, concurrently with frames. Returns a number
    /// that must be [expected](GpuDevice::expect) before the data is read. Never copies on the calling thread.
    fn send(&mut self, from: Self::Buffer, bytes: u64, to: &Self::Buffer) -> Result<u64>;

    /// Allocates memory for a key frame, from which [`GpuDevice::send_key`] can copy.
    fn point_buffer(&mut self, points: usize) -> Result<PointBuffer> {
        Ok(vec![[0.0; 3]; points].into())
    }

    /// Starts the upload of these runs of a key frame's vertices, as [`GpuDevice::send`] does.
    fn send_key(&mut self, key: &KeyFrame, runs: &[Range<usize>], to: &Self::Buffer)
    -> Result<u64>;

    /// Returns whether a buffer's last use has finished, so that the buffer can be reused. Blocks until then only if it
    /// `may_wait`.
    fn has_ended(&self, last: LastUse, may_wait: bool) -> Result<bool>;

    /// Makes the next submission wait for this upload and all uploads before it.
    fn expect(&mut self, _arrival: u64) {}

    /// Returns a handle to compile kernels on other threads.
    fn pipeline_maker(&self) -> Self::Maker;

    /// Compiles a kernel. Several threads may call this at the same time.
    fn make_pipeline(maker: &Self::Maker, kernel: KernelCode) -> Result<Self::Pipeline>;

    /// Creates the resources of a submission.
    fn slot(&self) -> Result<Self::Slot>;

    /// Submits a recording. With `positions`, a buffer and its bytes, also starts their copy to the host.
    fn submit(
        &mut self,
        slot: &mut Self::Slot,
        ticket: Ticket,
        positions: Option<(&Self::Buffer, u64)>,
    ) -> Result<Option<Self::Copy>>;

    /// Blocks until a submission has finished and returns its output. Called once per submission, in order.
    fn finish(&mut self, slot: &mut Self::Slot, ticket: Ticket) -> Result<Finished>;

    /// Forgets a submission if the program dropped the command buffer that contains it, so that it never runs. Returns
    /// whether it was dropped.
    fn give_up_dropped(&mut self, _slot: &mut Self::Slot, _ticket: Ticket) -> bool {
        false
    }

    /// Returns whether a submission has finished, so that [`GpuDevice::finish`] would not block. Never blocks.
    fn is_done(&self, slot: &Self::Slot, ticket: Ticket) -> Result<bool>;

    /// Returns whether a copy has arrived. Never blocks.
    fn has_arrived(&self, copy: &Self::Copy) -> Result<bool>;

    /// Notes that the next submission overwrites the source of a copy.
    fn overwrites(&mut self, _copy: &Self::Copy) {}

    /// Returns positions that have arrived. They may outlive the device.
    fn take(&mut self, copy: Self::Copy, vertices: usize) -> Result<Snapshot>;

    /// Waits for all unfinished work and frees everything of the scene, except what [slots](GpuSlot::forget) own.
    fn unload(&mut self) -> Result<()>;

    /// Blocks until the device is idle.
    fn wait_idle(&self) -> Result<()>;

    /// Adds the device's internal allocations to the bytes of the scene's and frames' buffers. Counts neither an
    /// engine's own buffers on a lent device nor host memory.
    fn with_own_bytes(&self, bytes: DeviceBytes) -> DeviceBytes {
        bytes
    }
}

/// Command buffers, parameters, counts and timestamps of one submission.
pub trait GpuSlot<D: GpuDevice>: Send {
    /// Whether positions are copied to the host while the rest of their submission runs. A recording is then
    /// [split](GpuSlot::split).
    const SPLITS: bool = false;

    /// Begins a recording: clears all counts and writes a timestamp. The slot's previous submission must have been
    /// finished.
    fn begin(&mut self) -> Result<()>;

    /// Records dispatches. Each runs after the ones before it unless [`Work::alongside`] is set. That of the first
    /// dispatch refers to the last one of the previous call, unless a stage ended in between.
    fn dispatch(&mut self, all: &[Dispatch<'_, D>], find: Find<'_, '_, D::Buffer>) -> Result<()>;

    /// Ends a stage. The work recorded since the previous end is timed as this stage.
    fn end_stage(&mut self, stage: Stage) -> Result<()>;

    /// Records that the first `bytes` bytes of the counts are set to 0.
    fn clear_counts(&mut self, bytes: u64) -> Result<()>;

    /// Ends the part of a recording that the copy of positions to the host waits for, and begins the rest.
    fn split(&mut self) -> Result<()> {
        Ok(())
    }

    /// Frees everything that belongs to the scene.
    fn forget(&mut self) {}

    /// Returns the bytes of device memory of the slot; 0 if the device counts them.
    fn bytes(&self) -> u64 {
        0
    }
}
