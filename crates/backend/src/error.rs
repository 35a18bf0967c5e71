//! What can go wrong on a device.

/// Failures that a correct caller cannot foresee. Misuse panics instead.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BackendError {
    /// Nothing on this machine can run the backend.
    #[error("no device: {0}")]
    NoDevice(String),
    /// The backend cannot do what was asked.
    #[error("{backend} does not support {what}")]
    Unsupported {
        /// Who was asked.
        backend: &'static str,
        /// For what.
        what: String,
    },
    /// A key frame cannot be read.
    #[error(transparent)]
    KeyFrame(#[from] geom::KeyFrameError),
    /// The tree does not hold exactly the scene's live triangles.
    #[error("the tree does not fit the scene: {0}")]
    WrongTree(String),
    /// A limit of the device stands in the way.
    #[error("{what} needs {need}, the limit is {limit}")]
    Limit {
        /// What was to be made.
        what: String,
        /// What it takes.
        need: u64,
        /// What there is.
        limit: u64,
    },
    /// The device's memory does not suffice.
    #[error("out of device memory: {what}{}", need(*bytes))]
    OutOfMemory {
        /// What was to be made.
        what: String,
        /// What it takes; 0 where only the driver knows.
        bytes: u64,
    },
    /// The caller broke a rule of the interface.
    #[error("{0}")]
    Misuse(String),
    /// The device's interface or its driver refused a call: a fault in the library or in the driver.
    #[error("{what} was rejected: {why}")]
    Rejected {
        /// What was being made or done.
        what: String,
        /// What it said.
        why: String,
    },
    /// The device went away.
    #[error("the device was lost: {0}")]
    DeviceLost(String),
}

impl BackendError {
    /// A backend was told of no rays on its device.
    pub fn no_rays_on_device(backend: &'static str) -> Self {
        Self::unsupported(backend, "rays that lie on the device")
    }

    /// [`BackendError::Unsupported`] by a backend of that name.
    pub fn unsupported(backend: &'static str, what: impl Into<String>) -> Self {
        let what = what.into();
        Self::Unsupported { backend, what }
    }

    /// [`BackendError::Rejected`] for that reason.
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

/// Shorthand.
pub type Result<T> = std::result::Result<T, BackendError>;
