//! Which operations of the SPIR-V a driver may fuse.

use rspirv::dr::{Module, Operand, load_words};
use rspirv::spirv::{Decoration, Op};
use shaders::{KERNELS, Kernel};
use std::collections::HashSet;

/// Functions that a driver may fuse, each with the additions, subtractions and multiplications of all that are used with it.
const LOOSE: [(&str, usize); 5] = [
    // geometry/ray.wgsl: two products and two sums of vectors.
    ("fn loose_planes(", 4),
    // intersect/sheared.wgsl.
    ("fn loose_within(", 7),
    // intersect/filter.wgsl.
    ("fn loose_doubt(", 29),
    // visibility/project.wgsl and the places of visibility/outline.wgsl.
    ("fn loose_pixel_span(", 46),
    // All of visibility/outline.wgsl.
    ("fn loose_stamp(", 36),
];

/// Additions, subtractions and multiplications that are not decorated NoContraction.
fn loose_operations(module: &Module) -> usize {
    let strict: HashSet<_> = module
        .annotations
        .iter()
        .filter(|i| i.operands.get(1) == Some(&Operand::Decoration(Decoration::NoContraction)))
        .map(|i| i.operands[0].clone())
        .collect();
    module
        .all_inst_iter()
        .filter(|i| matches!(i.class.opcode, Op::FAdd | Op::FSub | Op::FMul))
        .filter_map(|i| i.result_id)
        .filter(|&id| !strict.contains(&Operand::IdRef(id)))
        .count()
}

#[test]
fn only_what_decides_no_hit_may_be_fused_and_no_name_is_left() {
    let codes = |k: &'static Kernel| [Some(k.code), k.fused].into_iter().flatten();
    for (kernel, code) in KERNELS.iter().flat_map(|k| codes(k).map(move |c| (k, c))) {
        let module = load_words(code.spirv).unwrap();
        let used = LOOSE.iter().filter(|(f, _)| code.wgsl.contains(f));
        let expected: usize = used.map(|(_, operations)| operations).sum();
        assert_eq!(loose_operations(&module), expected, "{}", kernel.name);
        assert!(module.debug_names.is_empty(), "{}", kernel.name);
    }
}

#[test]
fn products_of_two_words_take_one_instruction() {
    for kernel in KERNELS {
        let module = load_words(kernel.code.spirv).unwrap();
        let products = module.all_inst_iter();
        let products = products.filter(|i| i.class.opcode == Op::UMulExtended);
        let has = kernel.code.wgsl.contains("fn multiply_32(");
        assert_eq!(products.count(), usize::from(has), "{}", kernel.name);
    }
}
