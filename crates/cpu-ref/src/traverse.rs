//! One ray through the tree, nearest child first.

use crate::exact::Candidate;
use crate::nodes::{Link, Nodes};
use crate::ray::PreparedRay;
use crate::scale::flushed;
use crate::slab::Slab;
use crate::triangle_test::{Meeting, Record, TriangleTest};
use bvh_build::MAX_DEPTH;
use geom::Hit;

/// What rays are traced through: boxes and records of one moment.
#[derive(Clone, Copy)]
pub(crate) struct Target<'a> {
    /// Boxes and links.
    pub(crate) nodes: &'a Nodes,
    /// One a leaf.
    pub(crate) records: &'a [Record],
}

/// A node still to visit, and the span of the ray within its box.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) link: Link,
    /// The later of entry and `t_min`.
    pub(crate) entry: f32,
    pub(crate) exit: f32,
}

/// Nodes still to visit. Each level leaves at most one behind, so it cannot overflow.
pub(crate) struct Stack {
    entries: [Entry; MAX_DEPTH as usize],
    len: usize,
    /// What the exact test keeps of a ray.
    pub(crate) candidates: Vec<Candidate>,
}

impl Stack {
    /// An empty stack, to be used for many rays.
    pub(crate) fn new() -> Self {
        let unused = Entry {
            link: Link::ROOT,
            entry: 0.0,
            exit: 0.0,
        };
        Self {
            entries: [unused; MAX_DEPTH as usize],
            len: 0,
            candidates: Vec::new(),
        }
    }

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

/// One ray on its way.
pub(crate) struct Walk<'a, T: TriangleTest> {
    pub(crate) target: Target<'a>,
    pub(crate) ray: &'a PreparedRay,
    slab: Slab,
    pub(crate) test: T::Ray,
}

impl<'a, T: TriangleTest> Walk<'a, T> {
    #[inline(always)]
    pub(crate) fn new(target: Target<'a>, ray: &'a PreparedRay) -> Self {
        Self {
            target,
            ray,
            slab: Slab::new(ray, &target.nodes.root()),
            test: T::prepare(ray),
        }
    }

    /// Where the ray meets the triangle of a leaf within its limits, `t` clamped to the leaf's box.
    #[inline(always)]
    fn meet_leaf(&self, leaf: &Entry) -> Option<Meeting> {
        let mut meeting = T::meet(&self.test, &self.target.records[leaf.link.index()])?;
        if meeting.t < leaf.entry {
            meeting.t = leaf.entry;
        } else if meeting.t > leaf.exit {
            meeting.t = leaf.exit;
        }
        meeting.t = flushed(meeting.t);
        (meeting.t > self.ray.t_min && meeting.t < self.ray.t_max).then_some(meeting)
    }

    /// Goes down from `link`, which is no leaf, by nearer children to a leaf; `None` where none is met.
    #[inline(always)]
    fn descend(&self, mut link: Link, best: f32, stack: &mut Stack) -> Option<Entry> {
        loop {
            let pair = &self.target.nodes.pairs[link.index()];
            let met = self.slab.meet(pair, best);
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
            if next.link.is_leaf() {
                return Some(next);
            }
            link = next.link;
        }
    }

    /// Hands `see` every leaf whose box the ray meets before the bound that `see`
    /// returned last, at first `t_max`; where it returns none, the visit ends with `true`.
    #[inline(always)]
    pub(crate) fn visit(
        &self,
        stack: &mut Stack,
        mut see: impl FnMut(&Entry, f32) -> Option<f32>,
    ) -> bool {
        let mut bound = self.ray.t_max;
        stack.len = 0;
        let mut next = self.descend(Link::ROOT, bound, stack);
        loop {
            if let Some(leaf) = next {
                match see(&leaf, bound) {
                    Some(tighter) => bound = tighter,
                    None => return true,
                }
            }
            let Some(entry) = stack.pop(bound) else {
                return false;
            };
            next = if entry.link.is_leaf() {
                Some(entry)
            } else {
                self.descend(entry.link, bound, stack)
            };
        }
    }
}

/// The closest hit, its `t` in scaled units.
pub(crate) fn closest<T: TriangleTest>(
    target: Target<'_>,
    ray: &PreparedRay,
    stack: &mut Stack,
) -> Option<Hit> {
    let walk = Walk::<T>::new(target, ray);
    let mut best = Hit {
        t: ray.t_max,
        ..Hit::MISS
    };
    walk.visit(stack, |leaf, _| {
        if let Some(Meeting { t, u, v }) = walk.meet_leaf(leaf)
            && t <= best.t
        {
            let triangle = target.nodes.triangles[leaf.link.index()];
            let hit = Hit { t, u, v, triangle };
            if hit.is_before(&best) {
                best = hit;
            }
        }
        Some(best.t)
    });
    best.is_hit().then_some(best)
}

/// Whether the ray hits any triangle but `skipped`.
pub(crate) fn any<T: TriangleTest>(
    target: Target<'_>,
    ray: &PreparedRay,
    skipped: Option<u32>,
    stack: &mut Stack,
) -> bool {
    let walk = Walk::<T>::new(target, ray);
    walk.visit(stack, |leaf, bound| {
        let hit = walk.meet_leaf(leaf).is_some()
            && Some(target.nodes.triangles[leaf.link.index()]) != skipped;
        (!hit).then_some(bound)
    })
}
