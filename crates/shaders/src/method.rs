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
/// [`BackendError::Unsupported`] with the intersector.
pub fn check_method(backend: &'static str, method: Method) -> Result<()> {
    let what = if method.intersector != Intersector::Watertight {
        format!("intersector '{}'", method.intersector)
    } else {
        return Ok(());
    };
    Err(BackendError::Unsupported { backend, what })
}

/// Refuses, in the name of `backend`, to make trees on the device for what needs treelets.
///
/// # Errors
/// [`BackendError::Unsupported`] with the layout.
pub fn check_rebuild(backend: &'static str, method: Method) -> Result<()> {
    match method.layout {
        Layout::Bvh2 => Ok(()),
        Layout::Fast => {
            let what = format!("trees made on the device with layout '{}'", method.layout);
            Err(BackendError::Unsupported { backend, what })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_supported_with_both_layouts_or_refused_by_name() {
        for layout in Layout::ALL {
            assert!(supports(Method {
                layout,
                ..Method::default()
            }));
        }
        let fast = Method {
            layout: Layout::Fast,
            ..Method::default()
        };
        let refused = check_rebuild("wgpu", fast).unwrap_err().to_string();
        assert!(refused.contains("'fast'"));
        assert_eq!(check_rebuild("wgpu", Method::default()), Ok(()));
        let woop = Method {
            intersector: Intersector::Woop,
            ..Method::default()
        };
        assert!(!supports(woop));
        let refused = check_method("wgpu", woop).unwrap_err().to_string();
        assert!(refused.contains("'woop'"));
    }
}
