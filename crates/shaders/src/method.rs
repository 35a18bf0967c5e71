//! Which methods the kernels know.

use backend::{BackendError, Intersector, Layout, Method, Result};

/// Whether a scene can be loaded to be traced by `method`. Asks no device.
#[must_use]
pub fn supports(method: Method) -> bool {
    check_method("", method).is_ok()
}

/// Refuses, in the name of `backend`, what no kernel does.
///
/// # Errors
/// [`BackendError::Unsupported`] with the intersector or the layout.
pub fn check_method(backend: &'static str, method: Method) -> Result<()> {
    let what = if method.intersector != Intersector::Watertight {
        format!("intersector '{}'", method.intersector)
    } else if method.layout != Layout::Bvh2 {
        format!("layout '{}'", method.layout)
    } else {
        return Ok(());
    };
    Err(BackendError::Unsupported { backend, what })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_method_is_supported_and_the_others_are_refused_by_name() {
        assert!(supports(Method::default()));
        let woop = Method {
            intersector: Intersector::Woop,
            ..Method::default()
        };
        let fast = Method {
            layout: Layout::Fast,
            ..Method::default()
        };
        for (method, name) in [(woop, "'woop'"), (fast, "'fast'")] {
            assert!(!supports(method));
            let refused = check_method("wgpu", method).unwrap_err().to_string();
            assert!(refused.contains(name));
        }
    }
}
