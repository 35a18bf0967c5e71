//! Operations with which the device's owner lends positions, rays and semaphores.

use crate::external::ExternalMemory;
use crate::lent::{POINT, Signal};
use crate::memory::{Buffer, BufferUse};
use crate::staging::HostPoints;
use crate::timeline::{QueueBatch, Timeline, submit};
use crate::vulkan_device::VulkanDevice;
use backend::{BackendError, Result};
use geom::{Point, PointBuffer};
use gpu_common::{GpuDevice, LentRays};
use std::ops::Range;
use std::sync::Arc;

impl VulkanDevice {
    /// Allocates host memory for a key frame that will be [pushed](geom::Animation::push) to the loaded scene. The device
    /// reads the memory directly.
    pub fn point_buffer(&mut self, points: usize) -> Result<PointBuffer> {
        let points = HostPoints::new(&self.gpu, points)?;
        Ok(PointBuffer::Shared(Box::new(points)))
    }

    /// Makes a run of the scene's `all` positions come from external memory, starting at byte `offset`, in all later
    /// key frames. The next submission copies them first.
    ///
    /// # Errors
    /// [`backend::BackendError::Misuse`] if the memory belongs to another device or is too small, or the offset is not
    /// a multiple of 4.
    pub fn bring_points(
        &mut self,
        (run, all): (Range<usize>, usize),
        (from, offset): (&Arc<ExternalMemory>, u64),
    ) -> Result<()> {
        if offset % 4 != 0 {
            let why = format!("vertices begin at a multiple of 4 bytes, not at {offset}");
            return Err(BackendError::Misuse(why));
        }
        let end = (run.len() as u64 * POINT).saturating_add(offset);
        let from = Buffer::lent(&self.gpu, from, end)?;
        if run.is_empty() {
            return Ok(());
        }
        let points = &mut self.lent.points;
        if points.all.is_none() {
            let bytes = all as u64 * POINT;
            let made = Buffer::new(&self.gpu, "positions", bytes, BufferUse::Device)?;
            points.all = Some(made);
        }
        points.release(&run);
        let at = points.runs.partition_point(|r| r.start < run.start);
        points.runs.insert(at, run.clone());
        points.pending.push((from, offset, run));
        Ok(())
    }

    /// Makes a run of positions come from the host again.
    pub fn release_points(&mut self, run: &Range<usize>) {
        self.lent.points.release(run);
    }

    /// Reads a run of positions if it came from external memory, and `None` otherwise. Blocks until it has arrived.
    pub fn read_points(&mut self, run: &Range<usize>) -> Result<Option<Vec<Point>>> {
        if !self.lent.points.runs.contains(run) {
            return Ok(None);
        }
        self.copy_points(None)?;
        self.upload.wait()?;
        let Some(all) = self.lent.points.all.take() else {
            return Ok(None);
        };
        let mut points = Vec::with_capacity(run.end);
        let read = self.read(&all, run.end, |_, part| points.extend_from_slice(part));
        self.lent.points.all = Some(all);
        read?;
        Ok(Some(points.split_off(run.start)))
    }

    /// Makes the next query of [`backend::Rays::OnDevice`] trace these rays. Their buffers must be
    /// [lent](Buffer::lent).
    pub fn lend_rays(&mut self, rays: LentRays<Buffer>) {
        self.lent.buffers.rays = [rays].into();
    }

    /// Makes the next submission wait until `timeline` reaches `wait`, before lent memory is read or written.
    /// [`VulkanDevice::signal`] then makes the timeline reach `signal`.
    ///
    /// # Errors
    /// [`backend::BackendError::Misuse`] if the semaphore belongs to another device, or the values do not increase.
    pub fn synchronize(
        &mut self,
        timeline: &Arc<Timeline>,
        [wait, signal]: [u64; 2],
    ) -> Result<()> {
        if !Arc::ptr_eq(&timeline.gpu, &self.gpu) {
            let why = "the semaphore is another device's";
            return Err(BackendError::Misuse(why.into()));
        }
        let mut open = Vec::new();
        for signal in self.lent.signals.drain(..) {
            if !signal.is_submitted || !signal.timeline.has_reached(signal.value)? {
                open.push(signal);
            }
        }
        self.lent.signals = open;
        let is_same = |signal: &&Signal| Arc::ptr_eq(&signal.timeline, timeline);
        let before = self.lent.signals.iter().filter(is_same);
        let before = before.map(|signal| signal.value).max().unwrap_or(0);
        if signal <= wait.max(before) || timeline.has_reached(signal)? {
            let why = format!(
                "the semaphore cannot signal {signal}: that is not above the value waited for, its own and those of \
                 earlier steps"
            );
            return Err(BackendError::Misuse(why));
        }
        self.lent.waits.push(timeline.at(wait));
        self.lent.signals.push(Signal {
            timeline: Arc::clone(timeline),
            value: signal,
            is_submitted: false,
        });
        Ok(())
    }

    /// Submits the pending signals. Their timelines reach their values once all submitted work has finished and lent
    /// memory has been read.
    pub fn signal(&mut self) -> Result<()> {
        if self.lent.signals.iter().all(|signal| signal.is_submitted) {
            return Ok(());
        }
        let copied = self.copy_points(None)?;
        let copied = copied.map(|value| self.upload.done.at(value));
        let after = [self.lent.waits.as_slice(), copied.as_slice()].concat();
        let open = self
            .lent
            .signals
            .iter()
            .filter(|signal| !signal.is_submitted);
        let batches = open.map(|signal| QueueBatch {
            commands: None,
            after: &after,
            done: signal.timeline.at(signal.value),
        });
        let batches: Vec<_> = batches.collect();
        submit(&self.gpu, &self.compute, &batches)?;
        self.lent.waits.clear();
        for signal in &mut self.lent.signals {
            signal.is_submitted = true;
        }
        Ok(())
    }
}
