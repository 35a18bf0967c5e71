//! Vertices in, record out, in the rayon pool of whoever calls.

use crate::sampling::Sample;
use backend::{Backend, Snapshot};
use bvh_build::{
    BinaryTree, Boxes, BuildError, Builder, Cancel, Moment, TemporalBuilder, sah_cost,
    temporal_cost,
};
use bvh_layout::{Converter, Topology};
use geom::{Aabb, Animation, Point, Pose};
use rayon::prelude::*;
use std::time::Instant;

/// What a tree is built from.
pub enum Vertices {
    /// Positions that a backend interpolated and gave back.
    ReadBack(Snapshot),
    /// Key frames, to be blended here: the same bits as any backend's.
    KeyFrames(Pose),
}

/// What came of a build.
#[derive(Debug)]
pub enum Made {
    /// A tree to swap to.
    Tree(Built),
    /// A tree that costs more than the one in use.
    NoBetter,
}

/// A finished tree.
#[derive(Debug)]
pub struct Built {
    /// Its shape, as it is handed over.
    pub topology: Topology,
    /// Its cost at the vertices it was built from: see [`sah_cost`]. Of a tree
    /// for a whole animation, the cost of one for the first frame alone, there.
    pub cost: f64,
    /// Milliseconds from vertices to binary tree.
    pub build_ms: f64,
    /// Milliseconds from binary tree to record, and to lists of what moves.
    pub convert_ms: f64,
    /// When all of that was.
    pub moments: BuildMoments,
}

/// The stages of a build on the host's clock, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildMoments {
    /// The builder took up the vertices, or key frames to blend.
    pub begun: Instant,
    /// The binary tree stood.
    pub built: Instant,
    /// Its cost was known, and where it was asked, that of the tree in use.
    pub weighed: Instant,
    /// The record was written, and the tree finished.
    pub ended: Instant,
}

/// What a record carries beside itself, so that adopting it costs a frame little.
#[derive(Clone, Copy, Debug, Default)]
pub struct Forms {
    /// [`Topology::treelets`].
    pub treelets: bool,
    /// [`Topology::blocks`].
    pub blocks: bool,
}

impl Forms {
    /// What `backend` reads by the method loaded.
    #[must_use]
    pub fn wanted_by(backend: &dyn Backend) -> Self {
        Self {
            treelets: backend.wants_treelets(),
            blocks: backend.wants_blocks(),
        }
    }
}

/// The builder's tools and their memory, used again and again.
#[derive(Debug, Default)]
pub struct Workbench {
    builder: Builder,
    /// The tree being built.
    tree: BinaryTree,
    /// The last one that was handed over.
    in_use: BinaryTree,
    converter: Converter,
    positions: Vec<Point>,
    boxes: Vec<Aabb>,
    spare: Vec<u32>,
    forms: Forms,
}

impl Workbench {
    /// No memory yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Likewise; records carry trees in these forms too.
    #[must_use]
    pub fn with_forms(forms: Forms) -> Self {
        Self {
            forms,
            ..Self::default()
        }
    }

    /// Takes an old record's memory for the next one.
    pub fn reuse(&mut self, spare: Vec<u32>) {
        if spare.capacity() > self.spare.capacity() {
            self.spare = spare;
        }
    }

    /// Builds and converts a tree over `animation` standing at `positions`.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`].
    pub fn build(
        &mut self,
        animation: &Animation,
        positions: &[Point],
        cancel: &Cancel,
    ) -> Result<Built, BuildError> {
        let begun = Instant::now();
        fill(&mut self.boxes, &(animation, positions));
        self.builder
            .build(&self.boxes[..], cancel, &mut self.tree)?;
        let built = Instant::now();
        let cost = sah_cost(&self.tree, &self.boxes[..]);
        Ok(self.hand_over(animation, [begun, built], cost))
    }

    /// Builds a tree from `vertices` and converts it, if it is cheaper at
    /// `rival_at` than the last one handed over, or if nobody asks.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`].
    pub fn build_better(
        &mut self,
        animation: &Animation,
        vertices: Vertices,
        rival_at: Option<Pose>,
        cancel: &Cancel,
    ) -> Result<Made, BuildError> {
        let begun = Instant::now();
        let blended_at = self.take_in(animation, vertices);
        self.builder
            .build(&self.boxes[..], cancel, &mut self.tree)?;
        let built = Instant::now();
        let cost = sah_cost(&self.tree, &self.boxes[..]);
        if let Some(at) = rival_at {
            let mut rival = cost;
            if blended_at != rival_at {
                fill(&mut self.boxes, &(animation, at));
                rival = sah_cost(&self.tree, &self.boxes[..]);
            }
            let alike = self.in_use.leaf_count() == self.tree.leaf_count();
            if alike && rival > sah_cost(&self.in_use, &self.boxes[..]) {
                return Ok(Made::NoBetter);
            }
        }
        Ok(Made::Tree(self.hand_over(animation, [begun, built], cost)))
    }

    /// Brings boxes to `vertices`; gives their pose if they were blended here.
    fn take_in(&mut self, animation: &Animation, vertices: Vertices) -> Option<Pose> {
        match vertices {
            Vertices::ReadBack(snapshot) => {
                fill(&mut self.boxes, &(animation, &snapshot[..]));
                None
            }
            Vertices::KeyFrames(pose) => {
                blend(animation, pose, &mut self.positions);
                fill(&mut self.boxes, &(animation, &self.positions[..]));
                Some(pose)
            }
        }
    }

    /// Builds and converts one tree for all of `samples`, with `first` for its own cost.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`].
    pub(crate) fn build_for_all(
        &mut self,
        animation: &Animation,
        samples: &[Sample],
        first: Pose,
        cancel: &Cancel,
    ) -> Result<Built, BuildError> {
        let begun = Instant::now();
        let boxes = (animation, first);
        self.builder.build(&boxes, cancel, &mut self.tree)?;
        let cost = sah_cost(&self.tree, &boxes);
        let moments: Vec<_> = samples
            .iter()
            .map(|s| Moment {
                boxes: (animation, s.pose),
                weight: s.weight,
            })
            .collect();
        if moments.len() > 1 {
            let mut for_all = BinaryTree::default();
            TemporalBuilder::new().build(&moments, cancel, &mut for_all)?;
            if temporal_cost(&for_all, &moments) < temporal_cost(&self.tree, &moments) {
                self.tree = for_all;
            }
        }
        let built = Instant::now();
        Ok(self.hand_over(animation, [begun, built], cost))
    }

    /// Converts the tree just built, which then counts as in use.
    fn hand_over(
        &mut self,
        animation: &Animation,
        [begun, built]: [Instant; 2],
        cost: f64,
    ) -> Built {
        let weighed = Instant::now();
        let spare = std::mem::take(&mut self.spare);
        let topology = self
            .converter
            .convert(&self.tree, animation.triangle_count(), spare);
        let topology = self.in_all_forms(topology, animation);
        let topology = topology.with_moving(animation.static_parts());
        std::mem::swap(&mut self.tree, &mut self.in_use);
        let ended = Instant::now();
        Built {
            topology,
            cost,
            build_ms: (built - begun).as_secs_f64() * 1e3,
            convert_ms: (ended - weighed).as_secs_f64() * 1e3,
            moments: BuildMoments {
                begun,
                built,
                weighed,
                ended,
            },
        }
    }
}

impl Workbench {
    /// Adds the forms that were asked for to the record of the tree just built.
    fn in_all_forms(&self, mut topology: Topology, animation: &Animation) -> Topology {
        if self.forms.treelets {
            topology = topology.with_treelets(&self.tree);
        }
        if self.forms.blocks {
            topology = topology.with_blocks(animation.triangles(), &self.boxes);
        }
        topology
    }
}

/// One box a triangle, in its order.
fn fill<B: Boxes>(boxes: &mut Vec<Aabb>, from: &B) {
    (0..from.len() as u32)
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|triangle| from.get(triangle))
        .collect_into_vec(boxes);
}

/// All vertices at `pose`.
fn blend(animation: &Animation, pose: Pose, positions: &mut Vec<Point>) {
    (0..animation.vertex_count() as u32)
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|v| animation.vertex(pose, v))
        .collect_into_vec(positions);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::samples;

    /// Triangles in a row: in order, and with every seventh beside the first.
    fn shuffled() -> Animation {
        let row = |place: fn(u32) -> u32| -> Vec<Point> {
            let corner = |x: f32| [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.5]];
            (0..64).flat_map(|i| corner(place(i) as f32)).collect()
        };
        let triangles = (0..64).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let keys = vec![row(|i| i), row(|i| i * 37 % 64), row(|i| i)];
        Animation::new(keys, triangles).unwrap()
    }

    fn tree(made: Made) -> Option<Built> {
        match made {
            Made::Tree(built) => Some(built),
            Made::NoBetter => None,
        }
    }

    #[test]
    fn only_a_tree_that_is_cheaper_where_it_will_be_used_is_handed_over() {
        let (a, cancel) = (shuffled(), Cancel::new());
        let mut bench = Workbench::new();
        bench.build(&a, &a.keys()[0], &cancel).unwrap();
        let other = || Vertices::KeyFrames(a.pose(1.0));
        let mut made_for = |rival_at: Option<f64>| {
            let at = rival_at.map(|t| a.pose(t));
            tree(bench.build_better(&a, other(), at, &cancel).unwrap())
        };
        assert!(made_for(Some(0.0)).is_none() && made_for(Some(2.0)).is_none());
        // What was not handed over is no rival: this one still meets the first.
        assert!(made_for(Some(1.0)).is_some());
        // Its equal is taken, even where another would be better.
        assert!(made_for(Some(0.0)).is_some());
        assert!(made_for(None).is_some());
    }

    #[test]
    fn key_frames_make_the_same_tree_as_the_vertices_read_back() {
        let (a, cancel) = (shuffled(), Cancel::new());
        let pose = a.pose(0.3);
        let positions: Vec<Point> = (0..192).map(|v| a.vertex(pose, v)).collect();
        let read_back = Vertices::ReadBack(Box::new(positions));
        let [x, y] = [Vertices::KeyFrames(pose), read_back].map(|vertices| {
            let made = Workbench::new().build_better(&a, vertices, None, &cancel);
            tree(made.unwrap()).unwrap()
        });
        assert_eq!((x.topology.words(), x.cost), (y.topology.words(), y.cost));
    }

    #[test]
    fn a_tree_for_all_times_is_never_worse_over_them_than_the_first_frames() {
        let (a, cancel) = (shuffled(), Cancel::new());
        let samples = samples(&a, [0.0, 2.0]);
        let mut bench = Workbench::new();
        let first = a.pose(0.0);
        let for_all = bench.build_for_all(&a, &samples, first, &cancel).unwrap();
        let own = bench.build(&a, &a.keys()[0], &cancel).unwrap();
        assert_eq!(for_all.cost, own.cost);
        assert_ne!(for_all.topology.words(), own.topology.words());
        // Where hardly anything but the first frame counts, its own tree is taken.
        let mut rarely = samples;
        rarely[1..].iter_mut().for_each(|s| s.weight *= 1e-9);
        let for_first = bench.build_for_all(&a, &rarely, first, &cancel).unwrap();
        assert_eq!(for_first.topology.words(), own.topology.words());
    }

    #[test]
    fn records_carry_the_forms_that_were_asked_for() {
        let (a, cancel) = (shuffled(), Cancel::new());
        for (treelets, blocks) in [(false, false), (true, false), (false, true)] {
            let mut bench = Workbench::with_forms(Forms { treelets, blocks });
            let tree = bench.build(&a, &a.keys()[0], &cancel).unwrap().topology;
            let carried = (tree.treelets().is_some(), tree.blocks().is_some());
            assert_eq!(carried, (treelets, blocks));
        }
    }

    #[test]
    fn an_old_records_memory_is_used_again() {
        let (a, cancel) = (shuffled(), Cancel::new());
        let mut bench = Workbench::new();
        let words = bench
            .build(&a, &a.keys()[0], &cancel)
            .unwrap()
            .topology
            .into_words();
        let memory = words.as_ptr();
        bench.reuse(words);
        let again = bench.build(&a, &a.keys()[1], &cancel).unwrap().topology;
        assert_eq!(again.words().as_ptr(), memory);
    }
}
