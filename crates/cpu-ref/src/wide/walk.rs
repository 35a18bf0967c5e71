//! One ray through the nodes, nearest child first, eight boxes at a time.

use super::tree::{LANES, Link, Node};
use crate::ray::PreparedRay;
use crate::simd::{Halves, Isa, Lanes, each};
use crate::slab::Reach;
use bvh_build::MAX_DEPTH;

/// A node or block still to visit.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    link: Link,
    entry: f32,
}

/// Each level of the binary tree leaves at most one behind, and one more node may be split up.
const DEEPEST: usize = (LANES - 1) * (MAX_DEPTH as usize + 1);

/// Nodes and blocks still to visit, the next one last.
pub(crate) struct Stack {
    waiting: [Waiting; DEEPEST],
    len: usize,
}

impl Stack {
    #[inline]
    pub(crate) fn new() -> Self {
        let unused = Waiting {
            link: Link::ROOT,
            entry: 0.0,
        };
        Self {
            waiting: [unused; DEEPEST],
            len: 0,
        }
    }

    #[inline(always)]
    fn push(&mut self, next: Waiting) {
        self.waiting[self.len] = next;
        self.len += 1;
    }

    /// The last one that the ray enters no later than `best`.
    #[inline(always)]
    fn pop(&mut self, best: f32) -> Option<Link> {
        while self.len > 0 {
            self.len -= 1;
            let next = self.waiting[self.len];
            // Equal entries stay: a hit at the same distance may have a lower index.
            if next.entry <= best {
                return Some(next.link);
            }
        }
        None
    }
}

/// What is to be done with the blocks that a ray comes to.
pub(crate) trait Visitor {
    /// Sees a block whose box the ray meets before `bound`, and returns the next bound; none ends the walk.
    /// Must be `#[inline(always)]`.
    fn block(&mut self, block: usize, bound: f32) -> Option<f32>;
}

/// What the box test needs of a ray: see [`crate::slab::Slab`].
#[derive(Clone, Copy)]
pub(crate) struct NodeRay<P> {
    origin: [P; 3],
    inverse: [P; 3],
    pad: [P; 3],
    turned: [bool; 3],
    floor: P,
}

impl<P: Halves> NodeRay<P> {
    #[inline(always)]
    pub(crate) fn new(ray: &PreparedRay, reach: &Reach) -> Self {
        Self {
            origin: each!(i => P::splat(ray.origin[i])),
            inverse: each!(i => halves(reach.inverse[i], -reach.inverse[i])),
            pad: each!(i => P::splat(reach.pad[i])),
            turned: each!(i => ray.direction[i].is_sign_negative()),
            floor: halves(ray.t_min, f32::NEG_INFINITY),
        }
    }
}

/// `low` for lower planes, `high` for upper ones.
#[inline(always)]
pub(crate) fn halves<P: Halves>(low: f32, high: f32) -> P {
    P::join(P::Half::splat(low), P::Half::splat(high))
}

/// Something that boxes are tested against.
pub(crate) trait BoxTest<P: Halves> {
    /// Which of eight boxes cannot be skipped, and where they are entered. Must be `#[inline(always)]`.
    fn meet(&self, planes: &[P; 3], best: f32) -> (u32, P::Half);
}

impl<P: Halves> BoxTest<P> for NodeRay<P> {
    #[inline(always)]
    fn meet(&self, planes: &[P; 3], best: f32) -> (u32, P::Half) {
        let [x, y, z] = each!(axis => {
            planes[axis]
                .sub(self.origin[axis])
                .mul(self.inverse[axis])
                .sub(self.pad[axis])
                .turned(self.turned[axis])
        });
        let spans = self.floor.max(x).max(y).max(z);
        let exit = spans.high().neg().min(P::Half::splat(best));
        (P::Half::bits(spans.low().at_most(exit)), spans.low())
    }
}

/// Shows `visitor` the blocks that rays may hit, roughly in their order; whether it ended the walk.
#[inline(always)]
pub(crate) fn walk<I: Isa>(
    nodes: &[Node],
    (rays, mut bound): (&impl BoxTest<I::Planes>, f32),
    stack: &mut Stack,
    visitor: &mut impl Visitor,
) -> bool {
    stack.len = 0;
    let mut link = Link::ROOT;
    loop {
        if link.is_block() {
            match visitor.block(link.index(), bound) {
                Some(next) => bound = next,
                None => return true,
            }
        } else {
            let node = &nodes[link.index()];
            let planes = each!(axis => I::Planes::load(&node.planes[axis]));
            let (lanes, entry) = rays.meet(&planes, bound);
            if let Some(next) = nearest(node, lanes, entry, stack) {
                link = next;
                continue;
            }
        }
        match stack.pop(bound) {
            Some(next) => link = next,
            None => return false,
        }
    }
}

/// The nearest of `lanes`; the others wait, farthest first.
#[inline(always)]
fn nearest<L: Lanes<Array = [f32; LANES]>>(
    node: &Node,
    lanes: u32,
    entry: L,
    stack: &mut Stack,
) -> Option<Link> {
    if lanes == 0 {
        return None;
    }
    let first = lanes.trailing_zeros() as usize;
    let mut rest = lanes & (lanes - 1);
    if rest == 0 {
        return Some(node.links[first % LANES]);
    }
    let entries = entry.store();
    let base = stack.len;
    stack.push(waiting(node, &entries, first));
    while rest != 0 {
        let next = waiting(node, &entries, rest.trailing_zeros() as usize);
        rest &= rest - 1;
        let mut place = stack.len;
        stack.len += 1;
        while place > base && stack.waiting[place - 1].entry < next.entry {
            stack.waiting[place] = stack.waiting[place - 1];
            place -= 1;
        }
        stack.waiting[place] = next;
    }
    stack.len -= 1;
    Some(stack.waiting[stack.len].link)
}

#[inline(always)]
fn waiting(node: &Node, entries: &[f32; LANES], lane: usize) -> Waiting {
    Waiting {
        link: node.links[lane % LANES],
        entry: entries[lane % LANES],
    }
}
