//! What a device keeps to make trees, in buffers of whatever kind its host has.

use super::Room;
use geom::Animation;

/// Buffers by the kernels' names: see [`Room`].
#[derive(Debug)]
pub struct Buffers<B> {
    live: B,
    /// The numbers from 0 on, unless `live` is just that.
    numbers: Option<B>,
    keys: B,
    sorted: B,
    digits: B,
    boxes: B,
    clusters: B,
}

impl<B> Buffers<B> {
    /// Those that trees of the scene take; `make` makes one of so many bytes, by a name for messages.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn new<E>(
        animation: &Animation,
        mut make: impl FnMut(&'static str, u64) -> Result<B, E>,
    ) -> Result<Self, E> {
        let room = Room::of(animation.live_count() as u32);
        Ok(Self {
            live: make("the live triangles", room.live)?,
            numbers: match animation.live_count() == animation.triangle_count() {
                true => None,
                false => Some(make("the numbers of leaves", room.live)?),
            },
            keys: make("keys to sort by", room.keys)?,
            sorted: make("sorted triangles", room.sorted)?,
            digits: make("counts of digits", room.digits)?,
            boxes: make("the scene's box", room.boxes)?,
            clusters: make("clusters", room.clusters)?,
        })
    }

    /// Has `send` fill what kernels expect to be filled.
    ///
    /// # Errors
    /// Those of `send`.
    pub fn fill<E>(
        &self,
        animation: &Animation,
        mut send: impl FnMut(&[u32], &B) -> Result<(), E>,
    ) -> Result<(), E> {
        let all = 0..animation.triangle_count() as u32;
        let live: Vec<u32> = all.filter(|&t| animation.is_live(t)).collect();
        send(&live, &self.live)?;
        match &self.numbers {
            Some(numbers) => send(&(0..live.len() as u32).collect::<Vec<_>>(), numbers),
            None => Ok(()),
        }
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = &B> {
        let all = [&self.live, &self.keys, &self.sorted, &self.digits];
        let all = all.into_iter().chain([&self.boxes, &self.clusters]);
        all.chain(&self.numbers)
    }

    /// The leaves' triangles, from the start.
    pub fn sorted(&self) -> &B {
        &self.sorted
    }

    /// The buffer of that name, where there is one.
    pub fn find(&self, name: &str) -> Option<&B> {
        Some(match name {
            "live" => &self.live,
            "keys" => &self.keys,
            "sorted" => &self.sorted,
            "digits" => &self.digits,
            "boxes" => &self.boxes,
            "clusters" => &self.clusters,
            _ => return None,
        })
    }

    /// What stands for a tree's buffer while leaves are made into clusters.
    pub fn instead_of(&self, name: &str) -> Option<&B> {
        Some(match name {
            "topology" => &self.sorted,
            "leaf_nodes" => self.numbers.as_ref().unwrap_or(&self.live),
            "nodes" => &self.clusters,
            _ => return None,
        })
    }
}
