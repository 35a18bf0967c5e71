//! Work of one submission, as data that a device executes.

use crate::Stage;
use backend::Ticket;
use shaders::work::Work;
use std::ops::Range;
use std::sync::Arc;

/// The commands of one submission, with the buffers that they use.
///
/// `P` is a compiled kernel, `B` refers to a buffer, and `N` is a command that only one type of device can execute.
/// The device sets all counts to 0 before the first command.
pub struct Recording<P, B, N> {
    /// Commands in order.
    pub commands: Vec<RecordedCommand<P, N>>,
    /// Buffers of all dispatches. See [`Dispatch::buffers`].
    pub buffers: Vec<BoundBuffer<B>>,
    /// Positions to copy to the host. The copy waits only for the commands before [`RecordedCommand::Split`].
    pub positions: Option<PositionsCopy<B>>,
    /// Number of the upload that must have finished before the commands run; 0 for no upload.
    pub after_upload: u64,
    /// Submission whose copy of positions reads a buffer that the commands overwrite. They wait for the copy.
    pub overwrites: Option<Ticket>,
}

/// A copy of positions to the host.
#[derive(Clone, Copy, Debug)]
pub struct PositionsCopy<B> {
    /// Buffer of the positions.
    pub from: B,
    /// Number of bytes, from the beginning of the buffer.
    pub bytes: u64,
}

/// A command of a [`Recording`].
#[expect(
    clippy::large_enum_variant,
    reason = "nearly all commands are dispatches"
)]
pub enum RecordedCommand<P, N> {
    /// Runs a kernel.
    Dispatch(Dispatch<P>),
    /// Ends a stage. The commands since the previous end are timed as this stage.
    EndStage(Stage),
    /// Sets this number of bytes at the beginning of the counts to 0.
    ClearCounts(u64),
    /// Ends the part that the copy of positions waits for. Only for devices with [`crate::DeviceInfo::splits`].
    Split,
    /// A command that only this type of device can execute.
    Native(N),
}

/// One run of a kernel. It starts when the previous commands have finished, unless [`Work::alongside`] is set.
pub struct Dispatch<P> {
    /// Kernel and parameters.
    pub work: Work,
    /// The compiled kernel.
    pub pipeline: Arc<P>,
    /// Range of [`Recording::buffers`]: one for each binding of the kernel, in order.
    pub buffers: Range<usize>,
    /// Number of workgroups along both axes.
    pub groups: [u32; 2],
}

impl<P, B, N> Default for Recording<P, B, N> {
    fn default() -> Self {
        Self {
            commands: Vec::new(),
            buffers: Vec::new(),
            positions: None,
            after_upload: 0,
            overwrites: None,
        }
    }
}

impl<P, B, N> Recording<P, B, N> {
    /// Removes all commands and buffers. The vectors keep their capacity.
    pub(crate) fn clear(&mut self) {
        self.commands.clear();
        self.buffers.clear();
        (self.positions, self.after_upload, self.overwrites) = (None, 0, None);
    }

    /// Returns the buffers of a dispatch: one for each binding of the kernel, in order.
    pub fn buffers_of(&self, dispatch: &Dispatch<P>) -> &[BoundBuffer<B>] {
        &self.buffers[dispatch.buffers.clone()]
    }
}

/// The buffer of a binding. The device owns the parameters and the counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundBuffer<B> {
    /// The parameters of the dispatch.
    Params,
    /// The counts of the submission, or of one of its traces. See [`Work::trace_index`].
    Counts,
    /// A buffer of the recording.
    Recorded(B),
}
