//! How many variants there are, and that no two differ in nothing.
#![expect(
    clippy::print_stdout,
    reason = "the numbers are told to who asks for them"
)]

use shaders::{KERNELS, Kernel, RAY_KERNELS};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const MOST_VARIANTS: usize = 85;
const MOST_FORMS: usize = 133;

fn all() -> impl Iterator<Item = &'static Kernel> {
    KERNELS.iter().chain(RAY_KERNELS)
}

/// The texts of a kernel: with products of halves, and with fused products and sums.
fn texts(kernel: &'static Kernel) -> impl Iterator<Item = &'static str> {
    [Some(kernel.code), kernel.fused]
        .into_iter()
        .flatten()
        .map(|code| code.wgsl)
}

#[test]
fn there_are_no_more_variants_than_need_be() {
    let entries: BTreeSet<_> = all().map(|k| k.entry).collect();
    let forms: usize = all().map(|k| texts(k).count()).sum();
    let axes: BTreeSet<_> = all().flat_map(|k| k.slots).map(|(axis, _)| axis).collect();
    println!(
        "{} kernels, {} variants, {forms} compiled forms",
        entries.len(),
        all().count()
    );
    assert!(all().count() <= MOST_VARIANTS);
    assert!(forms <= MOST_FORMS);
    // The third axis is how a quotient's rest is found: `Kernel::fused`.
    assert_eq!(
        axes.into_iter().collect::<Vec<_>>(),
        [&"intersector", &"layout"]
    );
}

#[test]
fn no_two_variants_are_the_same() {
    let mut known = BTreeMap::new();
    for kernel in all() {
        for text in texts(kernel) {
            let other = known.insert(text, kernel.name);
            assert_eq!(other, None, "{}", kernel.name);
        }
    }
}

#[test]
fn files_are_few() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("wgsl");
    let folders = root.read_dir().unwrap().map(|f| f.unwrap().path());
    let files: usize = folders.map(|f| f.read_dir().unwrap().count()).sum();
    println!("{files} files");
    assert!(files <= 75);
}
