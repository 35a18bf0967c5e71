//! Dispatches that update a tree: triangle records, and boxes treelet by treelet, level by level.

use super::{Groups, Work};
use crate::{Counts, Kernel, MovingShape, Params, Shape, common, kernel};
use backend::Intersector;
use std::mem::offset_of;
use std::ops::Range;

/// Tracks which parts of the current tree have been computed on the device since it was adopted.
///
/// The first work on a tree covers the whole tree. Later work covers only moving parts, if the tree lists its moving parts. The
/// host must report recorded work. It starts with a new value for each tree, or if recorded work was discarded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    has_records: bool,
    has_boxes: bool,
    /// Whether `preprocess` computed all boxes in this recording.
    has_climbed: bool,
    /// Whether the tree is a candidate that is evaluated next to the current one.
    is_candidate: bool,
}

impl Progress {
    /// Returns the progress of a candidate tree that is evaluated next to the current one, before any work.
    #[must_use]
    pub fn of_candidate() -> Self {
        Self {
            is_candidate: true,
            ..Self::default()
        }
    }

    /// Returns the progress of a candidate tree that becomes the current one. The areas of the whole tree are summed again,
    /// because those of the evaluation belong to other counts.
    #[must_use]
    pub fn promoted(self) -> Self {
        Self {
            has_records: self.has_records,
            ..Self::default()
        }
    }

    /// Returns the dispatches that compute records, and the boxes of all nodes in treelets of triangles, from positions. The
    /// first work on a tree also gathers the leaves' vertices. Also returns the number of zero-area triangles that the
    /// dispatches skip, for [`crate::Extents::uncounted`].
    ///
    /// Small trees are computed from key frames; the later one has the weight [`Params::alpha`]. Such work does not read
    /// positions, so it can run concurrently with `interpolate`.
    pub fn preprocess(
        &self,
        intersector: Intersector,
        params: Params,
        tree: &Shape,
    ) -> (Vec<Work>, u32) {
        let params = self.with_sums(params);
        let gather = (!self.has_records).then(|| gather_corners(params, tree));
        let (records, uncounted) = preprocess(intersector, params, tree, self.has_records);
        let mut work: Vec<_> = gather.into_iter().chain([records]).collect();
        work[0].alongside = reads_keys(tree);
        (work, uncounted)
    }

    /// Reports that work was recorded for `tree`.
    pub fn preprocessed(&mut self, tree: &Shape) {
        self.has_climbed = climbs(tree);
        self.has_records = true;
    }

    /// Returns the dispatches that compute the boxes of all other nodes level by level, and the tree's cost. The list is empty
    /// if `preprocess` has done so.
    pub fn refit(&self, params: Params, tree: &Shape) -> Vec<Work> {
        if self.has_climbed || tree.leaf_count == 0 {
            return Vec::new();
        }
        refit(self.with_sums(params), tree, self.has_boxes)
    }

    /// Sets the word that receives the sum of the tree's areas.
    fn with_sums(&self, params: Params) -> Params {
        let sum = if self.is_candidate {
            offset_of!(Counts, candidate_areas)
        } else {
            offset_of!(Counts, areas)
        };
        Params {
            destination: word_of(sum),
            ..params
        }
    }

    /// Reports that work was recorded.
    pub fn refitted(&mut self) {
        self.has_boxes = true;
    }

    /// Reports that the recording was submitted, so that the next one starts.
    pub fn submitted(&mut self) {
        self.has_climbed = false;
    }
}

/// Returns the dispatch that gathers the vertices of a newly adopted tree's leaves.
fn gather_corners(mut params: Params, tree: &Shape) -> Work {
    params.first_group = tree.treelet_count();
    Work::linear(common("gather_corners"), params, 3 * tree.leaf_count)
}

/// Maximum number of leaves for which `preprocess` blends key frames itself. Up to here, not waiting for positions saves
/// more time than blending a vertex once per triangle costs. On an H200: 4 us saved at 70K triangles, 0 at 500K, 8 lost
/// at 1.6M.
const FROM_KEYS: u32 = 1 << 19;

/// Returns whether `preprocess` reads key frames instead of positions.
fn reads_keys(tree: &Shape) -> bool {
    tree.leaf_count <= FROM_KEYS
}

/// Returns whether `preprocess` also computes the boxes of all other treelets, if there are any. Treelets that it skips
/// keep the roots that it computed for the whole tree. This avoids a barrier per level, but takes longer for large trees.
/// On an H200: 2 us less at 70K and 250K triangles, 20 us more at 1.6M.
fn climbs(tree: &Shape) -> bool {
    reads_keys(tree) && tree.treelet_count() > 1
}

/// Returns the dispatch that computes records from positions or key frames, and boxes of all nodes in treelets of triangles,
/// or in all treelets. If records already exist (`has_records`), it only covers moving treelets. Also returns the number of
/// zero-area triangles that it skips.
fn preprocess(
    intersector: Intersector,
    params: Params,
    tree: &Shape,
    has_records: bool,
) -> (Work, u32) {
    let entry = match reads_keys(tree) {
        true => "preprocess_treelets_of_keys",
        false => "preprocess_treelets",
    };
    let preprocess = kernel(entry, intersector);
    let (mut params, levels) = levels(params, tree, has_records);
    if climbs(tree) {
        params.first_group = tree.treelet_count();
    }
    let lowest = levels.first().cloned().unwrap_or_default();
    let uncounted = listed(tree, has_records).map_or(0, |moving| moving.degenerate_elsewhere);
    (over(preprocess, params, lowest), uncounted)
}

/// Returns the dispatches that compute the boxes of all nodes above the roots of the lowest treelets. If boxes already exist
/// (`has_records`), they only cover moving treelets.
///
/// Each treelet has its own sum of areas. The workgroup that computes the root box adds all sums and stores the total in
/// word [`Params::destination`] of the counts. Treelets that are skipped keep their sums.
fn refit(params: Params, tree: &Shape, has_records: bool) -> Vec<Work> {
    let refit = common("refit_treelets");
    let (of_levels, levels) = levels(params, tree, has_records);
    let above = levels.iter().skip(1);
    let above = above.map(|level| over(refit, of_levels, level.clone()));
    let mut work: Vec<_> = above.collect();
    match work.last_mut() {
        Some(last) => {
            last.params.first_group = tree.treelet_count();
        }
        None => work.push(sum(params, tree.treelet_count(), params.destination)),
    }
    work
}

/// Returns the lists of moving treelets if the tree has any and its records and boxes already exist (`has_records`).
fn listed(tree: &Shape, has_records: bool) -> Option<&MovingShape> {
    tree.moving.as_ref().filter(|_| has_records)
}

/// Returns the treelets of each level, by index or as ranges of the lists.
fn levels(mut params: Params, tree: &Shape, has_records: bool) -> (Params, &[Range<u32>]) {
    let listed = listed(tree, has_records);
    params.listed = listed.is_some().into();
    (
        params,
        listed.map_or(&tree.treelets, |moving| &moving.levels),
    )
}

fn over(kernel: &'static Kernel, mut params: Params, level: Range<u32>) -> Work {
    (params.first, params.count) = (level.start, level.len() as u32);
    Work::new(kernel, params, Groups::Each(params.count))
}

/// Converts the offset of a member of [`Counts`] from bytes to words.
pub(crate) fn word_of(member: usize) -> u32 {
    (member / size_of::<u32>()) as u32
}

/// Returns the dispatch that sums the partial sums of `groups` workgroups into a word of [`Counts`].
pub(crate) fn sum(mut params: Params, groups: u32, word: u32) -> Work {
    (params.count, params.first) = (groups, word);
    Work::new(common("sum_costs"), params, Groups::Linear(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entry point, first element, count, `first_group` and `listed` of a dispatch.
    type Told = (&'static str, u32, u32, u32, u32);

    fn told(work: &[Work]) -> Vec<Told> {
        let told = |w: &Work| {
            let p = &w.params;
            (w.kernel.entry, p.first, p.count, p.first_group, p.listed)
        };
        work.iter().map(told).collect()
    }

    fn beside(work: &[Work]) -> Vec<bool> {
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
        let (mut progress, params) = (Progress::default(), Params::default());
        let (work, uncounted) = progress.preprocess(intersector, params, &tree);
        let whole = vec![
            ("gather_corners", 0, 60_000, 94, 0),
            ("preprocess_treelets_of_keys", 0, 90, 94, 0),
        ];
        assert_eq!((told(&work), uncounted), (whole, 0));
        assert_eq!(beside(&work), [true, false]);
        assert_eq!(work[1].params.destination, 4);
        progress.preprocessed(&tree);
        let work = progress.refit(params, &tree);
        assert!(work.is_empty());
        progress.submitted();
        let (work, uncounted) = progress.preprocess(intersector, params, &tree);
        let listed = vec![("preprocess_treelets_of_keys", 500, 7, 94, 1)];
        assert_eq!((told(&work), uncounted), (listed, 4));
        assert_eq!(beside(&work), [true]);
        assert_eq!(work[0].params.destination, 4);
        let work = progress.refit(params, &tree);
        let whole = [
            ("refit_treelets", 90, 3, 0, 0),
            ("refit_treelets", 93, 1, 94, 0),
        ];
        assert_eq!(told(&work), whole);
        progress.refitted();
        let work = progress.refit(params, &tree);
        let listed = [
            ("refit_treelets", 507, 1, 0, 1),
            ("refit_treelets", 508, 1, 94, 1),
        ];
        assert_eq!(told(&work), listed);
    }
}
