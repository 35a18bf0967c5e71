//! Errors of backends.

/// Errors of a [`Backend`](crate::Backend). Calls in a wrong order or with an unknown ticket panic instead.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BackendError {
    /// There is no device, or the chosen device cannot run the backend.
    #[error("no device: {0}")]
    NoDevice(String),
    /// The backend does not support the operation.
    #[error("{backend} does not support {what}")]
    Unsupported {
        /// Name of the backend.
        backend: &'static str,
        /// The unsupported operation.
        what: String,
    },
    /// A key frame cannot be read.
    #[error(transparent)]
    KeyFrame(#[from] geom::KeyFrameError),
    /// The tree does not contain exactly the scene's live triangles.
    #[error("the tree does not fit the scene: {0}")]
    WrongTree(String),
    /// The operation exceeds a limit of the device.
    #[error("{what} needs {need}, the limit is {limit}")]
    Limit {
        /// What exceeds the limit: for example a buffer, a kernel or the rays of a query.
        what: String,
        /// Required amount.
        need: u64,
        /// Maximum amount.
        limit: u64,
    },
    /// Memory of the device or the host is exhausted.
    #[error("out of memory: {what}{}", need(*bytes))]
    OutOfMemory {
        /// The object that could not be created.
        what: String,
        /// Required bytes; 0 if only the driver knows.
        bytes: u64,
    },
    /// The calling program misused a resource that it shares with the library. For example, it dropped the command
    /// buffer into which the library had recorded a frame.
    #[error("{0}")]
    Misuse(String),
    /// The graphics API or the driver rejected a call. This indicates a bug in the library or in the driver.
    #[error("{what} was rejected: {why}")]
    Rejected {
        /// The operation that failed.
        what: String,
        /// Message of the graphics API or the driver.
        why: String,
    },
    /// The device was lost.
    #[error("the device was lost: {0}")]
    DeviceLost(String),
}

impl BackendError {
    /// Returns the error of a query with [`Rays::OnDevice`](crate::Rays::OnDevice) on a backend that received no
    /// buffers for it, or too small ones.
    pub fn no_rays_on_device(backend: &'static str) -> Self {
        Self::unsupported(backend, "rays in device memory")
    }

    /// Returns whether memory is lacking, or a size exceeds a limit of the device. A smaller request may succeed.
    #[must_use]
    pub fn is_too_large(&self) -> bool {
        matches!(self, Self::OutOfMemory { .. } | Self::Limit { .. })
    }

    /// Returns the error of a backend that builds no trees on the device.
    pub fn no_device_trees(backend: &'static str) -> Self {
        Self::unsupported(backend, "tree builds on the device")
    }

    /// Returns [`BackendError::Unsupported`] for this backend.
    pub fn unsupported(backend: &'static str, what: impl Into<String>) -> Self {
        let what = what.into();
        Self::Unsupported { backend, what }
    }

    /// Returns [`BackendError::Rejected`] with this reason.
    pub fn rejected(what: impl Into<String>, why: impl Into<String>) -> Self {
        let (what, why) = (what.into(), why.into());
        Self::Rejected { what, why }
    }
}

fn need(bytes: u64) -> String {
    match bytes {
        0 => String::new(),
        bytes => format!(" needs {bytes} bytes"),
    }
}

/// A `Result` with [`BackendError`].
pub type Result<T> = std::result::Result<T, BackendError>;
