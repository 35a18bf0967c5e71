//! Work of one submission, as data that a device executes.

use crate::Stage;
use backend::Ticket;
use shaders::work::Work;
use shaders::{Binding, BufferName};
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
    pub buffers: Vec<B>,
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
    /// Range of [`Recording::buffers`]: one for each binding of the kernel, in order, except parameters and counts.
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

    /// Returns the buffers of a dispatch, except parameters and counts, which the device owns.
    pub fn buffers_of(&self, dispatch: &Dispatch<P>) -> &[B] {
        &self.buffers[dispatch.buffers.clone()]
    }

    /// Returns each binding of a dispatch with its buffer.
    pub fn bindings_of<'a>(
        &'a self,
        dispatch: &'a Dispatch<P>,
    ) -> impl Iterator<Item = (&'static Binding, BoundBuffer<&'a B>)> + Clone {
        let mut buffers = self.buffers_of(dispatch).iter();
        dispatch.work.kernel.bindings.iter().map(move |binding| {
            let bound = match binding.name {
                BufferName::Params => BoundBuffer::Params,
                BufferName::Counts => BoundBuffer::Counts,
                _ => BoundBuffer::Recorded(buffers.next().expect("one buffer for each binding")),
            };
            (binding, bound)
        })
    }
}

/// Returns whether the device owns the buffer of this name, so that recordings do not contain it.
pub(crate) fn is_owned_by_device(name: BufferName) -> bool {
    matches!(name, BufferName::Params | BufferName::Counts)
}

/// The buffer of a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundBuffer<B> {
    /// The parameters of the dispatch.
    Params,
    /// The counts of the submission, or of one of its traces. See [`Work::trace_index`].
    Counts,
    /// A buffer of the recording.
    Recorded(B),
}
