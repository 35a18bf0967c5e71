//! What was asked of wgpu: the measure of its overhead that is the same on every machine.

/// Calls to wgpu since the backend was opened.
///
/// A steady frame makes no buffer and no bind group, uploads one page of
/// parameters (64 dispatches; rays given one by one are a second upload), and
/// is one submission. It has a pass for geometry and one for rays (one a stage
/// where passes take no timestamps between dispatches), and one dispatch a kernel but
/// for refit, which has one a level (of treelets, with layout `fast`) and one for the tree's cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CallCounts {
    /// Buffers made.
    pub buffers: u64,
    /// Bind groups made.
    pub bind_groups: u64,
    /// Writes to buffers through the queue; wgpu takes a staging buffer for each.
    pub uploads: u64,
    /// Compute passes recorded.
    pub passes: u64,
    /// Dispatches recorded.
    pub dispatches: u64,
    /// Submissions to the queue.
    pub submissions: u64,
}

impl std::ops::Sub for CallCounts {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        Self {
            buffers: self.buffers - before.buffers,
            bind_groups: self.bind_groups - before.bind_groups,
            uploads: self.uploads - before.uploads,
            passes: self.passes - before.passes,
            dispatches: self.dispatches - before.dispatches,
            submissions: self.submissions - before.submissions,
        }
    }
}
