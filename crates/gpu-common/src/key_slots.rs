//! Key frames on the device: all of them, or those around the current pose.
//!
//! *Paged* key frames are read during playback; *streamed* ones are pushed by the program.

use crate::device::has_ended;
use crate::pool::LARGE;
use crate::{GpuDevice, LastUse, Pool, Upload};
use backend::{Result, Ticket};
use geom::{Animation, KeyFrame, Point, Pose};
use shaders::BufferName;
use std::ops::Range;

/// Number of paged or streamed key frames that are kept: the two that are blended, and two upcoming ones. Buffers of
/// evicted key frames may still wait for their last use to finish.
const KEPT: usize = 4;
/// The same for large key frames: only one upcoming key frame is kept.
const LARGE_KEPT: usize = 3;

/// Minimum number of static vertices between two runs of moving ones. Shorter gaps are uploaded with the runs.
const GAP: usize = 1 << 12;

/// Key frames, each in its own buffer: all that the host holds, or else the paged or streamed ones that were used last.
pub(crate) struct KeySlots<D: GpuDevice> {
    /// In upload order.
    slots: Vec<KeySlot<D>>,
    /// Buffers of evicted key frames.
    free: Pool<D::Buffer>,
    /// Maximum number of paged or streamed key frames, unless a recording or the latest pose needs more.
    kept: usize,
    /// Increases with each use.
    clock: u64,
    /// Ticket of the submission that is being recorded.
    next: u64,
    /// Latest pose. Its key frames are not evicted, because the next recording may read them again.
    pose: Pose,
    /// Vertices that differ between key frames.
    moving: Vec<Range<usize>>,
}

struct KeySlot<D: GpuDevice> {
    key: usize,
    buffer: D::Buffer,
    /// Number of the upload that fills it.
    upload_value: u64,
    /// Value of the clock at the last use. The lowest one is evicted first.
    used: u64,
    /// Ticket of the last submission that reads it.
    read_by: u64,
}

impl<D: GpuDevice> KeySlots<D> {
    /// Uploads the key frames that the host holds. Paged and streamed ones follow later.
    pub(crate) fn new(gpu: &mut D, animation: &Animation) -> Result<Self> {
        let slot = |(key, frame): (usize, &KeyFrame)| {
            Ok(KeySlot {
                key,
                buffer: gpu.buffer(BufferName::Earlier, size_of_val(&frame[..]) as u64)?,
                upload_value: 0,
                used: 0,
                read_by: 0,
            })
        };
        let held = animation.held_keys().unwrap_or_default();
        let slots = held.iter().enumerate().map(slot);
        let slots = slots.collect::<Result<Vec<_>>>()?;
        let frames = held.iter().map(|frame| bytemuck::cast_slice(frame));
        let contents = frames.zip(slots.iter().map(|slot| &slot.buffer));
        gpu.upload(&contents.collect::<Vec<_>>())?;
        Ok(Self {
            slots,
            free: Pool::default(),
            kept: match (animation.vertex_count() * size_of::<Point>()) as u64 {
                LARGE.. => LARGE_KEPT,
                _ => KEPT,
            },
            clock: 0,
            next: 0,
            pose: Pose::default(),
            moving: animation.static_parts().moving_runs(GAP),
        })
    }

    /// Makes the key frames of a pose available to the recording that follows submission `last`. Blocks while missing
    /// key frames are read. Returns the number of the upload that the recording must wait for.
    pub(crate) fn upload_pose(
        &mut self,
        gpu: &mut D,
        animation: &Animation,
        pose: Pose,
        last: Ticket,
    ) -> Result<u64> {
        // `preprocess` reads the key frames of the latest pose, also in submissions without an interpolation.
        for slot in &mut self.slots {
            if self.pose.keys().any(|key| key == slot.key) {
                slot.read_by = slot.read_by.max(last.0);
            }
        }
        (self.pose, self.next) = (pose, last.0 + 1);
        let mut upload_value = 0;
        for key in pose.keys() {
            if self.find(key).is_none() {
                self.upload(gpu, key, &animation.key(key)?)?;
            }
            let next = self.next;
            let slot = self.touch(key).expect("it was sent");
            slot.read_by = next;
            upload_value = upload_value.max(slot.upload_value);
        }
        Ok(upload_value)
    }

    /// Notes that the recording was submitted. Uploads the next upcoming key frame that is not on the device, if the
    /// host has read it.
    pub(crate) fn submitted(
        &mut self,
        gpu: &mut D,
        animation: &Animation,
        ticket: Ticket,
    ) -> Result<()> {
        self.next = ticket.0 + 1;
        let upcoming = animation.upcoming(self.kept);
        let wanted = upcoming.iter().find(|(key, _)| self.find(*key).is_none());
        let Some((key, frame)) = wanted else {
            return Ok(());
        };
        // An earlier upcoming key frame must not be evicted for a later one.
        for (key, _) in &upcoming {
            self.touch(*key);
        }
        self.upload(gpu, *key, frame)
    }

    /// Returns the slot of a key frame and makes it the last one to be evicted.
    fn touch(&mut self, key: usize) -> Option<&mut KeySlot<D>> {
        self.clock += 1;
        let at = self.find(key)?;
        let slot = &mut self.slots[at];
        slot.used = self.clock;
        Some(slot)
    }

    fn find(&self, key: usize) -> Option<usize> {
        let is_there = |slot: &KeySlot<D>| slot.key == key;
        // If the host holds all key frames, they were uploaded in order, so the slot's index is the key frame's number.
        let is_in_order = self.slots.get(key).is_some_and(is_there);
        is_in_order
            .then_some(key)
            .or_else(|| self.slots.iter().position(is_there))
    }

    /// Uploads a paged or streamed key frame. Evicts the least recently used ones if there are too many.
    fn upload(&mut self, gpu: &mut D, key: usize, frame: &KeyFrame) -> Result<()> {
        // The newest key frame may be the only copy of positions from a buffer of the program. The recording then
        // copies them from there, so it counts as a reader of that key frame.
        if let Some(before) = self.slots.last_mut() {
            before.read_by = self.next;
        }
        while self.slots.len() >= self.kept {
            // The recording may still read its key frames, and the next one may read the latest pose again.
            let is_at_pose = |slot: &KeySlot<D>| self.pose.keys().any(|key| key == slot.key);
            let all = self.slots.iter().enumerate();
            let free = all.filter(|(_, slot)| slot.read_by < self.next && !is_at_pose(slot));
            let Some((oldest, _)) = free.min_by_key(|(_, slot)| slot.used) else {
                break;
            };
            let old = self.slots.remove(oldest);
            let size = D::size(&old.buffer);
            let last = LastUse {
                upload_value: old.upload_value,
                ticket: old.read_by,
            };
            self.free.put(old.buffer, size, last);
        }
        let bytes = size_of_val(&frame[..]) as u64;
        let spare = self
            .free
            .fit(bytes, |last, may_wait| has_ended(gpu, last, may_wait))?;
        let all = 0..frame.len();
        let runs = if spare.is_some() {
            &self.moving
        } else {
            std::slice::from_ref(&all)
        };
        let buffer = match spare {
            Some(buffer) => buffer,
            None => gpu.buffer(BufferName::KeyFrame, bytes)?,
        };
        let upload = Upload::KeyFrame { key: frame, runs };
        let sent = gpu.send(upload, &buffer);
        if sent.is_err() {
            // Part of the upload may have started. If the wait fails too, the device is lost.
            let _ = gpu.wait(None);
        }
        let upload_value = sent?;
        self.clock += 1;
        self.slots.push(KeySlot {
            key,
            buffer,
            upload_value,
            used: self.clock,
            read_by: 0,
        });
        Ok(())
    }

    /// Returns the buffer of an available key frame. Returns any buffer if `key` is not available, since the kernel
    /// then does not read it.
    pub(crate) fn get(&self, key: u32) -> Option<&D::Buffer> {
        let slot = match self.find(key as usize) {
            Some(at) => &self.slots[at],
            None => self.slots.last()?,
        };
        Some(&slot.buffer)
    }

    /// Returns the bytes of device memory.
    pub(crate) fn held(&self) -> u64 {
        let slots = self
            .slots
            .iter()
            .map(|slot| D::size(&slot.buffer).allocated);
        slots.sum::<u64>() + self.free.held()
    }
}
