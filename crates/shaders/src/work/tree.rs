//! The stages that follow a tree: records, and boxes level by level.

use super::{Groups, Work, treelets};
use crate::{Params, Shape, common, kernel};
use backend::{Layout, Method};
use std::mem::offset_of;
use std::ops::Range;

/// Which parts of the tree in use stand on the device since it was adopted.
///
/// With layout `fast`, what comes first goes over all of the tree; what comes later, over what moves, if the tree came with
/// lists of it. The host says when work was recorded, and starts anew with each tree, or when recorded work came to nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    has_records: bool,
    has_boxes: bool,
    /// Whether `preprocess` made all boxes in this recording.
    has_climbed: bool,
}

impl Progress {
    /// Positions to records and boxes of leaves, after the tree's lists of nodes if need be; with layout `fast`, after the
    /// leaves' vertices, also to boxes of all nodes in treelets of triangles. Also for [`crate::Extents::uncounted`] how
    /// many triangles of zero area it passes over. Of a small tree with layout `fast` it reads key frames, the later
    /// weighing [`Params::alpha`], and no positions, so that it may run beside `interpolate`.
    pub fn preprocess(&self, method: Method, params: Params, tree: &Shape) -> (Vec<Work>, u32) {
        if tree.layout == Layout::Fast {
            let adopt = (!self.has_records).then(|| treelets::adopt(method, params, tree));
            let (work, uncounted) = treelets::preprocess(method, params, tree, self.has_records);
            let mut work: Vec<_> = adopt.into_iter().chain([work]).collect();
            work[0].alongside = treelets::reads_keys(tree);
            return (work, uncounted);
        }
        // The tree's lists of nodes.
        let nodes = Groups::Linear(params.node_count);
        let expand = (!self.has_records).then(|| Work::new(common("expand"), params, nodes));
        let leaves = leaves(method, params, tree);
        (expand.into_iter().chain([leaves]).collect(), 0)
    }

    /// That work was recorded, over such a tree.
    pub fn preprocessed(&mut self, tree: &Shape) {
        self.has_climbed = tree.layout == Layout::Fast && treelets::climbs(tree);
        self.has_records = true;
    }

    /// Boxes of leaves to boxes of inner nodes, level by level, and to the tree's cost; nothing where `preprocess` has done so.
    pub fn refit(&self, method: Method, params: Params, tree: &Shape) -> Vec<Work> {
        if self.has_climbed || tree.leaf_count == 0 {
            return Vec::new();
        }
        match tree.layout {
            Layout::Fast => treelets::refit(method, params, tree, self.has_boxes),
            Layout::Bvh2 => refit_levels(params, &tree.levels),
        }
    }

    /// That work was recorded.
    pub fn refitted(&mut self) {
        self.has_boxes = true;
    }

    /// That the recording was submitted: what comes next is counted anew.
    pub fn submitted(&mut self) {
        self.has_climbed = false;
    }
}

/// Positions to records and boxes of all leaves.
pub fn leaves(method: Method, params: Params, tree: &Shape) -> Work {
    Work::linear(kernel("preprocess", method), params, tree.leaf_count)
}

/// One dispatch a level, the last one first, and the sum of what their workgroups found.
fn refit_levels(mut params: Params, levels: &[Range<u32>]) -> Vec<Work> {
    let kernel = common("refit");
    params.first_group = 0;
    let mut work = Vec::with_capacity(levels.len() + 1);
    for level in levels.iter().rev() {
        params.first = level.start;
        work.push(Work::linear(kernel, params, level.len() as u32));
        params.first_group += (level.len() as u32).div_ceil(kernel.workgroup[0]);
    }
    work.push(sum(params, params.first_group, AREAS));
    work
}

pub(super) const AREAS: usize = offset_of!(crate::Counts, areas);

/// Where a member of [`crate::Counts`] lies, in words.
pub(super) fn word_of(member: usize) -> u32 {
    (member / size_of::<u32>()) as u32
}

/// Adds up the sums of so many workgroups, into a member of [`crate::Counts`].
pub(crate) fn sum(mut params: Params, groups: u32, member: usize) -> Work {
    (params.count, params.first) = (groups, word_of(member));
    Work::new(common("sum_costs"), params, Groups::Linear(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MovingShape;

    /// Kernel, first element, count, workgroups that it is told of, whether listed.
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
    fn all_is_done_every_time_level_by_level() {
        let tree = Shape {
            leaf_count: 501,
            levels: vec![0..1, 1..3, 3..200, 200..500],
            ..Shape::none(Layout::Bvh2)
        };
        let (mut progress, params) = (Progress::default(), Params::default());
        let (work, uncounted) = progress.preprocess(Method::default(), params, &tree);
        let expected = vec![("expand", 0, 0, 0, 0), ("preprocess", 0, 501, 0, 0)];
        assert_eq!((told(&work), uncounted), (expected, 0));
        progress.preprocessed(&tree);
        let (work, uncounted) = progress.preprocess(Method::default(), params, &tree);
        let expected = vec![("preprocess", 0, 501, 0, 0)];
        assert_eq!((told(&work), uncounted), (expected, 0));
        let expected = [
            ("refit", 200, 300, 0, 0),
            ("refit", 3, 197, 3, 0),
            ("refit", 1, 2, 5, 0),
            ("refit", 0, 1, 6, 0),
            ("sum_costs", 4, 7, 7, 0),
        ];
        for _ in 0..2 {
            let work = progress.refit(Method::default(), params, &tree);
            assert_eq!(told(&work), expected);
            progress.refitted();
        }
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
        assert!(progress.refit(method, params, &tree).is_empty());
        progress.submitted();
        let (work, uncounted) = progress.preprocess(method, params, &tree);
        let listed = vec![("preprocess_treelets_of_keys", 500, 7, 94, 1)];
        assert_eq!((told(&work), uncounted), (listed, 4));
        assert_eq!(beside(&work), [true]);
        assert_eq!(work[0].params.destination, 4);
        let work = progress.refit(method, params, &tree);
        let whole = [
            ("refit_treelets", 90, 3, 0, 0),
            ("refit_treelets", 93, 1, 94, 0),
        ];
        assert_eq!(told(&work), whole);
        progress.refitted();
        let work = progress.refit(method, params, &tree);
        let listed = [
            ("refit_treelets", 507, 1, 0, 1),
            ("refit_treelets", 508, 1, 94, 1),
        ];
        assert_eq!(told(&work), listed);
    }
}
