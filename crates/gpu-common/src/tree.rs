//! Trees on the device: the current one and a candidate.

use crate::device::has_ended;
use crate::{BufferTable, Frames, GpuDevice, LastUse, Pool, Staging, Upload, with_slack};
use backend::{BackendError, Generation, Intersector, Result, Ticket, TreeWriter, check_tree};
use bvh_layout::{Topology, Treelets};
use geom::{Aabb, Animation, Point, lock};
use shaders::work::{Trace, TreeProgress};
use shaders::{BufferName, Shape, rebuild, tree_buffers};
use std::borrow::Cow;
use std::sync::{Arc, Mutex};

/// Trees of a scene, and the buffers for building and uploading them.
pub(crate) struct TreeBuffers<D: GpuDevice> {
    animation: Arc<Animation>,
    intersector: Intersector,
    /// The tree that frames trace.
    pub(crate) current: DeviceTree<D>,
    /// The tree that was evaluated last or, once it is adopted, the one that it replaced. Its buffers are created at the
    /// first evaluation.
    pub(crate) candidate: Option<DeviceTree<D>>,
    /// Buffers of pixel coverage and visibility, as large as the largest trace so far needs.
    picture_buffers: BufferTable<D>,
    /// Topology buffers that no tree uses.
    free: Pool<D::Buffer>,
    /// Bytes of the topology that was uploaded last; 0 before the first.
    last_bytes: u64,
    /// A topology whose upload has started, but which is not part of a tree yet.
    sent: Option<UploadedTopology<D::Buffer>>,
    /// The next topology in staging memory, which the builder thread writes.
    written: Arc<Mutex<Option<Written<D::Staging>>>>,
    /// Buffers for tree builds on the device; `None` before the first.
    pub(crate) build: Option<BufferTable<D>>,
    /// Whether the current tree was built on the device.
    pub(crate) built_on_device: bool,
}

/// A tree with the boxes and triangle data of one pose.
pub(crate) struct DeviceTree<D: GpuDevice> {
    /// The topology as the host uploaded it; `None` before the first.
    topology: Option<UploadedTopology<D::Buffer>>,
    /// Buffers by name. The node and cost buffers fit the largest tree so far.
    pub(crate) buffers: BufferTable<D>,
    pub(crate) generation: Generation,
    /// Sizes, treelets per level and kernel parameters of the tree.
    pub(crate) shape: Shape,
    /// The parts of the tree that are up to date.
    pub(crate) progress: TreeProgress,
}

impl<D: GpuDevice> DeviceTree<D> {
    /// Creates the buffers of a tree over `leaves` triangles. The node and cost buffers [grow](Self::grow) later.
    fn new(gpu: &mut D, intersector: Intersector, leaves: u64) -> Result<Self> {
        let buffers = BufferTable::new(gpu, tree_buffers(intersector, leaves))?;
        if leaves == 0 {
            // No kernel writes the root of an empty tree. Its box is empty and it refers to no node, so all rays miss.
            let row = |[x, y, z]: Point, last| [x.to_bits(), y.to_bits(), z.to_bits(), last];
            let root = [row(Aabb::EMPTY.min, u32::MAX), row(Aabb::EMPTY.max, 0)];
            buffers.fill(gpu, &[(BufferName::Nodes, bytemuck::cast_slice(&root))])?;
        }
        Ok(Self {
            topology: None,
            buffers,
            generation: Generation(0),
            shape: Shape::default(),
            progress: TreeProgress::default(),
        })
    }

    pub(crate) fn get(&self, name: BufferName) -> Option<&D::Buffer> {
        match name {
            BufferName::Topology => self.topology.as_ref().map(|topology| &topology.buffer),
            _ => self.buffers.get(name),
        }
    }

    /// Enlarges the buffers of nodes and costs to fit a tree of this shape.
    pub(crate) fn grow(&mut self, gpu: &D, frames: &mut Frames<D>, shape: &Shape) -> Result<()> {
        let sizes = [
            (BufferName::Nodes, shape.node_rows * 16),
            (BufferName::Costs, shape.cost_bytes),
        ];
        frames.drop_when_unused(self.buffers.grow(gpu, &sizes)?);
        Ok(())
    }

    /// Makes an uploaded topology the tree's own. Returns the previous one.
    fn place(
        &mut self,
        uploaded: UploadedTopology<D::Buffer>,
        shape: Shape,
        progress: TreeProgress,
    ) -> Option<UploadedTopology<D::Buffer>> {
        self.generation = uploaded.generation;
        (self.shape, self.progress) = (shape, progress);
        self.topology.replace(uploaded)
    }

    fn held(&self) -> u64 {
        let topology = self.get(BufferName::Topology);
        self.buffers.held() + topology.map_or(0, |buffer| D::size(buffer).allocated)
    }
}

impl<D: GpuDevice> TreeBuffers<D> {
    /// Creates the buffers of the current tree, which has no leaf yet.
    pub(crate) fn new(
        gpu: &mut D,
        animation: &Arc<Animation>,
        intersector: Intersector,
    ) -> Result<Self> {
        let leaves = animation.live_count() as u64;
        let names = [BufferName::PixelCoverage, BufferName::Visibility];
        Ok(Self {
            animation: Arc::clone(animation),
            intersector,
            current: DeviceTree::new(gpu, intersector, leaves)?,
            candidate: None,
            picture_buffers: BufferTable::new(gpu, names.map(|name| (name, 0)))?,
            free: Pool::default(),
            last_bytes: 0,
            sent: None,
            written: Arc::default(),
            build: None,
            built_on_device: false,
        })
    }

    pub(crate) fn get(&self, name: BufferName) -> Option<&D::Buffer> {
        let build = || self.build.as_ref().and_then(|b| b.get(name));
        let own = self
            .current
            .get(name)
            .or_else(|| self.picture_buffers.get(name));
        own.or_else(build)
    }

    /// Returns a function that writes the tree of `generation` into a staging buffer. Returns `None` before the first
    /// upload.
    pub(crate) fn writer(
        &mut self,
        gpu: &mut D,
        generation: Generation,
    ) -> Result<Option<TreeWriter>> {
        // A topology that was written but never uploaded is obsolete.
        let spare = lock(&self.written).take();
        let staging = match spare {
            Some(spare) => spare.staging,
            None if self.last_bytes == 0 => return Ok(None),
            None => gpu.staging(self.last_bytes)?,
        };
        let to = Arc::clone(&self.written);
        Ok(Some(Box::new(move |tree| {
            let treelets = treelets(tree);
            let parts = treelets.parts();
            // If the staging buffer is too small, drop it. The next tree gets a larger one.
            if let Some(written) = Written::new(staging, &parts, generation) {
                *lock(&to) = Some(written);
            }
        })))
    }

    /// Starts the upload of a tree, unless it has started. Returns the number of the upload.
    pub(crate) fn send(
        &mut self,
        gpu: &mut D,
        tree: &Topology,
        generation: Generation,
    ) -> Result<u64> {
        if let Some(sent) = self.sent.as_ref().filter(|s| s.generation == generation) {
            return Ok(sent.upload_value);
        }
        let obsolete = self.sent.take();
        self.release(obsolete, Ticket(0));
        let Written { staging, bytes, .. } = self.staged(gpu, tree, generation)?;
        let spare = self
            .free
            .fit(bytes, |last, may_wait| has_ended(gpu, last, may_wait))?;
        let buffer = match spare {
            Some(buffer) => buffer,
            None => with_slack(bytes, |bytes| gpu.buffer(BufferName::Topology, bytes))?,
        };
        self.last_bytes = bytes;
        let upload_value = gpu.send(Upload::Staged(staging), &buffer)?;
        self.sent = Some(UploadedTopology {
            generation,
            buffer,
            upload_value,
        });
        Ok(upload_value)
    }

    /// Returns staging memory that contains the tree.
    fn staged(
        &self,
        gpu: &mut D,
        tree: &Topology,
        generation: Generation,
    ) -> Result<Written<D::Staging>> {
        let written = lock(&self.written).take();
        if let Some(written) = written.filter(|written| written.generation == generation) {
            return Ok(written);
        }
        let treelets = treelets(tree);
        let parts = treelets.parts();
        let staging = gpu.staging(bytes(&parts))?;
        let written = Written::new(staging, &parts, generation);
        let why = "the staging memory of a tree cannot be written";
        written.ok_or_else(|| BackendError::DeviceLost(why.into()))
    }

    /// Makes `tree` current for work recorded from now on.
    pub(crate) fn adopt(
        &mut self,
        gpu: &mut D,
        frames: &mut Frames<D>,
        tree: &Topology,
        generation: Generation,
    ) -> Result<()> {
        let evaluated = self.candidate.as_mut();
        if let Some(candidate) = evaluated.filter(|c| c.generation == generation) {
            std::mem::swap(&mut self.current, candidate);
            self.current.progress = self.current.progress.promoted();
            self.built_on_device = false;
            return Ok(());
        }
        let shape = self.send_checked(gpu, tree, generation)?;
        self.current.grow(gpu, frames, &shape)?;
        let uploaded = take_sent(&mut self.sent, frames);
        let old = self.current.place(uploaded, shape, TreeProgress::default());
        self.release(old, frames.submitted);
        self.built_on_device = false;
        Ok(())
    }

    /// Makes `tree` the candidate of the current recording. Returns `None` if there is not enough memory for a second
    /// tree.
    pub(crate) fn load_candidate(
        &mut self,
        gpu: &mut D,
        frames: &mut Frames<D>,
        tree: &Topology,
        generation: Generation,
    ) -> Result<Option<&mut DeviceTree<D>>> {
        if self.candidate.is_none() {
            let leaves = self.animation.live_count() as u64;
            self.candidate = unless_too_large(DeviceTree::new(gpu, self.intersector, leaves))?;
        }
        let is_loaded = |tree: &DeviceTree<D>| tree.generation == generation;
        if self.candidate.as_ref().is_some_and(|c| !is_loaded(c)) {
            let shape = self.send_checked(gpu, tree, generation)?;
            let Some(candidate) = &mut self.candidate else {
                return Ok(None);
            };
            if unless_too_large(candidate.grow(gpu, frames, &shape))?.is_none() {
                return Ok(None);
            }
            let uploaded = take_sent(&mut self.sent, frames);
            let old = candidate.place(uploaded, shape, TreeProgress::of_candidate());
            match old {
                // The recording also evaluates the previous candidate in this buffer, so the pool must not reuse it yet.
                Some(old) if frames.recorder.uses(&old.buffer) => {
                    frames.drop_when_unused([old.buffer]);
                }
                old => self.release(old, frames.submitted),
            }
        }
        Ok(self.candidate.as_mut())
    }

    /// Discards the progress of the candidate, because its recording is not submitted.
    pub(crate) fn abandon_candidate(&mut self) {
        if let Some(candidate) = &mut self.candidate {
            candidate.progress = TreeProgress::of_candidate();
            // Stale boxes must not be adopted.
            candidate.generation = Generation(0);
        }
    }

    /// Discards the progress of both trees, because recorded or submitted work never runs.
    pub(crate) fn recording_dropped(&mut self) {
        self.current.progress = TreeProgress::default();
        self.abandon_candidate();
    }

    /// Updates the progress of both trees, because the recording was submitted.
    pub(crate) fn recording_submitted(&mut self) {
        self.current.progress.submitted();
        if let Some(candidate) = &mut self.candidate {
            candidate.progress.submitted();
        }
    }

    /// Starts the upload of a tree, unless it has started, and returns the tree's shape.
    ///
    /// # Errors
    /// The tree does not match the animation.
    fn send_checked(
        &mut self,
        gpu: &mut D,
        tree: &Topology,
        generation: Generation,
    ) -> Result<Shape> {
        check_tree(tree, &self.animation)?;
        self.send(gpu, tree, generation)?;
        Ok(Shape::of(&treelets(tree)))
    }

    /// Returns a topology buffer to the pool. `last` is the last submission that may use it.
    fn release(&mut self, old: Option<UploadedTopology<D::Buffer>>, last: Ticket) {
        if let Some(old) = old {
            let size = D::size(&old.buffer);
            let last = LastUse {
                upload_value: old.upload_value,
                ticket: last.0,
            };
            self.free.put(old.buffer, size, last);
        }
    }

    /// Enlarges the buffers of pixel coverage and visibility to fit a trace.
    pub(crate) fn grow_picture_buffers(
        &mut self,
        gpu: &D,
        frames: &mut Frames<D>,
        tracing: &Trace,
    ) -> Result<()> {
        let buffers = &mut self.picture_buffers;
        let sizes = [
            (BufferName::PixelCoverage, tracing.coverage_bytes),
            (BufferName::Visibility, tracing.visibility_bytes),
        ];
        frames.drop_when_unused(buffers.grow(gpu, &sizes)?);
        Ok(())
    }

    /// Allocates the buffers for tree builds.
    pub(crate) fn allocate_build(&mut self, gpu: &mut D) -> Result<()> {
        let build = BufferTable::new(gpu, rebuild::buffers(&self.animation))?;
        let live = rebuild::live(&self.animation);
        build.fill(gpu, &[(BufferName::Live, bytemuck::cast_slice(&live))])?;
        self.build = Some(build);
        Ok(())
    }

    /// Returns the bytes of device memory of all trees, of buffers for tree builds, and of the visibility buffer. The
    /// first number includes unused topology buffers and pixel coverage.
    pub(crate) fn held(&self) -> [u64; 3] {
        let build = self.build.as_ref().map_or(0, BufferTable::held);
        let candidate = self.candidate.as_ref().map_or(0, DeviceTree::held);
        let visibility = self.picture_buffers.get(BufferName::Visibility);
        let visibility = visibility.map_or(0, |b| D::size(b).allocated);
        let coverage = self.picture_buffers.held() - visibility;
        let sent = self.sent.as_ref();
        let sent = sent.map_or(0, |topology| D::size(&topology.buffer).allocated);
        let trees = self.current.held() + candidate + sent + coverage + self.free.held();
        [trees, build, visibility]
    }
}

/// Returns the form of a tree that is uploaded. Computes it if it is missing.
fn treelets(tree: &Topology) -> Cow<'_, Treelets> {
    let missing = || Cow::Owned(Treelets::of(tree.binary()));
    tree.treelets().map_or_else(missing, Cow::Borrowed)
}

/// A topology whose upload has started.
struct UploadedTopology<B> {
    generation: Generation,
    buffer: B,
    /// Number of the upload.
    upload_value: u64,
}

/// Removes and returns the topology that was sent. The next submission waits for its upload.
fn take_sent<D: GpuDevice>(
    sent: &mut Option<UploadedTopology<D::Buffer>>,
    frames: &mut Frames<D>,
) -> UploadedTopology<D::Buffer> {
    let sent = sent.take().expect("it was sent just now");
    frames.await_upload(sent.upload_value);
    sent
}

/// Converts errors for lack of memory, or for an exceeded limit, to `None`.
pub(crate) fn unless_too_large<T>(made: Result<T>) -> Result<Option<T>> {
    match made {
        Ok(made) => Ok(Some(made)),
        Err(e) if e.is_too_large() => Ok(None),
        Err(e) => Err(e),
    }
}

/// A tree in a staging buffer.
struct Written<S> {
    staging: S,
    bytes: u64,
    generation: Generation,
}

impl<S: Staging> Written<S> {
    /// Writes the parts of a tree. Returns `None` if they do not fit.
    fn new(mut staging: S, parts: &[&[u32]], generation: Generation) -> Option<Self> {
        let is_filled = staging.fill(parts);
        is_filled.then(|| Self {
            staging,
            bytes: bytes(parts),
            generation,
        })
    }
}

fn bytes(parts: &[&[u32]]) -> u64 {
    parts.iter().map(|part| size_of_val(*part) as u64).sum()
}
