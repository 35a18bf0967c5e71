//! Interoperation with another interface to the GPU, through external memory and semaphores.

use crate::external::ExternalMemory;
use crate::external_inputs::Signal;
use crate::memory::{Buffer, BufferUse};
use crate::staging::HostPoints;
use crate::timeline::{QueueBatch, Timeline, submit};
use crate::transfer::BufferCopy;
use crate::vulkan_device::VulkanDevice;
use backend::{BackendError, Result};
use geom::{Point, PointBuffer};
use gpu_common::{GpuDevice, LentRays, PointsSource};
use std::ops::Range;
use std::sync::Arc;

const POINT: u64 = size_of::<Point>() as u64;

/// External memory that holds a range of a scene's vertices.
pub struct ExternalVertices<'a> {
    /// The memory.
    pub memory: &'a Arc<ExternalMemory>,
    /// Byte offset of the first position.
    pub offset: u64,
    /// Indices of the vertices.
    pub range: Range<usize>,
    /// Number of vertices of the scene.
    pub vertex_count: usize,
}

impl VulkanDevice {
    /// Sets external memory as the source of a run of positions. The memory is read once: by the next upload of a key
    /// frame, `signal` or `read_external_points`. Later key frames contain these positions until the source changes.
    ///
    /// # Errors
    /// [`backend::BackendError::Misuse`] if the memory belongs to another device or is too small, or the offset is not
    /// a multiple of 4.
    pub fn set_external_points(&mut self, source: ExternalVertices<'_>) -> Result<()> {
        let ExternalVertices { offset, range, .. } = source;
        if offset % 4 != 0 {
            let why = format!("the byte offset of vertices must be a multiple of 4, not {offset}");
            return Err(BackendError::Misuse(why));
        }
        let end = (range.len() as u64 * POINT).saturating_add(offset);
        let buffer = Buffer::external(&self.gpu, source.memory, end)?;
        if range.is_empty() {
            return Ok(());
        }
        if self.external.positions.is_none() {
            let bytes = source.vertex_count as u64 * POINT;
            let made = Buffer::new(&self.gpu, "positions", bytes, BufferUse::Device)?;
            self.external.positions = Some(made);
        }
        self.external.points.set(PointsSource {
            buffer,
            offset,
            run: range,
        });
        Ok(())
    }

    /// Allocates host memory for a key frame that will be [pushed](geom::Animation::push) to the loaded scene. The
    /// device reads the memory directly.
    pub fn point_buffer(&mut self, points: usize) -> Result<PointBuffer> {
        let points = HostPoints::new(&self.gpu, points)?;
        Ok(PointBuffer::Shared(Box::new(points)))
    }

    /// Sets the host as the source of a run of positions again.
    pub fn release_points(&mut self, run: &Range<usize>) {
        self.external.points.release(run);
    }

    /// Reads a run of positions, or returns `None` if its source is not external memory. Blocks until the positions are
    /// on the host.
    pub fn read_external_points(&mut self, run: &Range<usize>) -> Result<Option<Vec<Point>>> {
        if !self.external.points.runs().contains(run) {
            return Ok(None);
        }
        self.copy_external_points(None)?;
        self.upload.wait()?;
        let Some(positions) = self.external.positions.take() else {
            return Ok(None);
        };
        let mut points = Vec::with_capacity(run.end);
        let read = self.read(&positions, run.end, |_, part| {
            points.extend_from_slice(part);
        });
        self.external.positions = Some(positions);
        read?;
        Ok(Some(points.split_off(run.start)))
    }

    /// Starts to copy new external positions to the buffer of all positions, and from there to a key frame. Returns the
    /// upload's value, if there is anything to copy.
    pub(crate) fn copy_external_points(&mut self, key: Option<&Buffer>) -> Result<Option<u64>> {
        let points = &self.external.points;
        let Some(positions) = &self.external.positions else {
            return Ok(None);
        };
        let in_place = |run: &Range<usize>| run.start as u64 * POINT..run.end as u64 * POINT;
        let mut copies = Vec::new();
        for source in &points.pending {
            let to = in_place(&source.run);
            let bytes = source.offset..source.offset + (to.end - to.start);
            let copy = BufferCopy::between(source.buffer.vk, positions.vk);
            copies.push(copy.range(bytes, to.start));
        }
        if let Some(key) = key.filter(|_| !points.runs().is_empty()) {
            let copy = BufferCopy::between(positions.vk, key.vk);
            let bytes = points.runs().iter().map(in_place);
            copies.push(bytes.fold(copy, |copy, bytes| copy.range(bytes.clone(), bytes.start)));
        }
        if copies.is_empty() {
            return Ok(None);
        }
        let upload_value = self.upload.start_in_order(&copies, &self.external.waits)?;
        for source in std::mem::take(&mut self.external.points.pending) {
            self.retain(source.buffer, upload_value);
        }
        Ok(Some(upload_value))
    }

    /// Makes the next query of [`backend::Rays::OnDevice`] trace these rays. Their buffers must be
    /// [external](Buffer::external).
    pub fn set_external_rays(&mut self, rays: LentRays<Buffer>) {
        self.external.lent.rays = [rays].into();
    }

    /// Makes the next submission wait until `timeline` reaches `wait`, before external memory is read or written.
    /// [`VulkanDevice::signal`] then makes the timeline reach `signal`.
    ///
    /// # Errors
    /// [`backend::BackendError::Misuse`] if the semaphore belongs to another device, or the values do not increase or
    /// increase by more than the device allows.
    pub fn synchronize(&mut self, timeline: &Arc<Timeline>, wait: u64, signal: u64) -> Result<()> {
        if !Arc::ptr_eq(&timeline.gpu, &self.gpu) {
            let why = "the semaphore belongs to another device";
            return Err(BackendError::Misuse(why.into()));
        }
        let mut open = Vec::new();
        for signal in self.external.signals.drain(..) {
            if !signal.is_submitted || !signal.timeline.has_reached(signal.value)? {
                open.push(signal);
            }
        }
        self.external.signals = open;
        let signals = self.external.signals.iter();
        let earlier = signals.filter(|signal| Arc::ptr_eq(&signal.timeline, timeline));
        let earlier = earlier.map(|signal| signal.value).max().unwrap_or(0);
        let now = timeline.value()?;
        if signal <= wait.max(earlier).max(now) {
            let why = format!(
                "the semaphore cannot signal {signal}: the value must exceed the awaited value, the current value and \
                 the signals of earlier steps"
            );
            return Err(BackendError::Misuse(why));
        }
        self.gpu.limits.admit_signal(now, signal)?;
        // If `wait` is below the current value, wait for the current value instead. Both are reached, but the device
        // limits the distance of an awaited value from the current one.
        self.external.waits.push(timeline.at(wait.max(now)));
        self.external.signals.push(Signal {
            timeline: Arc::clone(timeline),
            value: signal,
            is_submitted: false,
        });
        Ok(())
    }

    /// Copies the signals of another scene on the same logical device, so that later signals of this scene must exceed
    /// them. All signals of the other scene must be submitted.
    pub fn copy_signals(&mut self, other: &Self) {
        let signals = other.external.signals.iter().cloned();
        self.external.signals.extend(signals);
    }

    /// Submits the pending signals. Their timelines reach their values when all submitted work has finished and all
    /// external positions have been copied.
    pub fn signal(&mut self) -> Result<()> {
        let signals = &self.external.signals;
        if signals.iter().all(|signal| signal.is_submitted) {
            return Ok(());
        }
        let copied = self.copy_external_points(None)?;
        let copied = copied.map(|value| self.upload.done.at(value));
        let after = [self.external.waits.as_slice(), copied.as_slice()].concat();
        let pending = self.external.signals.iter().filter(|s| !s.is_submitted);
        let batches = pending.map(|signal| QueueBatch {
            commands: None,
            after: &after,
            done: signal.timeline.at(signal.value),
        });
        let batches: Vec<_> = batches.collect();
        submit(&self.gpu, &self.compute, &batches)?;
        self.external.waits.clear();
        for signal in &mut self.external.signals {
            signal.is_submitted = true;
        }
        Ok(())
    }
}
