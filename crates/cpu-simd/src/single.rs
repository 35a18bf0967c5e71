//! Searches of single rays. Each ray is tested with eight triangles at once.

use crate::intersect::{AnyHitTest, AnyHits, LaneTest};
use crate::leaf::{BlockTriangles, TriangleHits, TriangleRay};
use crate::rays::OneRay;
use crate::simd::{Isa, Lanes, PlaneVector, SetLanes};
use crate::tree::{Bvh8, LANES, Link, place};
use crate::walk::{BoxTest, NodeRay, STACK_CAPACITY, TraversalStack, Visitor};
use cpu_ref::scale::MIN_NONZERO;
use geom::Hit;
use std::marker::PhantomData;

/// A hit, and the [place](crate::tree::place) of its triangle in the tree.
#[derive(Clone, Copy)]
pub(crate) struct PlacedHit {
    pub(crate) hit: Hit,
    pub(crate) place: u32,
    /// Set if the filter of `exact` cannot decide the hit. `cpu-ref` must then trace the ray again.
    pub(crate) is_open: bool,
}

/// The closest hit so far.
pub(crate) struct ClosestOfRay<'a, R: Lanes, T> {
    pub(crate) tree: &'a Bvh8,
    pub(crate) ray: &'a OneRay<'a, R>,
    pub(crate) best: PlacedHit,
    pub(crate) test: PhantomData<T>,
}

impl<I: Isa, R: Lanes, T: LaneTest> Visitor<I> for ClosestOfRay<'_, R, T> {
    #[inline(always)]
    fn block(&mut self, block: usize, bound: f32) -> Option<f32> {
        let tree = self.tree;
        let ray = TriangleRay::<I::Eight>::single(self.ray);
        let best = I::Eight::splat(bound);
        if let Some(hits) = T::intersect(&ray, &BlockTriangles { tree, block }, best) {
            self.take(block, &hits);
        }
        Some(self.best.hit.t.max(MIN_NONZERO))
    }
}

impl<R: Lanes, T> ClosestOfRay<'_, R, T> {
    /// Replaces the best hit if the block has a hit [before](Hit::is_before) it.
    #[inline(always)]
    fn take<L: Lanes<Array = [f32; LANES]>>(&mut self, block: usize, hits: &TriangleHits<L>) {
        let (t, u, v) = (hits.t.store(), hits.u.store(), hits.v.store());
        let triangles = &self.tree.blocks[block].triangles;
        for lane in SetLanes::<LANES>(hits.lanes) {
            let hit = Hit {
                t: t[lane],
                u: u[lane],
                v: v[lane],
                triangle: triangles[lane],
            };
            if hit.is_before(&self.best.hit) {
                (self.best.hit, self.best.place) = (hit, place(block, lane));
            }
        }
    }
}

/// Searches for any hit of a ray except triangle `skipped`. The result is in lane 0.
///
/// Visits the last child of each node first. When the tree was collapsed, the child to visit first was placed last
/// (`bvh_layout::FirstVisited`).
#[inline(always)]
pub(crate) fn any<I: Isa, T: AnyHitTest>(
    tree: &Bvh8,
    ray: &OneRay<'_, impl Lanes>,
    skipped: u32,
    stack: &mut TraversalStack,
) -> AnyHits {
    let mut open = 0;
    let (links, node_ray) = (
        &mut stack.links,
        NodeRay::<I::Eight>::new(ray, tree.own_padding),
    );
    let (mut len, mut link, bound) = (0, Link::ROOT, ray.t_max());
    loop {
        if link.is_block() {
            let hits = block_hits::<I, T>(tree, link.index(), ray, skipped);
            if hits.hit != 0 {
                return AnyHits { hit: 1, open: 0 };
            }
            open |= u32::from(hits.open != 0);
        } else {
            let node = &tree.nodes[link.index()];
            let lanes = node_ray.meet(&node.planes, bound).lanes;
            if lanes != 0 {
                let first = 31 - lanes.leading_zeros();
                let rest = lanes & !(1 << first);
                let at = len % STACK_CAPACITY;
                links[at..at + LANES].copy_from_slice(&I::packed(&node.links, rest));
                len += rest.count_ones() as usize;
                link = node.links[first as usize % LANES];
                continue;
            }
        }
        if len == 0 {
            return AnyHits { hit: 0, open };
        }
        len -= 1;
        link = links[len % STACK_CAPACITY];
        // Prefetches the entry that is popped next.
        tree.prefetch(links[len.saturating_sub(1) % STACK_CAPACITY]);
    }
}

/// Returns the triangles of a block that a ray hits, except `skipped`.
#[inline(always)]
fn block_hits<I: Isa, T: AnyHitTest>(
    tree: &Bvh8,
    block: usize,
    ray: &OneRay<'_, impl Lanes>,
    skipped: u32,
) -> AnyHits {
    let ray = TriangleRay::<I::Eight>::single(ray);
    let hits = T::any_hit(&ray, &BlockTriangles { tree, block });
    if hits.hit | hits.open == 0 {
        return hits;
    }
    let mut others = 0;
    for (lane, &triangle) in tree.blocks[block].triangles.iter().enumerate() {
        others |= u32::from(triangle != skipped) << lane;
    }
    AnyHits {
        hit: hits.hit & others,
        open: hits.open & others,
    }
}
