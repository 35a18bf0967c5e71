//! Which operations of the SPIR-V a driver may fuse.

use rspirv::dr::{Module, Operand, load_words};
use rspirv::spirv::{Decoration, Op};
use shaders::{KERNELS, Kernel};
use std::collections::HashSet;

/// Additions, subtractions and multiplications in `loose_*` of wgsl/shared/ray.wgsl: two products and two sums of vectors.
const BOXES: usize = 4;
/// Likewise in wgsl/shared/own_box.wgsl.
const OWN_BOXES: usize = 7;
/// Likewise in wgsl/shared/view.wgsl and filter.wgsl.
const FILTER: usize = 29;
/// Likewise in wgsl/project.wgsl and wgsl/shared/places.wgsl.
const PROJECTION: usize = 46;
/// Likewise in wgsl/shared/places.wgsl and outline.wgsl.
const OUTLINES: usize = 36;

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
        let traces = kernel.bindings.iter().any(|b| b.name == "records")
            && kernel.bindings.iter().all(|b| b.name != "topology");
        let tests = |name| kernel.slots.contains(&("intersector", name));
        let own = if tests("watertight") || tests("exact") {
            OWN_BOXES
        } else {
            0
        };
        let filter = if tests("exact") { FILTER } else { 0 };
        let expected = match kernel.entry {
            "project" => PROJECTION,
            "cover_small" | "cover_large" => OUTLINES,
            _ if traces && !kernel.answers_extremes() => BOXES + own + filter,
            _ => 0,
        };
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
