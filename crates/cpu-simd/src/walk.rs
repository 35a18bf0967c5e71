//! Traversal by one ray, nearest child first, eight boxes at a time, and the searches that use it.

use crate::intersect::{Intersect, LaneTest, Touch};
use crate::leaf::{Meetings, OfBlock, TriangleRay, slack};
use crate::rays::OneRay;
use crate::simd::{Eight, Isa, Lanes, Vector, each, prefetch};
use crate::tree::{Block, LANES, Link, NOWHERE, Node, Planes, Wide, place};
use bvh_build::MAX_DEPTH;
use geom::Hit;
use std::marker::PhantomData;

/// A node or block still to visit: the bits of its entry distance, then those of its link. So a single comparison
/// without a branch orders them by distance. Negative entries are in another order, but all are still visited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Waiting(u64);

impl Waiting {
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
const DEEPEST: usize = ((LANES - 1) * (MAX_DEPTH as usize + 1)).next_power_of_two();

/// Nodes and blocks still to visit, the next one last.
pub(crate) struct Stack {
    waiting: [Waiting; DEEPEST],
    /// Used where their order does not matter. Has space for all lanes of one more node.
    links: [Link; DEEPEST + LANES],
}

impl Default for Stack {
    fn default() -> Self {
        Self {
            waiting: [Waiting::UNUSED; DEEPEST],
            links: [Link::ROOT; DEEPEST + LANES],
        }
    }
}

/// Handler of the blocks that a ray meets, nearer ones first.
pub(crate) trait Visitor<I> {
    /// Visits a block whose box the ray meets before `bound`. Returns the next bound, or `None` to end the traversal.
    /// Must be `#[inline(always)]`.
    fn block(&mut self, block: usize, bound: f32) -> Option<f32>;
}

/// A ray or packet that boxes can be tested with.
pub(crate) trait BoxTest<L> {
    /// Returns which of eight boxes cannot be skipped, and their entries. Must be `#[inline(always)]`.
    fn meet(&self, planes: &Planes, best: f32) -> (u32, L);
}

/// A ray, prepared for boxes of inner nodes. The boxes are padded more than in the reference's box test, which saves
/// operations. They decide no hit.
#[derive(Clone, Copy)]
pub(crate) struct NodeRay<L> {
    inverse: [L; 3],
    /// Terms added to the products with near planes and with far planes.
    starts: [[L; 2]; 3],
    /// Index of the nearer planes on each axis: 0 for the lower ones.
    near: [usize; 3],
    t_min: L,
    /// Origin of the ray.
    origin: [L; 3],
    /// Set if each box is padded by its own distance instead of the whole tree's.
    spread: bool,
}

impl<L: Lanes> NodeRay<L> {
    #[inline(always)]
    pub(crate) fn new(ray: &OneRay<'_, impl Lanes>, spread: bool) -> Self {
        let group = ray.group;
        Self {
            origin: each!(i => L::splat(ray.at(&group.origin[i]))),
            spread,
            inverse: each!(i => L::splat(ray.at(&group.inverse[i]))),
            starts: each!(i => {
                let [near, far] = &group.starts[i];
                [L::splat(ray.at(near)), L::splat(ray.at(far))]
            }),
            near: each!(i => usize::from(ray.at(&group.inverse[i]).is_sign_negative())),
            t_min: L::splat(ray.at(&group.limits[0])),
        }
    }
}

impl<L: Lanes> NodeRay<L> {
    /// Returns the distances to near and far planes of boxes, computed as in the reference's box test. This is
    /// conservative: `D` of a box is at least that of any box within, and every operation is monotone.
    #[inline(always)]
    fn spans_apart(&self, at: [[L; 2]; 3]) -> [[L; 2]; 3] {
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
    fn meet(&self, planes: &Planes, best: f32) -> (u32, L) {
        let at = each!(axis => {
            let (sides, _) = planes[axis].as_chunks::<LANES>();
            let near = self.near[axis];
            [L::load(&sides[near % 2]), L::load(&sides[(near + 1) % 2])]
        });
        let [n, f] = [0, 1];
        let t = if self.spread {
            self.spans_apart(at)
        } else {
            each!(axis => {
                let ([near, far], r) = (at[axis], self.inverse[axis]);
                let starts = self.starts[axis];
                [near.about(r, starts[n]), far.about(r, starts[f])]
            })
        };
        let entry = self.t_min.maxi(t[0][n]).maxi(t[1][n].maxi(t[2][n]));
        let exit = L::splat(best).mini(t[0][f]).mini(t[1][f].mini(t[2][f]));
        (L::bits(entry.at_most(exit)), entry)
    }
}

/// Visits the blocks that rays may hit, roughly nearest first. Returns whether `visitor` ended the traversal.
#[inline(always)]
pub(crate) fn walk<I: Isa>(
    tree: &Wide,
    (rays, mut bound): (&impl BoxTest<I::Eight>, f32),
    stack: &mut Stack,
    visitor: &mut impl Visitor<I>,
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
                } else {
                    nearest(tree, node, (lanes, entry), (stack, &mut len))
                };
                continue;
            }
        }
        // Equal distances are visited too: such a hit may have a lower index.
        loop {
            if len == 0 {
                return false;
            }
            len -= 1;
            let next = stack.waiting[len % DEEPEST];
            if next.entry() <= bound {
                link = next.link();
                break;
            }
        }
    }
}

/// Returns the nearest of `lanes`, which must not be empty, and pushes the others, farthest first.
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
    tree.prefetch(next.link());
    let mut rest = lanes & (lanes - 1);
    while rest != 0 {
        let other = node.waiting(rest.trailing_zeros(), &entries);
        tree.prefetch(other.link());
        rest &= rest - 1;
        let mut later = next.max(other);
        next = next.min(other);
        for place in base..*len {
            let at = &mut waiting[place % DEEPEST];
            (*at, later) = ((*at).max(later), (*at).min(later));
        }
        waiting[*len % DEEPEST] = later;
        *len += 1;
    }
    next.link()
}

/// A hit, and the place of its triangle in the tree: the block's index times [`LANES`], plus the lane.
#[derive(Clone, Copy)]
pub(crate) struct Placed {
    pub(crate) hit: Hit,
    pub(crate) place: u32,
    /// Whether rounded arithmetic cannot tell.
    pub(crate) is_open: bool,
}

/// The closest hit so far.
struct Closest<'a, R: Lanes, T> {
    tree: &'a Wide,
    ray: &'a OneRay<'a, R>,
    best: Placed,
    test: PhantomData<T>,
}

impl<I: Isa, R: Lanes, T: LaneTest> Visitor<I> for Closest<'_, R, T> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        let tree = self.tree;
        let ray = TriangleRay::<I::Eight>::single(self.ray);
        let best = I::Eight::splat(bound);
        if let Some(met) = T::meet(&ray, &OfBlock { tree, block }, best) {
            take_best(&mut self.best, (&tree.blocks[block], block), &met);
        }
        Some(self.best.hit.t)
    }
}

#[inline(always)]
fn take_best<L: Lanes<Array = [f32; LANES]>>(
    best: &mut Placed,
    (block, index): (&Block, usize),
    met: &Meetings<L>,
) {
    let (t, u, v) = (met.t.store(), met.u.store(), met.v.store());
    let mut lanes = met.lanes;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize % LANES;
        lanes &= lanes - 1;
        let hit = Hit {
            t: t[lane],
            u: u[lane],
            v: v[lane],
            triangle: block.triangles[lane],
        };
        if hit.is_before(&best.hit) {
            let place = place(index, lane);
            *best = Placed {
                hit,
                place,
                ..*best
            };
        }
    }
}

/// Returns the closest hit, with `t` in scaled units. A miss has place [`NOWHERE`].
#[inline(always)]
pub(crate) fn closest<I: Isa, T: LaneTest>(
    tree: &Wide,
    ray: &OneRay<'_, impl Lanes>,
    stack: &mut Stack,
) -> Placed {
    let mut closest = Closest {
        tree,
        ray,
        test: PhantomData::<T>,
        best: Placed {
            hit: Hit {
                t: ray.t_max(),
                ..Hit::MISS
            },
            place: NOWHERE,
            is_open: false,
        },
    };
    let node_ray = NodeRay::<I::Eight>::new(ray, tree.spread);
    walk::<I>(tree, (&node_ray, ray.t_max()), stack, &mut closest);
    closest.best
}

/// Returns whether a ray, as the only lane, hits any triangle except `skipped`. Visits the last child of each node first.
#[inline(always)]
pub(crate) fn any<I: Isa, T: Intersect>(
    tree: &Wide,
    ray: &OneRay<'_, impl Lanes>,
    skipped: u32,
    stack: &mut Stack,
) -> Touch {
    let mut open = 0;
    let (links, node_ray) = (&mut stack.links, NodeRay::<I::Eight>::new(ray, tree.spread));
    let (mut len, mut link, bound) = (0, Link::ROOT, ray.t_max());
    loop {
        if link.is_block() {
            let touch = touch::<I, T>(tree, link.index(), ray, skipped);
            if touch.hit != 0 {
                return Touch { hit: 1, open: 0 };
            }
            open |= u32::from(touch.open != 0);
        } else {
            let node = &tree.nodes[link.index()];
            let (lanes, _) = node_ray.meet(&node.planes, bound);
            if lanes != 0 {
                let first = 31 - lanes.leading_zeros();
                let rest = lanes & !(1 << first);
                let place = len % DEEPEST;
                links[place..place + LANES].copy_from_slice(&I::packed(&node.links, rest));
                len += rest.count_ones() as usize;
                link = node.links[first as usize % LANES];
                continue;
            }
        }
        if len == 0 {
            return Touch { hit: 0, open };
        }
        len -= 1;
        link = links[len % DEEPEST];
        // Prefetches the entry after this one.
        tree.prefetch(links[len.saturating_sub(1) % DEEPEST]);
    }
}

/// Returns the triangles of a block that a ray hits, except `skipped`.
#[inline(always)]
fn touch<I: Isa, T: Intersect>(
    tree: &Wide,
    block: usize,
    ray: &OneRay<'_, impl Lanes>,
    skipped: u32,
) -> Touch {
    let ray = TriangleRay::<I::Eight>::single(ray);
    let touch = T::touch(&ray, &OfBlock { tree, block });
    if touch.hit | touch.open == 0 {
        return touch;
    }
    let mut others = 0;
    for (lane, &triangle) in tree.blocks[block].triangles.iter().enumerate() {
        others |= u32::from(triangle != skipped) << lane;
    }
    Touch {
        hit: touch.hit & others,
        open: touch.open & others,
    }
}

impl Node {
    #[inline(always)]
    fn waiting(&self, lane: u32, entries: &[f32; LANES]) -> Waiting {
        let lane = lane as usize % LANES;
        Waiting::new(self.links[lane], entries[lane])
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
