//! One ray through the nodes, nearest child first, eight boxes at a time.

use super::single::OneRay;
use super::tree::{LANES, Link, Node, Planes, Wide};
use crate::simd::{Isa, Lanes, each, prefetch};
use bvh_build::MAX_DEPTH;

/// A node or block still to visit.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    link: Link,
    entry: f32,
}

/// Each level of the binary tree leaves at most one behind, and one more node may be split up.
const DEEPEST: usize = ((LANES - 1) * (MAX_DEPTH as usize + 1)).next_power_of_two();

/// Nodes and blocks still to visit, the next one last.
pub(crate) struct Stack {
    waiting: [Waiting; DEEPEST],
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
        }
    }
}

/// What is to be done with the blocks that a ray comes to.
pub(crate) trait Visitor {
    /// Whether nearer boxes come first: not worth their sorting where any hit will do.
    const ORDERED: bool;

    /// Sees a block whose box the ray meets before `bound`, and returns the next bound; none ends the walk.
    /// Must be `#[inline(always)]`.
    fn block(&mut self, block: usize, bound: f32) -> Option<f32>;
}

/// Something that boxes are tested against.
pub(crate) trait BoxTest<L> {
    /// Which of eight boxes cannot be skipped, and where they are entered. Must be `#[inline(always)]`.
    fn meet(&self, planes: &Planes, best: f32) -> (u32, L);
}

/// What the box test needs of a ray: see [`crate::slab::Slab`].
#[derive(Clone, Copy)]
pub(crate) struct NodeRay<L> {
    origin: [L; 3],
    inverse: [L; 3],
    pad: [L; 3],
    /// Which planes are nearer: 0 for the lower ones.
    near: [usize; 3],
    t_min: L,
}

impl<L: Lanes> NodeRay<L> {
    #[inline(always)]
    pub(crate) fn new(ray: &impl OneRay) -> Self {
        Self {
            origin: each!(i => L::splat(ray.origin(i))),
            inverse: each!(i => L::splat(ray.inverse(i))),
            pad: each!(i => L::splat(ray.pad(i))),
            near: each!(i => usize::from(ray.inverse(i).is_sign_negative())),
            t_min: L::splat(ray.t_min()),
        }
    }
}

impl<L: Lanes<Array = [f32; LANES]>> BoxTest<L> for NodeRay<L> {
    #[inline(always)]
    fn meet(&self, planes: &Planes, best: f32) -> (u32, L) {
        let at = each!(axis => {
            let (sides, _) = planes[axis].as_chunks::<LANES>();
            let near = self.near[axis];
            [L::load(&sides[near % 2]), L::load(&sides[(near + 1) % 2])]
        });
        let [n, f] = [0, 1];
        let t = each!(axis => {
            let [near, far] = [at[axis][n].sub(self.origin[axis]), at[axis][f].sub(self.origin[axis])];
            let [near, far] = [near.mul(self.inverse[axis]), far.mul(self.inverse[axis])];
            [near.sub(self.pad[axis]), far.add(self.pad[axis])]
        });
        let entry = self.t_min.max(t[0][n]).max(t[1][n].max(t[2][n]));
        let exit = L::splat(best).min(t[0][f]).min(t[1][f].min(t[2][f]));
        (L::bits(entry.at_most(exit)), entry)
    }
}

/// Shows `visitor` the blocks that rays may hit, roughly in their order; whether it ended the walk.
#[inline(always)]
pub(crate) fn walk<I: Isa, V: Visitor>(
    tree: &Wide,
    (rays, mut bound): (&impl BoxTest<I::Eight>, f32),
    stack: &mut Stack,
    visitor: &mut V,
) -> bool {
    let mut len = 0;
    let mut link = Link::ROOT;
    loop {
        if link.is_block() {
            match visitor.block(link.index(), bound) {
                Some(next) => bound = next,
                None => return true,
            }
        } else {
            let node = &tree.nodes[link.index()];
            let (lanes, entry) = rays.meet(&node.planes, bound);
            if lanes != 0 {
                link = if lanes & (lanes - 1) == 0 {
                    node.links[lanes.trailing_zeros() as usize % LANES]
                } else if V::ORDERED {
                    nearest(tree, node, (lanes, entry), (stack, &mut len))
                } else {
                    first(tree, node, lanes, (stack, &mut len))
                };
                continue;
            }
        }
        // Equal entries stay: a hit at the same distance may have a lower index.
        loop {
            if len == 0 {
                return false;
            }
            len -= 1;
            let next = stack.waiting[len % DEEPEST];
            if !V::ORDERED || next.entry <= bound {
                link = next.link;
                break;
            }
        }
    }
}

/// The nearest of `lanes`, of which there are some; the others wait, farthest first.
#[inline(always)]
fn nearest<L: Lanes<Array = [f32; LANES]>>(
    tree: &Wide,
    node: &Node,
    (lanes, entry): (u32, L),
    (stack, len): (&mut Stack, &mut usize),
) -> Link {
    let entries = entry.store();
    let waiting = &mut stack.waiting;
    let base = *len;
    let mut next = node.waiting(lanes.trailing_zeros(), &entries);
    tree.prefetch(next.link);
    let mut rest = lanes & (lanes - 1);
    while rest != 0 {
        let mut other = node.waiting(rest.trailing_zeros(), &entries);
        tree.prefetch(other.link);
        rest &= rest - 1;
        if other.entry < next.entry {
            std::mem::swap(&mut other, &mut next);
        }
        let mut place = *len;
        *len += 1;
        while place > base && waiting[(place - 1) % DEEPEST].entry < other.entry {
            waiting[place % DEEPEST] = waiting[(place - 1) % DEEPEST];
            place -= 1;
        }
        waiting[place % DEEPEST] = other;
    }
    next.link
}

/// One of `lanes`, of which there are some; the others wait.
#[inline(always)]
fn first(tree: &Wide, node: &Node, lanes: u32, (stack, len): (&mut Stack, &mut usize)) -> Link {
    let next = node.links[lanes.trailing_zeros() as usize % LANES];
    let mut rest = lanes & (lanes - 1);
    while rest != 0 {
        let other = node.waiting(rest.trailing_zeros(), &[0.0; LANES]);
        rest &= rest - 1;
        tree.prefetch(other.link);
        stack.waiting[*len % DEEPEST] = other;
        *len += 1;
    }
    next
}

impl Node {
    #[inline(always)]
    fn waiting(&self, lane: u32, entries: &[f32; LANES]) -> Waiting {
        Waiting {
            link: self.links[lane as usize % LANES],
            entry: entries[lane as usize % LANES],
        }
    }
}

impl Wide {
    #[inline(always)]
    fn prefetch(&self, link: Link) {
        if link.is_block() {
            prefetch(&self.blocks, link.index());
        } else {
            prefetch(&self.nodes, link.index());
        }
    }
}
