//! Traversal of the wide tree by a ray or packet, nearest child first. Tests eight boxes at a time.

use crate::leaf::slack;
use crate::rays::OneRay;
use crate::simd::{Eight, Isa, Lanes, SetLanes, each};
use crate::tree::{BoxPlanes, Bvh8, LANES, Link, Node8};
use bvh_build::MAX_DEPTH;

/// A node or block still to visit. The upper 32 bits are the bits of the entry distance, the lower 32 bits are the
/// link.
///
/// Comparing the integers orders links by distance without a branch. Negative distances, which occur only with a
/// negative `t_min`, are not in ascending order. That affects only speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct PendingLink(u64);

impl PendingLink {
    const UNUSED: Self = Self(0);

    #[inline(always)]
    fn new(link: Link, entry: f32) -> Self {
        Self(u64::from(entry.to_bits()) << 32 | u64::from(link.bits()))
    }

    #[inline(always)]
    fn link(self) -> Link {
        Link::from_bits(self.0 as u32)
    }

    #[inline(always)]
    fn entry(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }
}

/// Capacity of the stack. Each level leaves at most `LANES - 1` entries on it, and there are at most `MAX_DEPTH + 1`
/// levels.
pub(crate) const STACK_CAPACITY: usize =
    ((LANES - 1) * (MAX_DEPTH as usize + 1)).next_power_of_two();

/// Nodes and blocks still to visit, the next one last.
pub(crate) struct TraversalStack {
    pending: [PendingLink; STACK_CAPACITY],
    /// Stack of searches that do not order links by distance. Has space for all lanes of one more node.
    pub(crate) links: [Link; STACK_CAPACITY + LANES],
}

impl Default for TraversalStack {
    fn default() -> Self {
        Self {
            pending: [PendingLink::UNUSED; STACK_CAPACITY],
            links: [Link::NONE; STACK_CAPACITY + LANES],
        }
    }
}

/// Handler of the blocks that a ray meets, nearer ones first.
pub(crate) trait Visitor<I> {
    /// Visits a block whose box may be entered no later than `bound`. Returns the next bound, or `None` to end the
    /// traversal. Must be `#[inline(always)]`.
    fn block(&mut self, block: usize, bound: f32) -> Option<f32>;
}

/// A ray or packet, prepared for tests with boxes of nodes.
pub(crate) trait BoxTest<L> {
    /// Tests eight boxes. Boxes that are missed or entered after `best` can be skipped. Must be `#[inline(always)]`.
    fn meet(&self, planes: &BoxPlanes, best: f32) -> MetBoxes<L>;
}

/// The boxes that a ray or packet meets.
pub(crate) struct MetBoxes<L> {
    /// Bit `lane` is set if that box cannot be skipped.
    pub(crate) lanes: u32,
    /// Where the ray enters each box.
    pub(crate) entry: L,
}

/// A ray, prepared for tests with boxes of nodes. Without `own_padding`, the test needs fewer operations than the box
/// test of `cpu-ref`, but pads boxes more. No hit depends on this test.
#[derive(Clone, Copy)]
pub(crate) struct NodeRay<L> {
    inverse: [L; 3],
    /// For each axis, the terms that are added to `plane * r`: for near planes, then for far planes. See
    /// [`crate::rays::PreparedRays::starts`].
    starts: [[L; 2]; 3],
    /// Index of the nearer planes on each axis: 0 for the lower ones.
    near: [usize; 3],
    t_min: L,
    /// Origin of the ray.
    origin: [L; 3],
    /// Set if the padding is computed from each box instead of the root box. See [`Bvh8::own_padding`].
    own_padding: bool,
}

impl<L: Lanes> NodeRay<L> {
    #[inline(always)]
    pub(crate) fn new(ray: &OneRay<'_, impl Lanes>, own_padding: bool) -> Self {
        let group = ray.group;
        Self {
            origin: each!(i => L::splat(ray.at(&group.origin[i]))),
            own_padding,
            inverse: each!(i => L::splat(ray.at(&group.inverse[i]))),
            starts: each!(i => {
                let [near, far] = &group.starts[i];
                [L::splat(ray.at(near)), L::splat(ray.at(far))]
            }),
            near: each!(i => usize::from(ray.at(&group.inverse[i]).is_sign_negative())),
            t_min: L::splat(ray.at(&group.limits[0])),
        }
    }

    /// Returns the distances to near and far planes of boxes, with the operations of the box test in `cpu-ref`. The
    /// padding grows with `D` (see [`cpu_ref::PAD`]), which is at least that of any contained box. Every operation is
    /// monotone. So a ray that meets a contained box also meets this box.
    #[inline(always)]
    fn spans_with_own_padding(&self, at: [[L; 2]; 3]) -> [[L; 2]; 3] {
        let from = each!(axis => {
            let ([near, far], origin) = (at[axis], self.origin[axis]);
            [near.sub(origin), far.sub(origin)]
        });
        let slack = slack(&from);
        each!(axis => {
            let ([near, far], r) = (from[axis], self.inverse[axis]);
            let pad = slack.mul(r.abs());
            [near.mul(r).sub(pad), far.mul(r).add(pad)]
        })
    }
}

impl<L: Eight> BoxTest<L> for NodeRay<L> {
    #[inline(always)]
    fn meet(&self, planes: &BoxPlanes, best: f32) -> MetBoxes<L> {
        let at = each!(axis => {
            let (sides, _) = planes[axis].as_chunks::<LANES>();
            let near = self.near[axis];
            [L::load(&sides[near % 2]), L::load(&sides[(near + 1) % 2])]
        });
        let [n, f] = [0, 1];
        let t = if self.own_padding {
            self.spans_with_own_padding(at)
        } else {
            each!(axis => {
                let ([near, far], r) = (at[axis], self.inverse[axis]);
                let starts = self.starts[axis];
                [near.mul_add_approximate(r, starts[n]), far.mul_add_approximate(r, starts[f])]
            })
        };
        let entry = self.t_min.maxi(t[0][n]).maxi(t[1][n].maxi(t[2][n]));
        let exit = L::splat(best).mini(t[0][f]).mini(t[1][f].mini(t[2][f]));
        MetBoxes {
            lanes: L::bits(entry.at_most(exit)),
            entry,
        }
    }
}

/// Visits the blocks that `rays` may hit up to `bound`, approximately nearest first. Returns whether `visitor` ended
/// the traversal.
#[inline(always)]
pub(crate) fn walk<I: Isa>(
    tree: &Bvh8,
    rays: &impl BoxTest<I::Eight>,
    mut bound: f32,
    stack: &mut TraversalStack,
    visitor: &mut impl Visitor<I>,
) -> bool {
    let mut pending = PendingLinks {
        entries: &mut stack.pending,
        len: 0,
    };
    let mut link = Link::ROOT;
    loop {
        if link.is_block() {
            match visitor.block(link.index(), bound) {
                Some(next) => bound = next,
                None => return true,
            }
        } else {
            let node = &tree.nodes[link.index()];
            let met = rays.meet(&node.planes, bound);
            if met.lanes != 0 {
                link = if met.lanes & (met.lanes - 1) == 0 {
                    node.links[met.lanes.trailing_zeros() as usize % LANES]
                } else {
                    nearest(tree, node, &met, &mut pending)
                };
                continue;
            }
        }
        // Equal distances are visited too: such a hit may have a lower index.
        loop {
            if pending.len == 0 {
                return false;
            }
            pending.len -= 1;
            let next = pending.entries[pending.len % STACK_CAPACITY];
            if next.entry() <= bound {
                link = next.link();
                break;
            }
        }
    }
}

/// The links of one traversal that are still to visit.
struct PendingLinks<'a> {
    entries: &'a mut [PendingLink; STACK_CAPACITY],
    len: usize,
}

impl PendingLinks<'_> {
    /// Inserts a link into the entries from `base` on, which are sorted, farthest first.
    #[inline(always)]
    fn insert(&mut self, base: usize, link: PendingLink) {
        let mut later = link;
        for index in base..self.len {
            let at = &mut self.entries[index % STACK_CAPACITY];
            (*at, later) = ((*at).max(later), (*at).min(later));
        }
        self.entries[self.len % STACK_CAPACITY] = later;
        self.len += 1;
    }
}

/// Returns the link of the nearest box that is met, and pushes the links of the others, farthest first. At least one
/// box must be met.
#[inline(always)]
fn nearest<L: Lanes<Array = [f32; LANES]>>(
    tree: &Bvh8,
    node: &Node8,
    met: &MetBoxes<L>,
    pending: &mut PendingLinks<'_>,
) -> Link {
    let entries = met.entry.store();
    let base = pending.len;
    let link = |lane: usize| PendingLink::new(node.links[lane], entries[lane]);
    let mut next = link(met.lanes.trailing_zeros() as usize % LANES);
    tree.prefetch(next.link());
    for lane in SetLanes::<LANES>(met.lanes & (met.lanes - 1)) {
        let other = link(lane);
        tree.prefetch(other.link());
        pending.insert(base, next.max(other));
        next = next.min(other);
    }
    next.link()
}
