//! The operations that a GPU interface implements.

use crate::{Clock, KernelCode, LastUse, Recording, Stage};
use backend::{Device, Result, Snapshot, Ticket};
use bytemuck::Pod;
use geom::KeyFrame;
use shaders::{BufferName, Counts, Kernel, Packets};
use std::collections::VecDeque;
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
    /// Whether to pass kernels as WGSL with run-time checks of array bounds and loops. Interfaces that accept no WGSL
    /// ignore this. By default kernels are passed as SPIR-V if the device accepts it, or else as WGSL without checks.
    pub uses_checked_wgsl: bool,
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

/// Properties of an open device, and its state at the time of the call.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// Name, driver and kind. The backend replaces `arithmetic` and `capabilities`, which are placeholders here.
    pub device: Device,
    /// How rays are traced in packets, or `None` if the device cannot trace packets. See [`shaders::Traits`].
    pub packets: Option<Packets>,
    /// Whether the device can find first hits by rasterization. See [`shaders::Traits`].
    pub rasterizes: bool,
    /// Clock of the timestamps.
    pub clock: Clock,
    /// Maximum number of workgroups per dispatch along an axis.
    pub max_groups: u32,
    /// Limits for kernels. See [`check_kernels`].
    pub kernel_limits: Vec<KernelLimit>,
    /// Whether the device executes [`RecordedCommand::Split`](crate::RecordedCommand::Split): the positions are copied
    /// to the host while the rest of their submission runs.
    pub splits: bool,
    /// Whether a kernel copies positions from lent buffers to key frames. See [`LentBuffers::copies`].
    pub copies_points: bool,
    /// Bytes of device memory that were available when this was queried, or `None` if unknown. `gpu-vulkan` returns the
    /// size of a heap if the driver does not report the use of memory.
    pub free_bytes: Option<u64>,
    /// Messages of all calls that wgpu has rejected so far, and messages of the validation layer in this process.
    /// `gpu-vulkan` records no rejected calls.
    pub complaints: Vec<String>,
}

/// A limit of a device.
#[derive(Clone, Copy, Debug)]
pub struct KernelLimit {
    /// Name in the device's interface.
    pub name: &'static str,
    /// Returns the amount that a kernel needs.
    pub need: fn(&Kernel) -> u32,
    /// Maximum amount that the device supports.
    pub most: u32,
}

/// Memory of a device.
#[derive(Clone, Copy, Debug, Default)]
pub struct MemoryReport {
    /// Bytes of all buffers in device memory, or `None` if the device does not count them.
    pub allocated: Option<u64>,
    /// Bytes of buffers that wait to be reused or dropped.
    pub waiting: u64,
    /// Bytes of parameters, counts and timestamps. Used only if `allocated` is `None`.
    pub submissions: u64,
    /// Number of buffers created so far, for any purpose. On some devices, also rises when the program passes other ray
    /// buffers.
    pub buffers_made: u64,
}

/// Sizes of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferSize {
    /// Bytes that kernels may use.
    pub bytes: u64,
    /// Bytes of device memory that the buffer occupies.
    pub allocated: u64,
}

/// Host memory from which a tree is uploaded. Any thread may write it.
pub trait Staging: Send + 'static {
    /// Writes the parts of an upload one after another. Returns `false` if they do not fit.
    fn fill(&mut self, parts: &[&[u32]]) -> bool;
}

/// Data to upload while frames run.
pub enum Upload<'a, S> {
    /// Everything that was written to staging memory.
    Staged(S),
    /// Runs of vertices of a key frame.
    KeyFrame {
        /// The key frame.
        key: &'a KeyFrame,
        /// Ranges of its vertices.
        runs: &'a [Range<usize>],
    },
}

/// Work whose completion can be polled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PendingWork {
    /// A submission.
    Submission(Ticket),
    /// The copy of positions that a submission requested.
    Positions(Ticket),
    /// The last use of a buffer.
    Use(LastUse),
}

/// Output of a submission.
#[derive(Clone, Debug)]
pub enum Outcome {
    /// It has finished.
    Finished(SubmissionOutput),
    /// It never runs, because the program dropped its command buffer or the interface rejected it. Contains the reason.
    Dropped(&'static str),
}

/// Output of a finished submission.
#[derive(Clone, Debug, Default)]
pub struct SubmissionOutput {
    /// Counts written by its kernels.
    pub counts: Counts,
    /// For each timestamp, the stage between this timestamp and the next; `None` if no stage is timed there.
    pub marks: Vec<Option<Stage>>,
    /// Value of each timestamp, in ticks of [`DeviceInfo::clock`]; `None` if the device has no timestamps.
    pub ticks: Option<Vec<u64>>,
}

/// Buffers of the calling program: one with rays, and one for their results. See [`backend::Rays::OnDevice`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LentRays<B> {
    /// One ray per element, in the memory layout of [`geom::Ray`].
    pub rays: B,
    /// One result per ray: [`geom::Hit`] in its memory layout, or for any-hit queries a word that is not 0 for a hit.
    /// `None` if the backend allocates the results.
    pub results: Option<B>,
}

/// A copy of positions from a buffer of the calling program to a key frame. Source and destination are a buffer and a
/// byte offset.
pub struct PointsCopy<B> {
    /// Source.
    pub from: (B, u64),
    /// Destination.
    pub to: (B, u64),
    /// Number of bytes.
    pub bytes: u64,
}

/// Buffers of the calling program that the next recording uses.
pub struct LentBuffers<B> {
    /// Rays of the next queries, in order.
    pub rays: VecDeque<LentRays<B>>,
    /// Copies of positions that a kernel performs before key frames are read.
    pub copies: Vec<PointsCopy<B>>,
}

impl<B> Default for LentBuffers<B> {
    fn default() -> Self {
        Self {
            rays: VecDeque::new(),
            copies: Vec::new(),
        }
    }
}

/// The recordings of a device.
pub type RecordingOf<D> =
    Recording<<D as GpuDevice>::Pipeline, <D as GpuDevice>::Binding, <D as GpuDevice>::Native>;

/// A device that runs the kernels of one scene. One backend owns it, so only state shared between scenes needs a lock.
///
/// Only `upload`, `read`, `finish`, `unload`, `wait` and the methods that reuse memory (`staging`, `send`) may block.
/// They wait for work of this scene. If copies and submissions share a queue, as with wgpu, they also wait for earlier
/// submissions of all scenes.
/// Submissions run in order, and recorded work reads the results of earlier recorded work. If copies run on separate
/// queues, the device synchronizes them with the submissions that need them.
pub trait GpuDevice: Send + Sized + 'static {
    /// A buffer. No unfinished submission and no recording may use a buffer that is dropped.
    type Buffer: Send + 'static;
    /// A reference to a buffer in a recording. It need not keep the buffer alive.
    type Binding: Clone + PartialEq + Send;
    /// A compiled kernel.
    type Pipeline: Send + Sync + 'static;
    /// A command that only this type of device can execute.
    type Native: Send;
    /// Host memory to upload a tree from.
    type Staging: Staging;

    /// Returns a function that opens the same device for another scene. Both scenes can be used at the same time.
    fn share_device(&self) -> impl FnOnce() -> Result<Self> + Send + use<Self>;

    /// Returns a function that compiles a kernel. Several threads may call it at the same time.
    fn compiler(
        &self,
    ) -> impl Fn(KernelCode) -> Result<Self::Pipeline> + Send + Sync + 'static + use<Self>;

    /// Returns the properties and the state of the device. May take longer than a frame.
    fn info(&self) -> DeviceInfo;

    /// Returns the use of memory. Fast enough for every frame.
    fn memory(&self) -> MemoryReport;

    /// Creates a buffer of `bytes`, rounded up to a positive multiple of 16. Zero-sized buffers cannot be bound. The
    /// host [writes](GpuDevice::write) [`BufferName::Rays`]. Uploads and kernels write all other buffers. Returns an
    /// error with the required bytes if the buffer is too large.
    fn buffer(&self, name: BufferName, bytes: u64) -> Result<Self::Buffer>;

    /// Returns the sizes of a buffer.
    fn size(buffer: &Self::Buffer) -> BufferSize;

    /// Returns a reference to a buffer for a recording.
    fn bind(buffer: &Self::Buffer) -> Self::Binding;

    /// Returns the buffers that the calling program lent.
    fn lent(&mut self) -> &mut LentBuffers<Self::Buffer>;

    /// Fills buffers from their beginning. Blocks until the copies have finished. No unfinished submission may use the
    /// buffers.
    fn upload(&mut self, all: &[(&[u8], &Self::Buffer)]) -> Result<()>;

    /// Writes elements to the beginning of a buffer of [`BufferName::Rays`], for the next submission. No unfinished
    /// submission may use it.
    fn write<T: Pod + Send + Sync>(&mut self, to: &mut Self::Buffer, rows: &[T]) -> Result<()>;

    /// Passes the first `count` elements of a buffer to `each` in parts, each with the index of its first element. A
    /// part is processed while later parts are copied. The work that fills the buffer must have finished.
    fn read<T: Pod>(
        &mut self,
        from: &Self::Buffer,
        count: usize,
        each: impl FnMut(usize, &[T]),
    ) -> Result<()>;

    /// Returns host memory for the upload of a tree of `bytes`.
    fn staging(&mut self, bytes: u64) -> Result<Self::Staging>;

    /// Starts an upload to the beginning of a buffer, concurrently with frames. Returns its number, for
    /// [`Recording::after_upload`]. Never copies a tree on the calling thread.
    fn send(&mut self, upload: Upload<'_, Self::Staging>, to: &Self::Buffer) -> Result<u64>;

    /// Submits a recording and removes its commands. The submission [`backend::FRAMES_IN_FLIGHT`] before it, and all
    /// earlier ones, have finished or were dropped.
    fn submit(&mut self, recording: &mut RecordingOf<Self>, ticket: Ticket) -> Result<()>;

    /// Returns whether work has finished, or will never run. For the use of a buffer, returns whether the buffer can be
    /// written. Never blocks.
    fn has_finished(&self, work: PendingWork) -> Result<bool>;

    /// Returns whether a submission never runs. A rejected one counts only after [`Self::finish`] returned the reason.
    /// Never blocks.
    fn is_dropped(&self, ticket: Ticket) -> bool;

    /// Blocks until a buffer can be written after its last use. Returns at once if writes run in order with
    /// submissions. Does not wait for a command buffer that the program has not submitted. With `None`, blocks until
    /// all work has finished.
    fn wait(&self, until: Option<LastUse>) -> Result<()>;

    /// Blocks until a submission has finished and returns its output. Called in order, except for dropped submissions.
    /// May be called again after an error or [`Outcome::Dropped`].
    fn finish(&mut self, ticket: Ticket) -> Result<Outcome>;

    /// Returns the copied positions of a submission. The copy must have finished. The positions may outlive the device.
    fn take_positions(&mut self, ticket: Ticket, vertices: usize) -> Result<Snapshot>;

    /// Waits for all unfinished work and frees all resources of the scene.
    fn unload(&mut self) -> Result<()>;
}

/// Returns whether the last use of a buffer has finished, after waiting for it if `may_wait` is set.
pub(crate) fn has_ended<D: GpuDevice>(gpu: &D, last: LastUse, may_wait: bool) -> Result<bool> {
    if may_wait {
        gpu.wait(Some(last))?;
    }
    gpu.has_finished(PendingWork::Use(last))
}

/// Reads the first `count` elements of a buffer.
pub(crate) fn read_all<D: GpuDevice, T: Pod>(
    gpu: &mut D,
    from: &D::Buffer,
    count: usize,
) -> Result<Vec<T>> {
    let mut all = Vec::with_capacity(count);
    gpu.read(from, count, |_, part| all.extend_from_slice(part))?;
    Ok(all)
}

/// A part of a buffer that [`GpuDevice::read`] copies at a time.
pub struct ReadPart {
    /// Index of the first element.
    pub first: usize,
    /// Number of elements.
    pub count: usize,
    /// Bytes of the elements.
    pub bytes: Range<u64>,
}

/// Returns the parts in which [`GpuDevice::read`] copies `count` elements.
pub fn read_parts<T>(count: usize) -> impl Iterator<Item = ReadPart> {
    const BYTES: usize = 8 << 20;
    let size = size_of::<T>();
    let most = BYTES / size;
    (0..count).step_by(most).map(move |first| {
        let end = count.min(first + most);
        ReadPart {
            first,
            count: end - first,
            bytes: (first * size) as u64..(end * size) as u64,
        }
    })
}

/// Checks that all kernels for which `wanted` returns `true` can run on a device.
///
/// # Errors
/// [`backend::BackendError::Limit`] with the largest need of a kernel, and the names of the kernel and the limit.
pub fn check_kernels(limits: &[KernelLimit], wanted: impl Fn(&Kernel) -> bool) -> Result<()> {
    for limit in limits {
        let kernels = shaders::KERNELS.iter().filter(|k| wanted(k));
        if let Some(kernel) = kernels.max_by_key(|k| (limit.need)(k)) {
            let what = || format!("kernel {} ({})", kernel.name, limit.name);
            crate::check_limit(what, (limit.need)(kernel).into(), limit.most.into())?;
        }
    }
    Ok(())
}
