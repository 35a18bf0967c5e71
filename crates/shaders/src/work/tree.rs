//! Dispatches that update a tree: triangle records, and boxes treelet by treelet, level by level.

use super::{Groups, Work};
use crate::{
    Counts, Kernel, MovingShape, Params, Shape, SumParams, TreeletsParams, common, kernel,
};
use backend::Intersector;
use std::mem::offset_of;
use std::ops::Range;

/// Tracks which parts of the current tree, or of a candidate, have been computed on the device.
///
/// The first work on a tree covers the whole tree. Later work covers only the moving treelets, if the tree lists them.
/// The host must report recorded work. It creates a new value for each tree, and if recorded work was discarded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TreeProgress {
    has_records: bool,
    has_boxes: bool,
    /// Whether `preprocess` computed all boxes in this recording.
    has_refitted_all_levels: bool,
    /// Whether the tree is a candidate that is evaluated next to the current one.
    is_candidate: bool,
}

impl TreeProgress {
    /// Returns the progress of a candidate tree that is evaluated next to the current one, before any work.
    #[must_use]
    pub fn of_candidate() -> Self {
        Self {
            is_candidate: true,
            ..Self::default()
        }
    }

    /// Returns the progress of a candidate tree that becomes the current one. Its records stay valid. The areas of the
    /// whole tree are summed again, into [`Counts::areas`], because the evaluation stored their sum in
    /// [`Counts::candidate_areas`].
    #[must_use]
    pub fn promoted(self) -> Self {
        Self {
            has_records: self.has_records,
            ..Self::default()
        }
    }

    /// Returns the dispatches that compute records, and the boxes of all nodes in treelets of triangles, from positions. The
    /// first work on a tree also gathers the leaves' vertices. Also returns the number of zero-area triangles that the
    /// dispatches skip and so do not count.
    ///
    /// For small trees, these dispatches blend two key frames instead. [`Params::alpha`] is the later one's weight. The
    /// dispatches also compute all other boxes. They do not read positions, so `interpolate` can run concurrently.
    pub fn preprocess(
        &self,
        intersector: Intersector,
        params: Params,
        tree: &Shape,
    ) -> (Vec<Work>, u32) {
        let gather = (!self.has_records).then(|| gather_corners(params, tree));
        let (records, skipped_degenerate) = self.records(intersector, params, tree);
        let mut work: Vec<_> = gather.into_iter().chain([records]).collect();
        work[0].alongside = reads_keys(tree);
        (work, skipped_degenerate)
    }

    /// Reports that the dispatches of [`Self::preprocess`] were recorded for `tree`.
    pub fn preprocessed(&mut self, tree: &Shape) {
        let moving = tree.moving.as_ref().filter(|_| self.has_records);
        let has_run = levels(tree, moving).iter().any(|level| !level.is_empty());
        self.has_refitted_all_levels = refits_all_levels(tree) && has_run;
        self.has_records = true;
    }

    /// Returns the dispatches that compute the boxes of all other nodes level by level, and the tree's cost. The list is empty
    /// if `preprocess` has done so.
    pub fn refit(&self, params: Params, tree: &Shape) -> Vec<Work> {
        if self.has_refitted_all_levels || tree.leaf_count == 0 {
            return Vec::new();
        }
        self.boxes(params, tree)
    }

    /// Returns the dispatch that computes records from positions or key frames. It also computes the boxes of all nodes
    /// in treelets of triangles, or in all treelets if [`refits_all_levels`]. If records already exist, it covers only
    /// moving treelets. Also returns the number of zero-area triangles in the treelets that it skips.
    fn records(&self, intersector: Intersector, params: Params, tree: &Shape) -> (Work, u32) {
        let entry = if reads_keys(tree) {
            "preprocess_treelets_from_key_frames"
        } else {
            "preprocess_treelets"
        };
        let moving = tree.moving.as_ref().filter(|_| self.has_records);
        let lowest = levels(tree, moving).first().cloned().unwrap_or_default();
        let own = TreeletsParams {
            uses_list: moving.is_some().into(),
            treelet_count: if refits_all_levels(tree) {
                tree.treelet_count()
            } else {
                0
            },
            sum_counter: self.sum_counter(),
            ..TreeletsParams::default()
        };
        let skipped_degenerate = moving.map_or(0, |moving| moving.degenerate_elsewhere);
        let work = over_treelets(kernel(entry, intersector), params, own, lowest);
        (work, skipped_degenerate)
    }

    /// Returns the dispatches that compute the boxes of all nodes above the roots of the lowest treelets. If boxes already
    /// exist, they only cover moving treelets.
    ///
    /// Each treelet has its own sum of areas. The workgroup that computes the root box adds all sums and stores the
    /// total in a word of the counts. If there is only one level or nothing moves, a dispatch only adds the sums.
    /// Treelets that are skipped keep their sums.
    fn boxes(&self, params: Params, tree: &Shape) -> Vec<Work> {
        let moving = tree.moving.as_ref().filter(|_| self.has_boxes);
        let levels = levels(tree, moving);
        let (all, counter) = (tree.treelet_count(), self.sum_counter());
        if levels.len() < 2 || levels.iter().all(Range::is_empty) {
            return vec![sum_costs(params, all, counter)];
        }
        let own = |level| TreeletsParams {
            uses_list: moving.is_some().into(),
            treelet_count: if level + 1 == levels.len() { all } else { 0 },
            sum_counter: counter,
            ..TreeletsParams::default()
        };
        let refit = common("refit_treelets");
        let above = levels.iter().enumerate().skip(1);
        above
            .map(|(i, level)| over_treelets(refit, params, own(i), level.clone()))
            .collect()
    }

    /// Returns the word of the counts that receives the sum of the tree's areas.
    fn sum_counter(&self) -> u32 {
        word_of_counter(if self.is_candidate {
            offset_of!(Counts, candidate_areas)
        } else {
            offset_of!(Counts, areas)
        })
    }

    /// Reports that the dispatches of [`Self::refit`] were recorded.
    pub fn refitted(&mut self) {
        self.has_boxes = true;
    }

    /// Reports that the recording was submitted, so that the next one starts.
    pub fn submitted(&mut self) {
        self.has_refitted_all_levels = false;
    }
}

/// Returns the dispatch that gathers the vertices of a newly adopted tree's leaves.
fn gather_corners(params: Params, tree: &Shape) -> Work {
    let params = params.with(TreeletsParams {
        treelet_count: tree.treelet_count(),
        ..TreeletsParams::default()
    });
    Work::linear(common("gather_corners"), params, 3 * tree.leaf_count)
}

/// Maximum number of leaves for which `preprocess` blends key frames itself. Up to this size, not waiting for positions
/// saves more time than it costs to blend each vertex once per triangle. On an H200: 4 us saved at 70K triangles, 0 at
/// 500K, 8 lost at 1.6M.
const FROM_KEYS: u32 = 1 << 19;

/// Returns whether `preprocess` reads key frames instead of positions.
fn reads_keys(tree: &Shape) -> bool {
    tree.leaf_count <= FROM_KEYS
}

/// Returns whether `preprocess` also computes the boxes of all other treelets. This avoids a barrier per level, but
/// takes longer for large trees. On an H200: 2 us less at 70K and 250K triangles, 20 us more at 1.6M. For skipped
/// treelets, `costs` still contains the root boxes of the first run, which covers the whole tree.
fn refits_all_levels(tree: &Shape) -> bool {
    reads_keys(tree) && tree.treelet_count() > 1
}

/// Returns the treelets of each level: by index, or as ranges of the lists of moving treelets.
fn levels<'a>(tree: &'a Shape, moving: Option<&'a MovingShape>) -> &'a [Range<u32>] {
    moving.map_or(&tree.treelets, |moving| &moving.levels)
}

fn over_treelets(
    kernel: &'static Kernel,
    params: Params,
    own: TreeletsParams,
    level: Range<u32>,
) -> Work {
    let first = level.start;
    let params = Params {
        count: level.len() as u32,
        ..params.with(TreeletsParams { first, ..own })
    };
    Work::new(kernel, params, Groups::Each(params.count))
}

/// Converts the offset of a member of [`Counts`] from bytes to words.
pub(crate) fn word_of_counter(member: usize) -> u32 {
    (member / size_of::<u32>()) as u32
}

/// Returns the dispatch that sums the partial sums of `groups` workgroups into a word of [`Counts`].
pub(crate) fn sum_costs(params: Params, groups: u32, counter: u32) -> Work {
    let params = Params {
        count: groups,
        ..params.with(SumParams { counter })
    };
    Work::new(common("sum_costs"), params, Groups::Linear(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entry point, first treelet, count, number of all treelets and `uses_list` of a dispatch.
    type Summary = (&'static str, u32, u32, u32, u32);

    fn summaries(work: &[Work]) -> Vec<Summary> {
        let summary = |w: &Work| {
            let own: TreeletsParams = w.params.own.get();
            (
                w.kernel.entry,
                own.first,
                w.params.count,
                own.treelet_count,
                own.uses_list,
            )
        };
        work.iter().map(summary).collect()
    }

    fn sum_counter(work: &Work) -> usize {
        4 * work.params.own.get::<TreeletsParams>().sum_counter as usize
    }

    fn alongside_flags(work: &[Work]) -> Vec<bool> {
        work.iter().map(|w| w.alongside).collect()
    }

    #[test]
    fn later_refits_process_only_moving_treelets() {
        let intersector = Intersector::Watertight;
        let tree = Shape {
            leaf_count: 20_000,
            treelets: vec![0..90, 90..93, 93..94],
            moving: Some(MovingShape {
                levels: vec![500..507, 507..508, 508..509],
                degenerate_elsewhere: 4,
            }),
            ..Shape::default()
        };
        let (mut progress, params) = (TreeProgress::default(), Params::default());
        let (work, skipped_degenerate) = progress.preprocess(intersector, params, &tree);
        let whole = vec![
            ("gather_corners", 0, 60_000, 94, 0),
            ("preprocess_treelets_from_key_frames", 0, 90, 94, 0),
        ];
        assert_eq!((summaries(&work), skipped_degenerate), (whole, 0));
        assert_eq!(alongside_flags(&work), [true, false]);
        assert_eq!(sum_counter(&work[1]), offset_of!(Counts, areas));
        progress.preprocessed(&tree);
        let work = progress.refit(params, &tree);
        assert!(work.is_empty());
        progress.submitted();
        let (work, skipped_degenerate) = progress.preprocess(intersector, params, &tree);
        let listed = vec![("preprocess_treelets_from_key_frames", 500, 7, 94, 1)];
        assert_eq!((summaries(&work), skipped_degenerate), (listed, 4));
        assert_eq!(alongside_flags(&work), [true]);
        assert_eq!(sum_counter(&work[0]), offset_of!(Counts, areas));
        let work = progress.refit(params, &tree);
        let whole = [
            ("refit_treelets", 90, 3, 0, 0),
            ("refit_treelets", 93, 1, 94, 0),
        ];
        assert_eq!(summaries(&work), whole);
        progress.refitted();
        let work = progress.refit(params, &tree);
        let listed = [
            ("refit_treelets", 507, 1, 0, 1),
            ("refit_treelets", 508, 1, 94, 1),
        ];
        assert_eq!(summaries(&work), listed);
    }
}
