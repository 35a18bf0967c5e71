//! The binary tree of layout `bvh2`: pairs of siblings, breadth first.

use crate::intersect::{MollerTrumbore, Record, TriangleTest, Watertight, Woop};
use crate::tiles::{Counts, Output};
use crate::trace::{TraceTask, Tracer};
use crate::{Accelerator, Geometry, Unhittable, reserve};
use backend::{Intersector, Result};
use bvh_layout::{Link, Topology};
use geom::{Aabb, Animation, Point, is_active, is_degenerate};
use glam::Vec3A;
use rayon::prelude::*;
use std::ops::{Add, Range};

/// Two siblings: boxes and links of both, one cache line.
///
/// Node `i` of the record lies in slot `i + 1`: pair `slot / 2`, lane `slot % 2`.
/// So the children of the `k`-th inner node are pair `k + 1`, and pair 0 holds
/// the root in lane 1, beside an empty box that no ray meets.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Pair {
    /// For each axis: lower planes of lanes 0 and 1, then upper planes.
    pub(crate) planes: [[f32; 4]; 3],
    /// Where each lane leads: to the pair of a node's children (of the root's own, where there is nothing), or to a leaf.
    pub(crate) links: [Link; 2],
}

const FAR: f32 = f32::INFINITY;

impl Pair {
    const EMPTY: Self = Self {
        planes: [[FAR, FAR, -FAR, -FAR]; 3],
        links: [Link::ROOT; 2],
    };

    /// The box of one lane.
    #[inline]
    pub(crate) fn bounds(&self, lane: usize) -> Aabb {
        Aabb {
            min: self.planes.map(|p| p[lane]),
            max: self.planes.map(|p| p[lane + 2]),
        }
    }

    /// Sets the box of one lane to the one between two corners.
    #[inline]
    pub(crate) fn set_bounds(&mut self, lane: usize, min: Vec3A, max: Vec3A) {
        for (axis, planes) in self.planes.iter_mut().enumerate() {
            planes[lane] = min[axis];
            planes[lane + 2] = max[axis];
        }
    }

    /// Corners of the least box that holds both lanes.
    #[inline]
    pub(crate) fn union(&self) -> [Vec3A; 2] {
        let corner = |lane: usize| Vec3A::from_array(self.planes.map(|p| p[lane]));
        [corner(0).min(corner(1)), corner(2).max(corner(3))]
    }
}

/// A leaf between `preprocess`, which makes its box, and `refit`, which puts that in its place.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    /// Its triangle's vertices.
    vertices: [u32; 3],
    /// Its box.
    corners: [Point; 2],
}

/// Of no box that a ray meets.
const NO_CORNERS: [Point; 2] = [[FAR; 3], [-FAR; 3]];

/// The tree, with the boxes and records of one moment.
#[derive(Debug, Default)]
pub struct Bvh2 {
    /// Pair 0 holds the root; there is always one, once a tree was adopted.
    pub(crate) pairs: Vec<Pair>,
    /// The triangle of each leaf, by rank.
    pub(crate) triangles: Vec<u32>,
    /// One a leaf.
    pub(crate) records: Vec<Record>,
    leaves: Vec<Leaf>,
    /// Pairs of each level, root first; none if the tree is empty.
    levels: Vec<Range<usize>>,
}

/// Leaves or pairs that one task handles.
const RUN: usize = 1024;

impl Bvh2 {
    /// The boxes of a record's nodes at one moment, in node order and scaled units.
    ///
    /// # Errors
    /// Memory does not suffice.
    pub fn boxes_of(tree: &Topology, geometry: &Geometry<'_>) -> Result<Vec<Aabb>> {
        let mut all = Self::default();
        all.take_over(tree, geometry.triangles)?;
        all.preprocess_for::<Watertight>(geometry);
        all.refit();
        all.boxes(geometry)
    }

    /// Takes over a record's shape, in parallel, reusing memory. Boxes are left as they are: stale.
    fn take_over(&mut self, tree: &Topology, triangles: &[[u32; 3]]) -> Result<()> {
        let leaves = tree.leaf_count();
        reserve(&mut self.pairs, leaves + 1, "nodes")?;
        reserve(&mut self.triangles, leaves, "leaves")?;
        reserve(&mut self.leaves, leaves, "leaves")?;
        reserve(&mut self.records, leaves, "triangle records")?;
        self.records.resize(leaves, Record::default());
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
        let leaf = |&triangle: &u32| Leaf {
            vertices: triangles[triangle as usize],
            corners: NO_CORNERS,
        };
        let leaves = self.triangles.par_iter().with_min_len(RUN);
        leaves.map(leaf).collect_into_vec(&mut self.leaves);
        Ok(())
    }

    fn preprocess_for<T: TriangleTest>(&mut self, geometry: &Geometry<'_>) -> Unhittable {
        let leaves = self.leaves.par_iter_mut().with_min_len(RUN);
        leaves
            .zip(&mut self.records)
            .map(|(leaf, record)| prepare::<T>(geometry, leaf, record))
            .reduce(Unhittable::default, Add::add)
    }
}

impl Accelerator for Bvh2 {
    fn adopt(&mut self, tree: &Topology, animation: &Animation) -> Result<()> {
        self.take_over(tree, animation.triangles())
    }

    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable {
        match intersector {
            Intersector::MollerTrumbore => self.preprocess_for::<MollerTrumbore>(geometry),
            Intersector::Woop => self.preprocess_for::<Woop>(geometry),
            // The exact test filters by the watertight test's numbers.
            Intersector::Watertight | Intersector::Exact => {
                self.preprocess_for::<Watertight>(geometry)
            }
        }
    }

    fn refit(&mut self) -> (f64, Aabb) {
        let mut total = 0.0;
        for level in self.levels.iter().rev() {
            let (upper, below) = self.pairs.split_at_mut(level.end);
            let leaves = &self.leaves;
            let refit = |sum, pair: &mut Pair| refit_pair(pair, leaves, (below, level.end), sum);
            let tasks = upper[level.clone()].par_chunks_mut(RUN);
            let areas = tasks.map(|pairs| pairs.iter_mut().fold(0.0, refit));
            // Added up in the order of the tasks, whoever is done first.
            total += areas.collect::<Vec<f64>>().iter().sum::<f64>();
        }
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

/// Writes a leaf's box and its triangle's record.
#[inline]
fn prepare<T: TriangleTest>(
    geometry: &Geometry<'_>,
    leaf: &mut Leaf,
    record: &mut Record,
) -> Unhittable {
    let corners = leaf.vertices.map(|v| geometry.positions[v as usize]);
    let is_active = is_active(&corners);
    if !is_active || is_degenerate(&corners) {
        (*record, leaf.corners) = (Record::default(), NO_CORNERS);
        return Unhittable {
            inactive: (!is_active).into(),
            degenerate: is_active.into(),
        };
    }
    let corners = corners.map(|p| geometry.scale.apply(p));
    *record = T::record(&corners);
    let [a, b, c] = corners.map(Vec3A::from_array);
    leaf.corners = [a.min(b).min(c), a.max(b).max(c)].map(|p| p.to_array());
    Unhittable::default()
}

/// Gives a pair the boxes of its leaves, and its inner nodes the least boxes round their children. Only minima and maxima:
/// nothing rounds. `below` begins with pair `first`.
///
/// Adds the half areas of the pair's nodes to `sum`.
#[inline(always)]
fn refit_pair(
    pair: &mut Pair,
    leaves: &[Leaf],
    (below, first): (&[Pair], usize),
    mut sum: f64,
) -> f64 {
    for lane in 0..2 {
        let link = pair.links[lane];
        if link != Link::ROOT {
            let [min, max] = match link.is_block() {
                true => leaves[link.index()].corners.map(Vec3A::from_array),
                false => below[link.index() - first].union(),
            };
            pair.set_bounds(lane, min, max);
        }
        sum += pair.bounds(lane).half_area();
    }
    sum
}
