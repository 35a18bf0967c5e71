//! Dispatches that update a tree: triangle records, and boxes level by level.

use super::{Groups, Work, treelets};
use crate::{Extent, Kernel, MovingShape, Params, Shape, common, kernel};
use backend::{Layout, Method};
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
    sums: Sums,
}

/// The members of [`crate::Counts`] that receive a tree's areas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Sums {
    /// Those of the current tree.
    #[default]
    Current,
    /// Those of a candidate tree that is evaluated next to the current one.
    Candidate,
}

impl Sums {
    /// Returns the member that receives the areas of all nodes, except moving ones where these are summed separately.
    fn all(self) -> usize {
        match self {
            Self::Current => offset_of!(crate::Counts, areas),
            Self::Candidate => offset_of!(crate::Counts, candidate_areas),
        }
    }

    /// Returns the member that receives the areas of moving nodes.
    fn moving(self) -> usize {
        match self {
            Self::Current => offset_of!(crate::Counts, moving_areas),
            Self::Candidate => offset_of!(crate::Counts, candidate_moving_areas),
        }
    }
}

impl Progress {
    /// Returns the progress of a candidate tree that is evaluated next to the current one, before any work.
    #[must_use]
    pub fn of_candidate() -> Self {
        Self {
            sums: Sums::Candidate,
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

    /// Returns the dispatches that compute records and leaf boxes from positions, and the number of zero-area triangles
    /// that they skip, for [`crate::Extents::uncounted`].
    ///
    /// With layout `bvh2`, the first work on a tree also expands its lists of nodes. With layout `fast`, the first work also
    /// gathers the leaves' vertices, and all work computes the boxes of all nodes in treelets of triangles.
    ///
    /// Small trees with layout `fast` are computed from key frames; the later one has the weight [`Params::alpha`]. Such
    /// work does not read positions, so it can run concurrently with `interpolate`.
    pub fn preprocess(&self, method: Method, params: Params, tree: &Shape) -> (Vec<Work>, u32) {
        let params = self.with_sums(params);
        if tree.layout == Layout::Fast {
            let adopt = (!self.has_records).then(|| treelets::adopt(method, params, tree));
            let (work, uncounted) = treelets::preprocess(method, params, tree, self.has_records);
            let mut work: Vec<_> = adopt.into_iter().chain([work]).collect();
            work[0].alongside = treelets::reads_keys(tree);
            return (work, uncounted);
        }
        let mut work = Vec::with_capacity(3);
        if !self.has_records {
            // The tree's lists of nodes.
            let nodes = Groups::Linear(params.node_count);
            work.push(Work::new(common("expand"), params, nodes));
            let moving = tree.moving.as_ref();
            work.extend(moving.map(|m| over(common("mark_moving"), params, &m.inner)));
        }
        let moving = tree.moving.as_ref().filter(|_| self.has_records);
        let mut leaves = leaves(method, params, tree);
        if let Some(moving) = moving {
            leaves = over(leaves.kernel, params, &moving.leaves);
            leaves.params.listed = 1;
        }
        work.push(leaves);
        (work, moving.map_or(0, |moving| moving.degenerate_elsewhere))
    }

    /// Reports that work was recorded for `tree`.
    pub fn preprocessed(&mut self, tree: &Shape) {
        self.has_climbed = tree.layout == Layout::Fast && treelets::climbs(tree);
        self.has_records = true;
    }

    /// Returns the dispatches that compute boxes of inner nodes level by level, and the tree's cost. The list is empty if
    /// `preprocess` has done so. Also returns which nodes' areas are summed.
    pub fn refit(&self, method: Method, params: Params, tree: &Shape) -> (Vec<Work>, Extent) {
        let params = self.with_sums(params);
        if self.has_climbed {
            return (Vec::new(), Extent::Whole);
        }
        if tree.layout == Layout::Fast && tree.leaf_count > 0 {
            let work = treelets::refit(method, params, tree, self.has_boxes);
            return (work, Extent::Whole);
        }
        let moving = tree.moving.as_ref();
        match moving.filter(|_| self.has_boxes && tree.leaf_count > 0) {
            Some(moving) => (refit_moving(params, moving, self.sums), Extent::Moving),
            None => (refit_whole(params, tree, self.sums), Extent::Whole),
        }
    }

    /// Sets the word that receives the sum of the treelets' areas.
    fn with_sums(&self, params: Params) -> Params {
        Params {
            destination: word_of(self.sums.all()),
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

/// Returns the dispatch that computes records and boxes of all leaves from positions.
pub fn leaves(method: Method, params: Params, tree: &Shape) -> Work {
    Work::linear(kernel("preprocess", method), params, tree.leaf_count)
}

/// Returns a dispatch over elements of a list, or over nodes by their indices.
fn over(kernel: &'static Kernel, mut params: Params, elements: &Range<u32>) -> Work {
    params.first = elements.start;
    Work::linear(kernel, params, elements.len() as u32)
}

fn refit_whole(params: Params, tree: &Shape, sums: Sums) -> Vec<Work> {
    if tree.leaf_count == 0 {
        return Vec::new();
    }
    let mut work = refit_levels(params, &tree.levels);
    work.push(sum(params, groups_of(&work), word_of(sums.all())));
    // The areas of moving nodes are summed separately, as in all later refits.
    let moving = tree.moving.iter();
    work.extend(moving.flat_map(|moving| refit_moving(params, moving, sums)));
    work
}

fn refit_moving(mut params: Params, moving: &MovingShape, sums: Sums) -> Vec<Work> {
    params.listed = 1;
    let mut work = refit_levels(params, &moving.levels);
    work.push(sum(params, groups_of(&work), word_of(sums.moving())));
    work
}

/// Returns one dispatch per level, the last level first.
fn refit_levels(mut params: Params, levels: &[Range<u32>]) -> Vec<Work> {
    params.first_group = 0;
    let level = |level| {
        let work = over(common("refit"), params, level);
        params.first_group += groups_of_one(&work);
        work
    };
    levels.iter().rev().map(level).collect()
}

fn groups_of_one(work: &Work) -> u32 {
    work.params.count.div_ceil(work.kernel.workgroup[0])
}

/// Returns the number of workgroups of all levels.
fn groups_of(levels: &[Work]) -> u32 {
    let last = levels.last();
    last.map_or(0, |work| work.params.first_group + groups_of_one(work))
}

/// Converts the offset of a member of [`crate::Counts`] from bytes to words.
pub(crate) fn word_of(member: usize) -> u32 {
    (member / size_of::<u32>()) as u32
}

/// Returns the dispatch that sums the partial sums of `groups` workgroups into a word of [`crate::Counts`].
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
    fn a_tree_is_done_whole_first_and_then_what_moves() {
        let tree = Shape {
            leaf_count: 501,
            levels: vec![0..1, 1..3, 3..200, 200..500],
            moving: Some(MovingShape {
                leaves: 2_000..2_009,
                inner: 2_009..2_151,
                levels: vec![2_009..2_010, 2_010..2_011, 2_011..2_149, 2_149..2_151],
                degenerate_elsewhere: 3,
            }),
            ..Shape::none(Layout::Bvh2)
        };
        let (mut progress, params) = (Progress::default(), Params::default());
        let (work, uncounted) = progress.preprocess(Method::default(), params, &tree);
        assert_eq!(uncounted, 0);
        let expected = [
            ("expand", 0, 0, 0, 0),
            ("mark_moving", 2_009, 142, 0, 0),
            ("preprocess", 0, 501, 0, 0),
        ];
        assert_eq!(told(&work), expected);
        progress.preprocessed(&tree);
        let (work, uncounted) = progress.preprocess(Method::default(), params, &tree);
        assert_eq!(uncounted, 3);
        assert_eq!(told(&work), [("preprocess", 2_000, 9, 0, 1)]);
        let (work, extent) = progress.refit(Method::default(), params, &tree);
        assert_eq!(extent, Extent::Whole);
        let after = told(&work[5..]);
        progress.refitted();
        let (work, extent) = progress.refit(Method::default(), params, &tree);
        assert_eq!(extent, Extent::Moving);
        assert_eq!(told(&work), after);
        let expected = [
            ("refit", 2_149, 2, 0, 1),
            ("refit", 2_011, 138, 1, 1),
            ("refit", 2_010, 1, 3, 1),
            ("refit", 2_009, 1, 4, 1),
            ("sum_costs", 6, 5, 0, 1),
        ];
        assert_eq!(told(&work), expected);
    }

    #[test]
    fn treelets_are_done_whole_first_and_then_where_anything_moves() {
        let method = Method {
            layout: Layout::Fast,
            ..Method::default()
        };
        let tree = Shape {
            leaf_count: 20_000,
            treelets: vec![0..90, 90..93, 93..94],
            moving: Some(MovingShape {
                levels: vec![500..507, 507..508, 508..509],
                degenerate_elsewhere: 4,
                ..MovingShape::default()
            }),
            ..Shape::none(Layout::Fast)
        };
        let (mut progress, params) = (Progress::default(), Params::default());
        let (work, uncounted) = progress.preprocess(method, params, &tree);
        let whole = vec![
            ("gather_corners", 0, 60_000, 94, 0),
            ("preprocess_treelets_of_keys", 0, 90, 94, 0),
        ];
        assert_eq!((told(&work), uncounted), (whole, 0));
        assert_eq!(beside(&work), [true, false]);
        assert_eq!(work[1].params.destination, 4);
        progress.preprocessed(&tree);
        let (work, extent) = progress.refit(method, params, &tree);
        assert!(work.is_empty() && extent == Extent::Whole);
        progress.submitted();
        let (work, uncounted) = progress.preprocess(method, params, &tree);
        let listed = vec![("preprocess_treelets_of_keys", 500, 7, 94, 1)];
        assert_eq!((told(&work), uncounted), (listed, 4));
        assert_eq!(beside(&work), [true]);
        assert_eq!(work[0].params.destination, 4);
        let (work, _) = progress.refit(method, params, &tree);
        let whole = [
            ("refit_treelets", 90, 3, 0, 0),
            ("refit_treelets", 93, 1, 94, 0),
        ];
        assert_eq!(told(&work), whole);
        progress.refitted();
        let (work, _) = progress.refit(method, params, &tree);
        let listed = [
            ("refit_treelets", 507, 1, 0, 1),
            ("refit_treelets", 508, 1, 94, 1),
        ];
        assert_eq!(told(&work), listed);
    }
}
