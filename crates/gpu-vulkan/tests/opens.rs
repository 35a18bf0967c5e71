//! A device opens only if its arithmetic can be trusted.

use backend::BackendError;
use gpu_vulkan::{Options, Validation, VulkanBackend, adapters};

#[test]
fn opening_passes_the_self_test_without_a_word_from_validation_or_says_why_not() {
    let options = Options {
        validation: Validation::IfInstalled,
        ..Options::default()
    };
    match VulkanBackend::new(&options) {
        Ok(b) => assert_eq!(b.validation_messages(), Vec::<String>::new()),
        Err(e) => assert!(matches!(e, BackendError::NoDevice(_)), "{e}"),
    }
}

#[test]
fn required_validation_is_there_or_its_absence_is_named() {
    let options = Options {
        validation: Validation::Required,
        ..Options::default()
    };
    match VulkanBackend::new(&options) {
        Ok(b) => assert!(b.is_validated()),
        Err(e) => assert!(matches!(e, BackendError::NoDevice(_)), "{e}"),
    }
    if let Ok(b) = VulkanBackend::new(&Options::default()) {
        assert!(!b.is_validated());
    }
}

#[test]
fn every_adapter_tells_its_limits() {
    for adapter in adapters().unwrap_or_default() {
        let value = |name| {
            let found = adapter.limits.iter().find(|(n, _)| *n == name);
            found.map(|(_, value)| value.as_str())
        };
        for name in [
            "max workgroup size",
            "timestamp period ns",
            "transfer queues",
        ] {
            assert!(value(name).is_some_and(|v| !v.is_empty()), "{name}");
        }
        let range: u64 = value("max storage buffer bytes").unwrap().parse().unwrap();
        assert!(adapter.max_buffer_bytes <= range && !adapter.name.is_empty());
    }
}
