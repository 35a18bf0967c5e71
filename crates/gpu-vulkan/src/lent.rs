//! Resources lent by the device's owner: positions, rays, memory for hits, and timeline semaphores.

use crate::external::ExternalMemory;
use crate::memory::{Buffer, BufferUse};
use crate::timeline::{Batch, Moment, Timeline, submit};
use crate::vulkan_device::VulkanDevice;
use ash::vk;
use backend::{BackendError, Result};
use bytemuck::Pod;
use geom::Point;
use gpu_common::{GpuDevice, LastUse, LentRays, without};
use std::ops::Range;
use std::sync::Arc;

const POINT: u64 = size_of::<Point>() as u64;

/// The resources that were lent last.
#[derive(Default)]
pub(crate) struct Lent {
    points: LentPoints,
    /// Rays of the next query.
    pub(crate) rays: Option<LentRays<Buffer>>,
    /// Moments that must be reached before lent memory is read or written.
    pub(crate) waits: Vec<Moment>,
    /// Signals that are not known to have been reached.
    signals: Vec<Signal>,
}

/// The latest positions from external memory.
#[derive(Default)]
struct LentPoints {
    /// Buffer for all positions of the scene.
    all: Option<Buffer>,
    /// Runs of the scene's positions that come from external memory, in order.
    runs: Vec<Range<usize>>,
    /// Copies to `all` that have not started: source buffer, offset in bytes, and run.
    pending: Vec<(Buffer, u64, Range<usize>)>,
}

/// A timeline value to signal for the program. Until then, work here may wait for lower values of the same timeline.
struct Signal {
    timeline: Arc<Timeline>,
    value: u64,
    /// Whether the signal was submitted.
    is_told: bool,
}

impl LentPoints {
    fn release(&mut self, run: &Range<usize>) {
        self.pending.retain(|(.., other)| other != run);
        self.runs = without(&self.runs, std::slice::from_ref(run));
    }
}

impl Lent {
    /// Returns the parts of `runs` that come from the host.
    pub(crate) fn others(&self, runs: &[Range<usize>]) -> Vec<Range<usize>> {
        without(runs, &self.points.runs)
    }

    /// Waits until the submitted signals are reached.
    pub(crate) fn wait(&self) -> Result<()> {
        let mut told = self.signals.iter().filter(|signal| signal.is_told);
        told.try_for_each(|signal| signal.timeline.wait(signal.value))
    }
}

/// Returns the copy of a run between two byte offsets.
fn region(from: u64, to: u64, run: &Range<usize>) -> vk::BufferCopy {
    vk::BufferCopy::default()
        .src_offset(from)
        .dst_offset(to)
        .size(run.len() as u64 * POINT)
}

impl VulkanDevice {
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
        let points = self.read_all(&all, run.end);
        self.lent.points.all = Some(all);
        Ok(Some(points?.split_off(run.start)))
    }

    /// Starts to copy new external positions to `all`, and all external positions to a key frame. Returns the upload's
    /// value, if there is anything to copy.
    pub(crate) fn copy_points(&mut self, key: Option<&Buffer>) -> Result<Option<u64>> {
        let LentPoints { all, runs, pending } = &self.lent.points;
        let Some(all) = all.as_ref().filter(|_| !runs.is_empty()) else {
            return Ok(None);
        };
        let brought = pending.iter().map(|(from, offset, run)| {
            let region = region(*offset, run.start as u64 * POINT, run);
            ([from, all], vec![region])
        });
        let place = |run: &Range<usize>| {
            let at = run.start as u64 * POINT;
            region(at, at, run)
        };
        let kept = key.map(|key| ([all, key], runs.iter().map(place).collect()));
        let copies: Vec<_> = brought.chain(kept).collect();
        if copies.is_empty() {
            return Ok(None);
        }
        let filled_at = self.upload.start_in_order(&copies, &self.lent.waits)?;
        for (from, ..) in self.lent.points.pending.drain(..) {
            let (arrival, ticket) = (filled_at, 0);
            self.outgrown.put(from, LastUse { arrival, ticket });
        }
        Ok(Some(filled_at))
    }

    /// Makes the next query of [`backend::Rays::OnDevice`] trace these rays. Their buffers must be
    /// [lent](Buffer::lent).
    pub fn lend_rays(&mut self, rays: LentRays<Buffer>) {
        self.lent.rays = Some(rays);
    }

    /// Fills a lent buffer, in the order of submissions.
    pub(crate) fn write_lent<T: Pod + Send + Sync>(
        &mut self,
        to: &Buffer,
        rows: &[T],
    ) -> Result<()> {
        let bytes = size_of_val(rows) as u64;
        if bytes == 0 {
            return Ok(());
        }
        let mut staging = Buffer::new(&self.gpu, "answers", bytes, BufferUse::Upload)?;
        staging.set_rows(rows);
        let region = vk::BufferCopy::default().size(bytes);
        let copy = ([&staging, to], vec![region]);
        let value = self.upload.start_in_order(&[copy], &self.lent.waits)?;
        self.arriving = self.arriving.max(Some(value));
        let last = self.last_use();
        self.outgrown.put(staging, last);
        Ok(())
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
            if !signal.is_told || !signal.timeline.has_reached(signal.value)? {
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
            is_told: false,
        });
        Ok(())
    }

    /// Submits the pending signals. Their timelines reach their values once all submitted work has finished and lent
    /// memory has been read.
    pub fn signal(&mut self) -> Result<()> {
        if self.lent.signals.iter().all(|signal| signal.is_told) {
            return Ok(());
        }
        let copied = self.copy_points(None)?;
        let copied = copied.map(|value| self.upload.done.at(value));
        let after = [self.lent.waits.as_slice(), copied.as_slice()].concat();
        let open = self.lent.signals.iter().filter(|signal| !signal.is_told);
        let batches = open.map(|signal| Batch {
            commands: None,
            after: &after,
            done: signal.timeline.at(signal.value),
        });
        let batches: Vec<_> = batches.collect();
        submit(&self.gpu, &self.compute, &batches)?;
        self.lent.waits.clear();
        for signal in &mut self.lent.signals {
            signal.is_told = true;
        }
        Ok(())
    }
}
