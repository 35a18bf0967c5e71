//! Properties of all kernels: the number of variants, the operations that a driver may fuse, and names.

use shaders::{Code, KERNELS, Kernel, MODULE};
use spirv::{Decoration, Op};
use std::collections::{BTreeMap, HashSet};
use std::iter;

const MOST_VARIANTS: usize = 85;
const MOST_CODES: usize = 127;

/// Returns the code of a kernel without fused multiply-adds, and the code with them, if the kernel has it.
fn codes(kernel: &'static Kernel) -> impl Iterator<Item = Code> {
    [Some(kernel.code), kernel.fused].into_iter().flatten()
}

#[test]
fn variant_count_is_bounded() {
    let (variants, compiled) = (KERNELS.len(), KERNELS.iter().flat_map(codes).count());
    assert!(variants <= MOST_VARIANTS, "{variants} variants");
    assert!(compiled <= MOST_CODES, "{compiled} compiled kernels");
}

#[test]
fn variants_are_distinct() {
    let mut known = BTreeMap::new();
    for kernel in KERNELS {
        for code in codes(kernel) {
            let other = known.insert(code.wgsl, kernel.name);
            assert_eq!(other, None, "{}", kernel.name);
        }
    }
}

/// Functions whose operations a driver may fuse, each with its number of FAdd, FSub and FMul. Products of a vector and
/// a scalar do not count. The number includes unlisted `loose_` functions that are always compiled with the function.
const LOOSE: [(&str, usize); 13] = [
    // geometry/ray.wgsl: two products and two sums of vectors.
    ("fn loose_planes(", 4),
    // geometry/ray.wgsl: differences from the origin, the padding, and two products and two sums of vectors.
    ("fn loose_planes_own_padding(", 7),
    // intersect/sheared.wgsl: a sum and two products.
    ("fn loose_own_pad(", 3),
    // intersect/sheared.wgsl.
    ("fn loose_within(", 7),
    // intersect/filter.wgsl.
    ("fn loose_error_bound(", 29),
    // visibility/project.wgsl.
    ("fn loose_line(", 18),
    ("fn loose_lines(", 19),
    // visibility/outline.wgsl.
    ("fn loose_pixel_span(", 2),
    ("fn loose_project(", 7),
    ("fn loose_first_pixel(", 2),
    ("fn loose_last_pixel(", 3),
    ("fn loose_edges(", 21),
    ("fn loose_tile_mask(", 1),
];

/// Returns the instructions of a module, each with the words after its first.
fn instructions(module: &[u32]) -> impl Iterator<Item = (Op, &[u32])> {
    let mut rest = &module[5..];
    iter::from_fn(move || {
        let first = *rest.first()?;
        let words = rest.split_off(..(first >> 16) as usize)?;
        let code = Op::from_u32(first & 0xffff);
        Some((code.expect("an instruction"), &words[1..]))
    })
}

/// Returns the number of FAdd, FSub and FMul that are not decorated NoContraction.
fn loose_operations(module: &[u32]) -> usize {
    let is_strict =
        |op: Op, words: &[u32]| op == Op::Decorate && words[1] == Decoration::NoContraction as u32;
    let strict = instructions(module).filter(|(op, words)| is_strict(*op, words));
    let strict: HashSet<u32> = strict.map(|(_, words)| words[0]).collect();
    instructions(module)
        .filter(|(op, _)| matches!(op, Op::FAdd | Op::FSub | Op::FMul))
        .filter(|(_, words)| !strict.contains(&words[1]))
        .count()
}

#[test]
fn only_expected_operations_may_be_fused() {
    for (kernel, code) in KERNELS.iter().flat_map(|k| codes(k).map(move |c| (k, c))) {
        let used = LOOSE.iter().filter(|(f, _)| code.wgsl.contains(f));
        let expected: usize = used.map(|(_, operations)| operations).sum();
        let module: Vec<u32> = bytemuck::pod_collect_to_vec(code.spirv);
        assert_eq!(loose_operations(&module), expected, "{}", kernel.name);
        let mut all = instructions(&module);
        let is_named = all.any(|(op, _)| matches!(op, Op::Name | Op::MemberName));
        assert!(!is_named, "{}", kernel.name);
    }
}

#[test]
fn word_products_take_one_instruction() {
    for kernel in KERNELS {
        let module: Vec<u32> = bytemuck::pod_collect_to_vec(kernel.code.spirv);
        let products = instructions(&module);
        let products = products.filter(|(op, _)| *op == Op::UMulExtended);
        let has = kernel.code.wgsl.contains("fn multiply_32(");
        assert_eq!(products.count(), usize::from(has), "{}", kernel.name);
    }
}

/// A program's own shaders declare other names next to those of the module.
#[test]
fn module_names_have_a_prefix() {
    let module = naga::front::wgsl::parse_str(MODULE).unwrap();
    let functions = module.functions.iter().map(|(_, f)| &f.name);
    let types = module.types.iter().map(|(_, t)| &t.name);
    let variables = module.global_variables.iter().map(|(_, v)| &v.name);
    let constants = module.constants.iter().map(|(_, c)| &c.name);
    let names = functions.chain(types).chain(variables).chain(constants);
    let names: Vec<&str> = names.filter_map(|name| name.as_deref()).collect();
    let kept = ["AbvhHit", "ABVH_MISS", "ABVH_EXTREME"];
    for name in &names {
        assert!(name.starts_with("abvh_") || kept.contains(name), "{name}");
    }
    for name in kept.iter().chain(&["abvh_closest", "abvh_any"]) {
        assert!(names.contains(name), "{name}");
    }
}
