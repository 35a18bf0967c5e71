//! A device opens only if its arithmetic can be trusted.

use backend::BackendError;
use gpu_vulkan::{Options, VulkanBackend};

#[test]
fn opening_passes_the_self_test_without_a_word_from_validation_or_says_why_not() {
    let options = Options {
        validation: true,
        ..Options::default()
    };
    match VulkanBackend::new(&options) {
        Ok(b) => assert_eq!(b.validation_messages(), Vec::<String>::new()),
        Err(e) => assert!(matches!(e, BackendError::NoDevice(_)), "{e}"),
    }
}
