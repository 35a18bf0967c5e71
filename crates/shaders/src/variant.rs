//! What fills a kernel's slots, by method: the host's half of `build/slots.rs`.

use backend::{Intersector, Method};

/// What fills `slot` in the kernels that serve `method`.
pub(crate) fn value(slot: &str, method: Method) -> &'static str {
    match (slot, method.intersector) {
        ("intersector", Intersector::MollerTrumbore) => "moller_trumbore",
        ("intersector", Intersector::Woop) => "woop",
        ("intersector", Intersector::Watertight) => "watertight",
        ("intersector", Intersector::Exact) => "exact",
        ("record", Intersector::Woop) => "rows",
        ("record", _) => "corners",
        ("layout" | "treelets", _) => method.layout.name(),
        (slot, _) => panic!("no slot is named {slot}"),
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
