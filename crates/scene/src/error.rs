//! What can be wrong with a scene.

use geom::AnimationError;
use std::fmt::Display;
use std::io;
use std::path::Path;

/// Why a scene cannot be opened: one clear line, which names the file and the place where there is one.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SceneError(pub(crate) String);

/// Where in a file something is wrong: a line counted from 1, or a byte or an item of a list counted from 0.
pub(crate) type Location = (&'static str, usize);

impl From<AnimationError> for SceneError {
    fn from(e: AnimationError) -> Self {
        Self(e.to_string())
    }
}

impl SceneError {
    /// What is at `place` cannot be used.
    pub(crate) fn unusable(place: impl Display, cause: impl Display) -> Self {
        Self(format!("{place}: {cause}"))
    }

    /// A file breaks its format's rules. Line breaks in `cause` become spaces.
    pub(crate) fn malformed(
        path: &Path,
        location: impl Into<Option<Location>>,
        cause: impl Display,
    ) -> Self {
        const LONGEST: usize = 240;
        let words = cause.to_string();
        let mut cause = words.split_whitespace().collect::<Vec<_>>().join(" ");
        if let Some((end, _)) = cause.char_indices().nth(LONGEST) {
            cause.truncate(end);
            cause.push('…');
        }
        let location = location.into().map(|(what, at)| format!("{what} {at}: "));
        Self::unusable(path.display(), location.unwrap_or_default() + &cause)
    }

    /// The system refused `path`.
    pub(crate) fn unreadable(path: &Path, source: io::Error) -> Self {
        let cause = match source.kind() {
            io::ErrorKind::NotFound => "no such file or directory".to_owned(),
            _ => format!("cannot read: {source}"),
        };
        Self::unusable(path.display(), cause)
    }
}
