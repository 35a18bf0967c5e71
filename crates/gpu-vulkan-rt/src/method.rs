//! Which methods a driver's tree is traced by: one, whatever it is that the driver does.

use backend::{BackendError, Method, Result};

/// Whether a driver's tree can be asked for `method`.
#[must_use]
pub fn driver_tree_supports(method: Method) -> bool {
    check("", method).is_ok()
}

/// Refuses, in the name of `backend`, all but the usual method.
///
/// # Errors
/// [`BackendError::Unsupported`] with the intersector or the layout.
pub(crate) fn check(backend: &'static str, method: Method) -> Result<()> {
    let usual = Method::default();
    let what = if method.intersector != usual.intersector {
        format!("intersector '{}'", method.intersector)
    } else if method.layout != usual.layout {
        format!("layout '{}'", method.layout)
    } else {
        return Ok(());
    };
    Err(BackendError::Unsupported { backend, what })
}
