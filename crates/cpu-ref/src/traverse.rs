//! Traversal of a tree by one ray, nearest child first.

use crate::bvh2::Bvh2;
use crate::intersect::{Candidate, Meeting, Record, TriangleTest};
use crate::scale::{PreparedRay, flushed};
use crate::slab::Slab;
use bvh_build::MAX_DEPTH;
use bvh_layout::Link;
use geom::Aabb;

/// A tree with the boxes and triangles of one moment, in any form.
pub trait Tree: Copy + Sync {
    /// Stack of nodes still to visit.
    type Waiting: Default;

    /// Returns the root box, in scaled units.
    fn root(&self) -> Aabb;

    /// Returns the triangle in a place, or `None` if the place is empty.
    fn triangle(&self, place: usize) -> Option<u32>;

    /// Returns the record for test `T` of the triangle in a place.
    fn record<T: TriangleTest>(&self, place: usize) -> Record;

    /// Calls `each` for each child of a node with the child's box. The root is a child of [`Below::ROOT`].
    fn children(&self, node: u32, each: impl FnMut(&Aabb, Below));

    /// Calls `see` for every leaf whose box the ray meets before the bound, which is `t_max` at first. `see` returns
    /// the next bound, or `None` to end the visit. Returns whether `see` ended it.
    fn visit(
        &self,
        ray: &PreparedRay,
        waiting: &mut Self::Waiting,
        see: impl FnMut(&Leaf, f32) -> Option<f32>,
    ) -> bool;
}

/// A child of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Below {
    /// Another node.
    Node(u32),
    /// Triangles, by their places.
    Places {
        /// First place.
        first: usize,
        /// Number of places.
        count: usize,
    },
}

impl Below {
    /// Where traversal starts.
    pub const ROOT: Self = Self::Node(0);
}

/// A triangle whose own box the ray meets, and the span of the ray within that box.
#[derive(Clone, Copy, Debug)]
pub struct Leaf {
    /// Place of the triangle in the tree.
    pub place: usize,
    /// The later of entry and `t_min`.
    pub entry: f32,
    /// Distance at which the ray leaves the box.
    pub exit: f32,
}

/// A node still to visit, and the span of the ray within its box.
#[derive(Clone, Copy)]
struct Entry {
    link: Link,
    /// The later of entry and `t_min`.
    entry: f32,
    exit: f32,
}

/// Scratch memory of one thread, reused from ray to ray.
pub struct Stack<N: Tree> {
    /// Nodes still to visit.
    pub waiting: N::Waiting,
    /// Triangles that the exact test has not excluded for the current ray.
    pub(crate) candidates: Vec<Candidate>,
}

impl<N: Tree> Default for Stack<N> {
    fn default() -> Self {
        Self {
            waiting: N::Waiting::default(),
            candidates: Vec::new(),
        }
    }
}

/// Stack of nodes still to visit. Each level leaves at most one node on it, so it cannot overflow.
pub struct Waiting {
    entries: [Entry; MAX_DEPTH as usize],
    len: usize,
}

impl Default for Waiting {
    fn default() -> Self {
        let unused = Entry {
            link: Link::ROOT,
            entry: 0.0,
            exit: 0.0,
        };
        Self {
            entries: [unused; MAX_DEPTH as usize],
            len: 0,
        }
    }
}

impl Waiting {
    #[inline(always)]
    fn push(&mut self, entry: Entry) {
        self.entries[self.len] = entry;
        self.len += 1;
    }

    /// Pops nodes until the ray enters one no later than `best`, and returns that node.
    #[inline(always)]
    fn pop(&mut self, best: f32) -> Option<Entry> {
        while self.len > 0 {
            self.len -= 1;
            let entry = self.entries[self.len];
            // Equal distances are visited too: such a hit may have a lower index.
            if entry.entry <= best {
                return Some(entry);
            }
        }
        None
    }
}

impl Bvh2 {
    /// Descends from the inner node `link` through nearer children to a leaf. Returns `None` if the ray misses both
    /// children of a node on the way.
    #[inline(always)]
    fn descend(
        &self,
        slab: &Slab,
        mut link: Link,
        best: f32,
        stack: &mut Waiting,
    ) -> Option<Entry> {
        loop {
            let pair = &self.pairs[link.index()];
            let met = slab.meet(pair, best);
            let child = |lane: usize| Entry {
                link: pair.links[lane],
                entry: met.entry(lane),
                exit: met.exit(lane),
            };
            // Branches instead of selections: branch prediction lets the next pair be fetched early.
            let next = match met.lanes {
                0 => return None,
                1 => child(0),
                2 => child(1),
                _ if met.entry(0) <= met.entry(1) => {
                    stack.push(child(1));
                    child(0)
                }
                _ => {
                    stack.push(child(0));
                    child(1)
                }
            };
            if next.link.is_block() {
                return Some(next);
            }
            link = next.link;
        }
    }
}

impl Tree for &Bvh2 {
    type Waiting = Waiting;

    #[inline]
    fn root(&self) -> Aabb {
        self.pairs[0].bounds(1)
    }

    #[inline(always)]
    fn triangle(&self, place: usize) -> Option<u32> {
        Some(self.triangles[place])
    }

    #[inline(always)]
    fn record<T: TriangleTest>(&self, place: usize) -> Record {
        self.records[place]
    }

    fn children(&self, node: u32, mut each: impl FnMut(&Aabb, Below)) {
        let pair = &self.pairs[node as usize];
        for (lane, link) in pair.links.into_iter().enumerate() {
            let below = match link.is_block() {
                true => Below::Places {
                    first: link.index(),
                    count: 1,
                },
                false => Below::Node(link.index() as u32),
            };
            each(&pair.bounds(lane), below);
        }
    }

    #[inline(always)]
    fn visit(
        &self,
        ray: &PreparedRay,
        stack: &mut Waiting,
        mut see: impl FnMut(&Leaf, f32) -> Option<f32>,
    ) -> bool {
        let slab = Slab::new(ray);
        let mut bound = ray.t_max;
        stack.len = 0;
        let mut next = self.descend(&slab, Link::ROOT, bound, stack);
        loop {
            if let Some(Entry { link, entry, exit }) = next {
                let place = link.index();
                match see(&Leaf { place, entry, exit }, bound) {
                    Some(tighter) => bound = tighter,
                    None => return true,
                }
            }
            let Some(entry) = stack.pop(bound) else {
                return false;
            };
            next = if entry.link.is_block() {
                Some(entry)
            } else {
                self.descend(&slab, entry.link, bound, stack)
            };
        }
    }
}

/// Intersects a ray with the triangle of a leaf, within the ray's limits and with `t` clamped to the leaf's box.
#[inline(always)]
pub(crate) fn meet_leaf<T: TriangleTest>(
    tree: impl Tree,
    (ray, test): (&PreparedRay, &T::Ray),
    leaf: &Leaf,
) -> Option<Meeting> {
    let mut meeting = T::meet(test, &tree.record::<T>(leaf.place))?;
    if meeting.t < leaf.entry {
        meeting.t = leaf.entry;
    } else if meeting.t > leaf.exit {
        meeting.t = leaf.exit;
    }
    meeting.t = flushed(meeting.t);
    (meeting.t > ray.t_min && meeting.t < ray.t_max).then_some(meeting)
}
