//! Builds trees from vertices and converts them to a [`Topology`], in the rayon pool of the calling thread.

mod degradation;
mod extrapolation;
mod job;
mod pose_source;
mod warm_up;

use backend::{Snapshot, TreeFormat};
use bvh_build::{
    BinaryTree, BlockSize, Boxes, BuildError, Cancel, SahBuilder, SubtreeRebuilder, TreeCosts,
    sah_cost,
};
use bvh_layout::{CollapseOptions, Converter, FirstVisited, Topology};
pub(crate) use degradation::BuildStrategy;
use degradation::DegradationMonitor;
use extrapolation::ExtrapolationMonitor;
use geom::{Aabb, Animation, KeyFrame, KeyFrameError, Point, Pose};
pub(crate) use job::{BuildInput, Observed};
pub(crate) use pose_source::pose_between;
use pose_source::{PoseSource, RUN, blend, store};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Source of the vertices of a build.
pub(crate) enum Vertices {
    /// Positions that a backend interpolated, read back.
    ReadBack(Snapshot),
    /// Pose to blend on the host, from key frames or from two observed frames. Positions blended from key frames are
    /// bit-identical to those of every backend.
    AtPose(Pose),
}

/// A finished tree.
#[derive(Debug)]
pub(crate) struct Built {
    pub(crate) topology: Topology,
    /// [`sah_cost`] of the tree at the vertices that it was built from.
    pub(crate) cost: f64,
    /// How it was built.
    pub(crate) strategy: BuildStrategy,
    /// How the next tree will be built, if it is compared with this one.
    pub(crate) next: BuildStrategy,
    /// Whether it was built for the last observed positions instead of the requested time.
    pub(crate) gave_up_extrapolation: bool,
    /// Duration from the start of the build, with the blend of key frames, to the complete binary tree.
    pub(crate) build_time: Duration,
    /// Duration of the conversion to a topology.
    pub(crate) convert_time: Duration,
    /// Duration of the build, the computation of costs and the conversion.
    pub(crate) total_time: Duration,
}

/// Builds trees and converts them. Keeps its memory between builds.
#[derive(Debug, Default)]
pub(crate) struct TreeBuilder {
    builder: SahBuilder,
    subtree_rebuilder: SubtreeRebuilder,
    /// The tree being built. Between builds, the one before the last.
    tree: Arc<BinaryTree>,
    /// The last built tree. Its topology shares it.
    last: Arc<BinaryTree>,
    converter: Converter,
    positions: Vec<Point>,
    boxes: Vec<Aabb>,
    /// Memory of an old topology.
    spare: Vec<u32>,
    /// Format to which topologies are converted during the build, so that their adoption takes little time in a frame.
    format: TreeFormat,
    degradation: DegradationMonitor,
    extrapolation: ExtrapolationMonitor,
    /// Vertices of the last two observed frames.
    observed: [KeyFrame; 2],
}

impl TreeBuilder {
    /// Creates a builder whose topologies contain trees of this format.
    pub(crate) fn with_format(format: TreeFormat) -> Self {
        let mut builder = SahBuilder::default();
        if format == TreeFormat::WideBlocks {
            builder.block_size = BlockSize::Eight;
        }
        Self {
            builder,
            format,
            ..Self::default()
        }
    }

    /// Takes the memory of an old topology for the next one.
    pub(crate) fn reuse(&mut self, spare: Vec<u32>) {
        self.spare = spare;
    }

    /// Restores the tree before the last one, because the last one was never used.
    pub(crate) fn revert(&mut self) {
        std::mem::swap(&mut self.tree, &mut self.last);
    }

    /// Copies observed positions into the builder's own key frames.
    fn store(&mut self, seen: Observed) -> [KeyFrame; 2] {
        seen.frames
            .into_iter()
            .zip(&mut self.observed)
            .for_each(|(seen, frame)| store(&seen, frame));
        self.observed.clone()
    }

    /// Builds a tree from `input` and converts it.
    ///
    /// With [`BuildInput::swept_poses`], the tree is built over boxes that contain each triangle at both poses, so it
    /// separates triangles that move apart. Its cost is always measured at the vertices of `input`.
    ///
    /// A tree that is compared with the last tree is built from subtrees of the last tree, which is faster. It is built
    /// from scratch if trees degrade so slowly that build time does not matter. It is built over two poses only if trees
    /// degrade fast.
    pub(crate) fn build(
        &mut self,
        animation: &Animation,
        mut input: BuildInput,
        cancel: &Cancel,
    ) -> Result<Built, BuildError> {
        let started = Instant::now();
        self.builder.toward = input.toward;
        let times = input.observed.as_ref().map(|observed| observed.times);
        let observed = input.observed.take().map(|seen| self.store(seen));
        let source = &PoseSource {
            animation,
            frames: observed.or(input.key_frames.take()),
        };
        let gave_up_extrapolation = self.check_extrapolation(source, &mut input, times)?;
        let is_compared = input.is_compared && self.has_all_triangles_of(animation);
        let strategy = if is_compared {
            self.degradation.strategy()
        } else {
            BuildStrategy::Scratch
        };
        if is_compared && !self.degradation.is_fast {
            input.swept_poses = None;
        }
        let costs = self.build_tree(source, &input, strategy, cancel)?;
        let build_time = started.elapsed();
        let cost = if is_compared {
            let costs = costs.unwrap_or_else(|| self.costs());
            self.degradation.observe(costs);
            costs.new
        } else {
            sah_cost(&self.tree, &self.boxes[..])
        };
        let convert_started = Instant::now();
        let topology = self.convert(animation);
        std::mem::swap(&mut self.tree, &mut self.last);
        let ended = Instant::now();
        if let Some(write) = input.writer {
            write(&topology);
        }
        Ok(Built {
            topology,
            cost,
            strategy,
            next: self.degradation.strategy(),
            gave_up_extrapolation,
            build_time,
            convert_time: ended - convert_started,
            total_time: ended - started,
        })
    }

    /// If extrapolation failed before, replaces extrapolated positions by the last observed ones and returns `true`.
    fn check_extrapolation(
        &mut self,
        source: &PoseSource<'_>,
        input: &mut BuildInput,
        times: Option<[f64; 2]>,
    ) -> Result<bool, KeyFrameError> {
        let Vertices::AtPose(pose) = &mut input.vertices else {
            return Ok(false);
        };
        if pose.alpha <= 1.0 {
            return Ok(false);
        }
        let seen = source.at(*pose)?;
        let times = times.unwrap_or([0.0, 1.0].map(|after| f64::from(pose.key) + after));
        if self.extrapolation.observe(seen.key_frames(), times) {
            return Ok(false);
        }
        (pose.alpha, input.swept_poses) = (1.0, None);
        Ok(true)
    }

    /// Returns whether the last tree contains all live triangles, so that the next one can be built from its subtrees.
    fn has_all_triangles_of(&self, animation: &Animation) -> bool {
        let leaves = self.last.leaf_count();
        leaves > 0 && leaves == animation.live_count()
    }

    /// Builds a tree from the vertices of `input`. If `input` has swept poses, builds the tree over boxes that
    /// contain each triangle at both poses, and then computes the boxes at the vertices. Without swept poses, a build
    /// from subtrees does not update `self.boxes`, except for [`TreeFormat::WideBlocks`], whose conversion needs them.
    /// Returns the costs at the vertices if the build computed them.
    fn build_tree(
        &mut self,
        source: &PoseSource<'_>,
        input: &BuildInput,
        strategy: BuildStrategy,
        cancel: &Cancel,
    ) -> Result<Option<TreeCosts>, BuildError> {
        let vertices = &input.vertices;
        if let Some(swept_poses) = input.swept_poses {
            self.compute_swept_boxes(source, swept_poses)?;
            self.build_over_boxes(strategy, cancel)?;
            self.compute_boxes(source, vertices)?;
            return Ok(None);
        }
        if strategy == BuildStrategy::Subtrees && self.format != TreeFormat::WideBlocks {
            return self.rebuild_subtrees_at(source, vertices, cancel).map(Some);
        }
        self.compute_boxes(source, vertices)?;
        self.build_over_boxes(strategy, cancel)
    }

    /// Builds a tree from subtrees of the last one. Each box is read once, so boxes are computed but not stored.
    fn rebuild_subtrees_at(
        &mut self,
        source: &PoseSource<'_>,
        vertices: &Vertices,
        cancel: &Cancel,
    ) -> Result<TreeCosts, BuildError> {
        let positions = source.positions(vertices, &mut self.positions)?;
        let (boxes, tree) = (source.boxes(positions), writable(&mut self.tree));
        self.subtree_rebuilder
            .build(&mut self.builder, &self.last, &boxes, cancel, tree)
    }

    /// Returns the costs of the last and the new tree with the current boxes.
    fn costs(&self) -> TreeCosts {
        let [previous, new] = [&self.last, &self.tree].map(|tree| sah_cost(tree, &self.boxes[..]));
        TreeCosts { previous, new }
    }

    /// Computes boxes that contain each triangle at both poses.
    fn compute_swept_boxes(
        &mut self,
        source: &PoseSource<'_>,
        [a, b]: [Pose; 2],
    ) -> Result<(), KeyFrameError> {
        self.compute_boxes(source, &Vertices::AtPose(a))?;
        blend(&source.at(b)?, &mut self.positions);
        let boxes = source.boxes(&self.positions);
        let each = self.boxes.par_iter_mut().with_min_len(RUN).enumerate();
        each.for_each(|(triangle, to)| *to = to.union(boxes.get(triangle as u32)));
        Ok(())
    }

    /// Computes the boxes of the triangles at `vertices`.
    fn compute_boxes(
        &mut self,
        source: &PoseSource<'_>,
        vertices: &Vertices,
    ) -> Result<(), KeyFrameError> {
        let boxes = source.boxes(source.positions(vertices, &mut self.positions)?);
        let triangles = (0..boxes.triangle_count() as u32).into_par_iter();
        let all = triangles.with_min_len(RUN).map(|t| boxes.get(t));
        all.collect_into_vec(&mut self.boxes);
        Ok(())
    }

    /// Builds a tree over the current boxes, from subtrees of the last one or from scratch.
    fn build_over_boxes(
        &mut self,
        strategy: BuildStrategy,
        cancel: &Cancel,
    ) -> Result<Option<TreeCosts>, BuildError> {
        let (boxes, tree) = (&self.boxes[..], writable(&mut self.tree));
        if strategy == BuildStrategy::Scratch {
            self.builder.build(boxes, cancel, tree)?;
            return Ok(None);
        }
        let costs =
            (self.subtree_rebuilder).build(&mut self.builder, &self.last, boxes, cancel, tree)?;
        Ok(Some(costs))
    }

    /// Returns the new tree as a topology, in the requested format.
    fn convert(&mut self, animation: &Animation) -> Topology {
        let (tree, triangles) = (Arc::clone(&self.tree), animation.triangle_count());
        match self.format {
            TreeFormat::Binary => Topology::new(tree, triangles),
            TreeFormat::Treelets => {
                let spare = std::mem::take(&mut self.spare);
                let topology = self.converter.convert(tree, triangles, spare);
                topology.with_moving(animation.static_parts())
            }
            TreeFormat::WideBlocks => {
                let first_visited = match self.builder.toward {
                    Some(_) => FirstVisited::Left,
                    None => FirstVisited::Larger,
                };
                let options = CollapseOptions {
                    boxes: &self.boxes,
                    first_visited,
                };
                Topology::new(tree, triangles).with_blocks(animation.triangles(), options)
            }
        }
    }
}

/// Returns a tree to overwrite. Replaces it by an empty one if a topology or a backend still shares it.
fn writable(tree: &mut Arc<BinaryTree>) -> &mut BinaryTree {
    if Arc::get_mut(tree).is_none() {
        *tree = Arc::default();
    }
    Arc::make_mut(tree)
}

#[cfg(test)]
pub(crate) mod tests;
