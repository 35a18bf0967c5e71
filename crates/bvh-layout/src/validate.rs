//! Every property a record must have.

/// What is wrong with a record.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The words end before the record does, or go on after it.
    #[error("the record has {found} words, its header asks for {expected}")]
    Length {
        /// Words there are.
        found: usize,
        /// Words there should be.
        expected: usize,
    },
}

pub(crate) fn validate(_words: &[u32]) -> Result<(), RecordError> {
    unimplemented!()
}
