//! Key frames on the device: all of them, or those around the moment that is played.

use crate::pool::LARGE;
use crate::{GpuDevice, LastUse, Pool};
use backend::{Result, Ticket};
use geom::{Animation, KeyFrame, Point, Pose};
use shaders::BufferName;
use std::ops::Range;

/// Key frames that are kept of a stream: two that are blended and as many to come; of large ones, one to come. Two more may be
/// on their way out.
const KEPT: usize = 4;
const LARGE_KEPT: usize = 3;

/// Vertices between two runs that differ, at least: fewer are sent with them.
const GAP: usize = 1 << 12;

/// Key frames by their numbers. A buffer each, so that only the device's memory limits how many there are.
pub(crate) struct KeySlots<D: GpuDevice> {
    /// In the order in which they were sent.
    slots: Vec<KeySlot<D>>,
    /// Buffers that made room for others.
    free: Pool<D>,
    /// How many are kept of a stream.
    kept: usize,
    /// Rises with each use.
    clock: u64,
    /// The ticket of the submission that is recorded.
    next: u64,
    /// What was brought last, and may be read again.
    pose: Pose,
    /// Vertices that are not the same in all key frames.
    moving: Vec<Range<usize>>,
}

struct KeySlot<D: GpuDevice> {
    key: usize,
    buffer: D::Buffer,
    /// See [`GpuDevice::send_key`].
    arrival: u64,
    /// By the clock: how soon it makes room for others.
    used: u64,
    /// The submission that read it last.
    read_by: u64,
}

impl<D: GpuDevice> KeySlots<D> {
    /// Sends the key frames that are held; none of a stream.
    pub(crate) fn new(gpu: &mut D, animation: &Animation) -> Result<Self> {
        let slot = |(key, frame): (usize, &KeyFrame)| {
            Ok(KeySlot {
                key,
                buffer: gpu.buffer(BufferName::Earlier, size_of_val(&frame[..]) as u64)?,
                arrival: 0,
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

    /// Has the key frames of a pose be there for all that is recorded from now on, after the last submission. Waits for those
    /// that have to be read.
    pub(crate) fn bring(
        &mut self,
        gpu: &mut D,
        (animation, pose): (&Animation, Pose),
        last: Ticket,
    ) -> Result<()> {
        (self.pose, self.next) = (pose, last.0 + 1);
        for key in pose.keys() {
            if self.find(key).is_none() {
                self.send(gpu, (key, &animation.key(key)?))?;
            }
            let next = self.next;
            let slot = self.touch(key).expect("it was sent");
            slot.read_by = next;
            gpu.expect(slot.arrival);
        }
        Ok(())
    }

    /// What was recorded is submitted. Sends one of the key frames that are played next, if it was read.
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
        // What is played soon must not make room for what is played later.
        for (key, _) in &upcoming {
            self.touch(*key);
        }
        self.send(gpu, (*key, frame))
    }

    /// A key frame's place, which is kept longest from now on.
    fn touch(&mut self, key: usize) -> Option<&mut KeySlot<D>> {
        self.clock += 1;
        let at = self.find(key)?;
        let slot = &mut self.slots[at];
        slot.used = self.clock;
        Some(slot)
    }

    fn find(&self, key: usize) -> Option<usize> {
        let is_there = |slot: &KeySlot<D>| slot.key == key;
        // Those that are held lie in order.
        match self.slots.get(key).is_some_and(is_there) {
            true => Some(key),
            false => self.slots.iter().position(is_there),
        }
    }

    /// Sends a key frame of a stream, in the place of the one that was used longest ago.
    fn send(&mut self, gpu: &mut D, (key, frame): (usize, &KeyFrame)) -> Result<()> {
        // Positions that are lent may be copied from the one that was sent before.
        if let Some(before) = self.slots.last_mut() {
            before.read_by = self.next;
        }
        while self.slots.len() >= self.kept {
            // What is recorded now may yet read what it asked for, and what follows may read the last pose again.
            let is_played = |slot: &KeySlot<D>| self.pose.keys().any(|key| key == slot.key);
            let all = self.slots.iter().enumerate();
            let free = all.filter(|(_, slot)| slot.read_by < self.next && !is_played(slot));
            let Some((oldest, _)) = free.min_by_key(|(_, slot)| slot.used) else {
                break;
            };
            let old = self.slots.remove(oldest);
            let (arrival, ticket) = (old.arrival, old.read_by);
            self.free.put(old.buffer, LastUse { arrival, ticket });
        }
        let bytes = size_of_val(&frame[..]) as u64;
        let (buffer, held_another) = self.free.fit(
            bytes,
            |last, may_wait| gpu.has_ended(last, may_wait),
            || gpu.room("key frames", bytes),
        )?;
        let all = 0..frame.len();
        let runs = match held_another {
            true => &self.moving,
            false => std::slice::from_ref(&all),
        };
        let arrival = match gpu.send_key(frame, runs, &buffer) {
            Ok(arrival) => arrival,
            Err(e) => {
                // It may be under way in part.
                gpu.discard(buffer);
                return Err(e);
            }
        };
        self.clock += 1;
        self.slots.push(KeySlot {
            key,
            buffer,
            arrival,
            used: self.clock,
            read_by: 0,
        });
        Ok(())
    }

    /// The buffer of a key frame that was brought; any where the kernel does not read it.
    pub(crate) fn get(&self, key: u32) -> Option<&D::Buffer> {
        let slot = match self.find(key as usize) {
            Some(at) => &self.slots[at],
            None => self.slots.last()?,
        };
        Some(&slot.buffer)
    }

    /// Bytes of device memory.
    pub(crate) fn held(&self) -> u64 {
        let slots = self.slots.iter().map(|slot| D::held(&slot.buffer));
        slots.sum::<u64>() + self.free.held()
    }
}
