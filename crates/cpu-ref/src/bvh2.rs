//! The binary tree of `cpu-ref`: pairs of siblings, breadth first.

use crate::intersect::{Preprocess, Record, Watertight, by_test};
use crate::pass::{SplitAt, Which, Window, pass};
use crate::scale::Scale;
use crate::tiles::{Counts, Output};
use crate::trace::{TraceTask, Tracer};
use crate::{Accelerator, Geometry, Unhittable, reserve};
use backend::{Intersector, Result, TreeFormat};
use bvh_layout::{Link, Moving, Topology};
use geom::{Aabb, Animation, Triangle, is_active, is_degenerate};
use glam::Vec3A;
use rayon::prelude::*;
use std::ops::Range;

/// The boxes and links of two siblings, in one cache line.
///
/// Node `i` of the topology is in slot `i + 1`: pair `slot / 2`, lane `slot % 2`.
/// So the children of the `k`-th inner node are pair `k + 1`. Pair 0 holds
/// an empty box, which no ray meets, and the root in lane 1.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Pair {
    /// For each axis: lower planes of lanes 0 and 1, then upper planes.
    pub(crate) planes: [[f32; 4]; 3],
    /// Link of each lane: to the pair of the node's children, to a leaf, or [`Link::ROOT`] for a lane without a node.
    pub(crate) links: [Link; 2],
}

const FAR: f32 = f32::INFINITY;

impl Pair {
    const EMPTY: Self = Self {
        planes: [[FAR, FAR, -FAR, -FAR]; 3],
        links: [Link::ROOT; 2],
    };

    /// Returns the box of one lane.
    #[inline]
    pub(crate) fn bounds(&self, lane: usize) -> Aabb {
        Aabb {
            min: self.planes.map(|p| p[lane]),
            max: self.planes.map(|p| p[lane + 2]),
        }
    }

    /// Sets the box of one lane from its corners.
    #[inline]
    pub(crate) fn set_bounds(&mut self, lane: usize, min: Vec3A, max: Vec3A) {
        for (axis, planes) in self.planes.iter_mut().enumerate() {
            planes[lane] = min[axis];
            planes[lane + 2] = max[axis];
        }
    }

    /// Returns the corners of the smallest box that contains both lanes.
    #[inline]
    pub(crate) fn union(&self) -> [Vec3A; 2] {
        let corner = |lane: usize| Vec3A::from_array(self.planes.map(|p| p[lane]));
        [corner(0).min(corner(1)), corner(2).max(corner(3))]
    }
}

/// A leaf, as read by `preprocess`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Leaf {
    slot: u32,
    /// Vertices of its triangle.
    pub(crate) vertices: [u32; 3],
}

impl Leaf {
    /// Returns the pair that holds its box.
    #[inline]
    pub(crate) fn pair(&self) -> usize {
        self.slot as usize / 2
    }

    #[inline]
    pub(crate) fn lane(&self) -> usize {
        self.slot as usize % 2
    }
}

/// The tree, with the boxes and records of one moment.
#[derive(Debug, Default)]
pub struct Bvh2 {
    /// Pair 0 holds the root. It exists once a tree was adopted.
    pub(crate) pairs: Vec<Pair>,
    /// The triangle of each leaf, by rank.
    pub(crate) triangles: Vec<u32>,
    /// The record of each leaf, by rank.
    pub(crate) records: Vec<Record>,
    leaves: Vec<Leaf>,
    /// Pairs of each level, root first. Empty if the tree is empty.
    levels: Vec<Range<usize>>,
    /// The node of each leaf, retained to reuse its memory.
    leaf_nodes: Vec<u32>,
    /// Moving leaves and nodes, or `None` if too little is static to be worth skipping.
    moving: Option<Moving>,
    /// Set once every leaf was preprocessed since the tree was adopted.
    leaves_done: bool,
    /// Sum of the half areas of nodes in pairs without a moving node, once every box was refitted.
    still_areas: Option<f64>,
}

/// Pairs or leaves that one task initializes.
const RUN: usize = 1024;

impl Bvh2 {
    /// Returns the boxes of a tree's nodes at one moment, in node order and scaled units.
    ///
    /// # Errors
    /// If memory does not suffice.
    pub fn boxes_of(tree: &Topology, geometry: &Geometry<'_>) -> Result<Vec<Aabb>> {
        let mut all = Self::default();
        all.take_over(tree, geometry.triangles)?;
        all.preprocess_for::<Watertight>(geometry);
        all.refit();
        all.boxes(geometry)
    }

    /// Copies a tree's structure, in parallel, into existing memory. Boxes are not updated and so are stale.
    fn take_over(&mut self, tree: &Topology, triangles: &[[u32; 3]]) -> Result<()> {
        let leaves = tree.leaf_count();
        reserve(&mut self.pairs, leaves + 1, "nodes")?;
        reserve(&mut self.triangles, leaves, "leaves")?;
        reserve(&mut self.leaves, leaves, "leaves")?;
        reserve(&mut self.records, leaves, "triangle records")?;
        self.records.resize(leaves, Record::default());
        (self.leaves_done, self.still_areas) = (false, None);
        self.levels.clear();
        // The root is in pair 0, the children of the `k`-th inner node in pair `k + 1`.
        let below = tree
            .levels()
            .map(|k| k.start as usize + 1..k.end as usize + 1);
        let pairs = std::iter::once(0..1).chain(below);
        self.levels.extend(pairs.take(tree.level_count()));
        let (nodes, ranks) = (tree.node_count(), tree.ranks());
        let link = |slot: usize| match slot.checked_sub(1).filter(|&node| node < nodes) {
            Some(node) => {
                let node = ranks.of(node as u32);
                let leaf = node.leaf().map(|rank| Link::block(rank as usize));
                leaf.unwrap_or(Link::node(node.rank() as usize + 1))
            }
            None => Link::ROOT,
        };
        self.pairs.resize(nodes.div_ceil(2).max(1), Pair::EMPTY);
        let pairs = self.pairs.par_iter_mut().with_min_len(RUN).enumerate();
        pairs.for_each(|(p, pair)| pair.links = [link(2 * p), link(2 * p + 1)]);
        self.pairs[0].planes = Pair::EMPTY.planes;
        self.triangles.clear();
        self.triangles.extend_from_slice(tree.leaf_triangles());
        tree.leaf_nodes(&mut self.leaf_nodes);
        let leaves = self.leaf_nodes.par_iter().with_min_len(RUN);
        let leaf = |(&node, &triangle): (&u32, &u32)| Leaf {
            slot: node + 1,
            vertices: triangles[triangle as usize],
        };
        let leaves = leaves.zip(&self.triangles).map(leaf);
        leaves.collect_into_vec(&mut self.leaves);
        Ok(())
    }

    fn preprocess_for<T: Preprocess>(&mut self, geometry: &Geometry<'_>) -> Unhittable {
        let moving = self.moving.as_ref().filter(|_| self.leaves_done);
        let which = match moving {
            Some(moving) => Which::Listed(moving.leaves()),
            None => Which::All(0..self.leaves.len()),
        };
        let leaves = Leaves {
            leaves: &self.leaves,
            pairs: Window::new(0, &mut self.pairs),
            records: Window::new(0, &mut self.records),
        };
        let mut found = pass(which, leaves, LEAVES, &|which, leaves| {
            prepare_run::<T>(geometry, &which, leaves)
        });
        // Static triangles with a leaf are active, so only degenerate ones are added.
        found.degenerate += moving.map_or(0, |m| u64::from(m.degenerate_elsewhere));
        self.leaves_done = true;
        found
    }

    /// Refits the pairs with a moving node. Returns the sum of the half areas of their nodes: the root, and the
    /// children of moving inner nodes.
    fn refit_moving(pairs: &mut [Pair], moving: &Moving) -> f64 {
        let mut total = 0.0;
        if moving.leaves().is_empty() {
            return total;
        }
        // The children of inner node `k` are pair `k + 1`.
        let (_, children) = pairs.split_at_mut(1);
        for level in moving.lists[1..].iter().rev() {
            let list = &moving.words[level.clone()];
            // Children are on a later level, so after every pair of this one.
            let end = list.last().map_or(0, |&last| last as usize + 1);
            total += refit_level(children, (end, end + 1), Which::Listed(list));
        }
        total + refit_level(pairs, (1, 1), Which::All(0..1))
    }
}

impl Accelerator for Bvh2 {
    fn adopt(&mut self, tree: &Topology, animation: &Animation) -> Result<()> {
        self.take_over(tree, animation.triangles())?;
        self.moving = tree.moving().cloned();
        Ok(())
    }

    fn format(&self) -> TreeFormat {
        TreeFormat::Binary
    }

    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable {
        by_test!(intersector, Test => self.preprocess_for::<Test>(geometry))
    }

    fn refit(&mut self) -> (f64, Aabb) {
        let moving = self.moving.as_ref();
        let total = match self.still_areas.zip(moving) {
            Some((still, moving)) => still + Self::refit_moving(&mut self.pairs, moving),
            None => {
                let levels = self.levels.iter().rev();
                let areas = levels.map(|level| {
                    let all = Which::All(level.clone());
                    refit_level(&mut self.pairs, (level.end, level.end), all)
                });
                let total: f64 = areas.sum();
                self.still_areas = moving.map(|m| total - Self::refit_moving(&mut self.pairs, m));
                total
            }
        };
        (total, self.pairs[0].bounds(1))
    }

    fn trace(&self, task: TraceTask<'_>, out: Output<'_>) -> Counts {
        Tracer::new(task, self).trace(out)
    }

    fn boxes(&self, _: &Geometry<'_>) -> Result<Vec<Aabb>> {
        let nodes = (2 * self.triangles.len()).saturating_sub(1);
        let bounds = |slot: usize| self.pairs[slot / 2].bounds(slot % 2);
        Ok((1..=nodes).map(bounds).collect())
    }
}

/// Leaves that one task preprocesses.
const LEAVES: usize = 1024;
/// Leaves whose corners are fetched together. The corners are scattered in memory, so this overlaps the fetches.
const BATCH: usize = 16;

/// Leaves by rank, with the pairs that hold their boxes and with their records.
struct Leaves<'a> {
    leaves: &'a [Leaf],
    pairs: Window<'a, Pair>,
    records: Window<'a, Record>,
}

impl SplitAt for Leaves<'_> {
    fn split(self, rank: usize) -> [Self; 2] {
        let pairs = self.pairs.split(self.leaves[rank].pair());
        let ([left_pairs, right_pairs], [left, right]) = (pairs, self.records.split(rank));
        let half = |pairs, records| Leaves {
            leaves: self.leaves,
            pairs,
            records,
        };
        [half(left_pairs, left), half(right_pairs, right)]
    }

    /// Returns whether two leaves share a pair, which one task must write.
    fn joins(&self, left: usize, right: usize) -> bool {
        self.leaves[left].pair() == self.leaves[right].pair()
    }
}

/// Writes a record and a box for each of these leaves. Other leaves are left unchanged.
fn prepare_run<T: Preprocess>(
    geometry: &Geometry<'_>,
    which: &Which<'_>,
    mut part: Leaves<'_>,
) -> Unhittable {
    let mut corners = [[[0.0; 3]; 3]; BATCH];
    let mut unhittable = Unhittable::default();
    for first in (0..which.count()).step_by(BATCH) {
        let batch = first..which.count().min(first + BATCH);
        for (corners, place) in corners.iter_mut().zip(batch.clone()) {
            let leaf = &part.leaves[which.at(place)];
            *corners = leaf.vertices.map(|v| geometry.positions[v as usize]);
        }
        for (corners, place) in corners.iter().zip(batch) {
            let rank = which.at(place);
            let record = &mut part.records[rank];
            let [min, max] = prepare::<T>(geometry.scale, corners, record, &mut unhittable);
            let leaf = &part.leaves[rank];
            part.pairs[leaf.pair()].set_bounds(leaf.lane(), min, max);
        }
    }
    unhittable
}

/// Writes a triangle's record and returns the corners of its box.
#[inline]
fn prepare<T: Preprocess>(
    scale: Scale,
    corners: &Triangle,
    record: &mut Record,
    unhittable: &mut Unhittable,
) -> [Vec3A; 2] {
    if !is_active(corners) {
        unhittable.inactive += 1;
    } else if is_degenerate(corners) {
        unhittable.degenerate += 1;
    } else {
        let corners = corners.map(|p| scale.apply(p));
        *record = T::record(&corners);
        let [a, b, c] = corners.map(Vec3A::from_array);
        return [a.min(b).min(c), a.max(b).max(c)];
    }
    *record = Record::default();
    [Vec3A::INFINITY, Vec3A::NEG_INFINITY]
}

/// Pairs that one task refits.
const REFIT_RUN: usize = 2048;

/// Sets the boxes of the inner nodes in these pairs, all on one level, to the union of their children's boxes. Only
/// minima and maxima are used, so nothing is rounded. `pairs[end..]` starts with pair `first` and is up to date.
///
/// Returns the sum of the half areas of the pairs' nodes.
fn refit_level(pairs: &mut [Pair], (end, first): (usize, usize), which: Which<'_>) -> f64 {
    let (level, below) = pairs.split_at_mut(end);
    let refit = |sum, pair: &mut Pair| refit_pair(pair, below, first, sum);
    let pairs = Window::new(0, level);
    pass(which, pairs, REFIT_RUN, &|which, mut pairs| match which {
        Which::All(range) => pairs.slice(range).iter_mut().fold(0.0, refit),
        Which::Listed(list) => {
            let listed = list.iter();
            listed.fold(0.0, |sum, &pair| refit(sum, &mut pairs[pair as usize]))
        }
    })
}

/// Refits one pair and adds the half areas of its nodes to `sum`. `below` starts with pair `first`.
#[inline(always)]
fn refit_pair(pair: &mut Pair, below: &[Pair], first: usize, mut sum: f64) -> f64 {
    for lane in 0..2 {
        let link = pair.links[lane];
        if link.is_inner() {
            let [min, max] = below[link.index() - first].union();
            pair.set_bounds(lane, min, max);
        }
        sum += pair.bounds(lane).half_area();
    }
    sum
}
