//! The variant of a kernel that a method takes: the host's half of `build/variants.rs`.

use backend::{Intersector, Method};

/// The value along `axis` of the kernels that serve `method`.
pub(crate) fn value(axis: &str, method: Method) -> &'static str {
    match (axis, method.intersector) {
        ("intersector", Intersector::MollerTrumbore) => "moller_trumbore",
        ("intersector", Intersector::Woop) => "woop",
        ("intersector", Intersector::Watertight) => "watertight",
        ("intersector", Intersector::Exact) => "exact",
        ("layout", _) => method.layout.name(),
        (axis, _) => panic!("no axis is named {axis}"),
    }
}

#[cfg(test)]
mod tests {
    use crate::{KERNELS, supports};
    use backend::{Intersector, Layout, Method};
    use std::collections::BTreeSet;

    #[test]
    fn every_supported_method_has_each_kernel_once() {
        let pairs = Intersector::ALL.map(|i| Layout::ALL.map(|l| (i, l)));
        for (intersector, layout) in pairs.into_iter().flatten() {
            let method = Method {
                intersector,
                layout,
            };
            let serving: Vec<_> = KERNELS.iter().filter(|k| k.serves(method)).collect();
            let entries: BTreeSet<_> = serving.iter().map(|k| k.entry).collect();
            if supports(method) {
                assert_eq!(serving.len(), entries.len(), "{method:?}");
                assert!(entries.contains("trace_rays") && entries.contains("preprocess"));
            }
        }
        let names: BTreeSet<_> = KERNELS.iter().map(|k| k.name).collect();
        assert_eq!(names.len(), KERNELS.len());
    }
}
