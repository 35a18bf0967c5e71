//! One ray through a tree, nearest child first.

use crate::bvh2::Bvh2;
use crate::intersect::{Candidate, Meeting, Record, TriangleTest};
use crate::scale::{PreparedRay, flushed};
use crate::slab::Slab;
use bvh_build::MAX_DEPTH;
use bvh_layout::Link;
use geom::Aabb;

/// A tree with the boxes and triangles of one moment, whatever its layout.
pub trait Tree: Copy + Sync {
    /// Nodes still to visit.
    type Waiting: Default;

    /// The box of the whole tree, in scaled units.
    fn root(&self) -> Aabb;

    /// The triangle in a place, if there is one.
    fn triangle(&self, place: usize) -> Option<u32>;

    /// What `T` keeps of the triangle in a place.
    fn record<T: TriangleTest>(&self, place: usize) -> Record;

    /// Shows what lies right below a node, with its box; the root is below [`Below::ROOT`].
    fn children(&self, node: u32, each: impl FnMut(&Aabb, Below));

    /// Hands `see` every leaf whose box the ray meets before the bound that `see`
    /// returned last, at first `t_max`; where it returns none, the visit ends with `true`.
    fn visit(
        &self,
        ray: &PreparedRay,
        waiting: &mut Self::Waiting,
        see: impl FnMut(&Leaf, f32) -> Option<f32>,
    ) -> bool;
}

/// What lies below a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Below {
    /// Another node.
    Node(u32),
    /// Triangles, by their places.
    Places {
        /// The first.
        first: usize,
        /// How many there are.
        count: usize,
    },
}

impl Below {
    /// Where every tree begins.
    pub const ROOT: Self = Self::Node(0);
}

/// A triangle whose own box the ray meets, and the span of the ray within it.
#[derive(Clone, Copy, Debug)]
pub struct Leaf {
    /// Where the tree keeps the triangle.
    pub place: usize,
    /// The later of entry and `t_min`.
    pub entry: f32,
    /// Where the ray leaves the box.
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

/// What a thread needs to trace ray after ray.
pub struct Stack<N: Tree> {
    /// Nodes still to visit.
    pub waiting: N::Waiting,
    /// What the exact test keeps of a ray.
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

/// Nodes still to visit. Each level leaves at most one behind, so it cannot overflow.
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

    /// The last node pushed that the ray enters no later than `best`.
    #[inline(always)]
    fn pop(&mut self, best: f32) -> Option<Entry> {
        while self.len > 0 {
            self.len -= 1;
            let entry = self.entries[self.len];
            // Equal entries stay: a hit at the same distance may have a lower index.
            if entry.entry <= best {
                return Some(entry);
            }
        }
        None
    }
}

impl Bvh2 {
    /// Goes down from `link`, which is no leaf, by nearer children to a leaf; `None` where none is met.
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
            // Branches, not selections: a guess lets the next pair be fetched early.
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

/// Where a ray meets the triangle of a leaf within its limits, `t` clamped to the leaf's box.
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
