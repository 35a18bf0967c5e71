//! SPIR-V whose arithmetic no driver may fuse, whose whole numbers are wide, and whose stacks no driver need clear.

use anyhow::{Result, anyhow};
use rspirv::binary::Assemble;
use rspirv::dr::{Function, Instruction, Module, Operand, load_words};
use rspirv::spirv::{Decoration, Op};
use std::collections::HashSet;

pub(crate) fn harden(words: &[u32]) -> Result<Vec<u32>> {
    let mut module = load_words(words).map_err(|e| anyhow!("{e}"))?;
    crate::wide::widen(&mut module)?;
    harden_module(&mut module);
    Ok(module.assemble())
}

pub(crate) fn harden_module(module: &mut Module) {
    forbid_contraction(module);
    drop_null_initialisers(module);
    module.debug_names.clear();
}

/// naga emits no NoContraction; without it both known drivers fuse and regroup.
/// Functions named `loose_…` decide nothing and may be fused.
fn forbid_contraction(module: &mut Module) {
    let loose = loose_functions(module);
    let is_strict = |f: &&Function| !f.def_id().is_some_and(|id| loose.contains(&id));
    let decorations: Vec<_> = module
        .functions
        .iter()
        .filter(is_strict)
        .flat_map(Function::all_inst_iter)
        .filter(|i| matches!(i.class.opcode, Op::FAdd | Op::FSub | Op::FMul))
        .filter_map(|i| i.result_id)
        .map(|id| {
            let operands = vec![
                Operand::IdRef(id),
                Operand::Decoration(Decoration::NoContraction),
            ];
            Instruction::new(Op::Decorate, None, None, operands)
        })
        .collect();
    module.annotations.extend(decorations);
}

fn loose_functions(module: &Module) -> HashSet<u32> {
    let named = module
        .debug_names
        .iter()
        .filter(|i| i.class.opcode == Op::Name);
    let loose = named.filter_map(|i| match &i.operands[..] {
        [Operand::IdRef(id), Operand::LiteralString(name)] => {
            name.starts_with("loose_").then_some(*id)
        }
        _ => None,
    });
    loose.collect()
}

/// naga clears every variable; stacks and the room for whole numbers need none of it.
fn drop_null_initialisers(module: &mut Module) {
    let nulls: HashSet<u32> = module
        .types_global_values
        .iter()
        .filter(|i| i.class.opcode == Op::ConstantNull)
        .filter_map(|i| i.result_id)
        .collect();
    let arrays: HashSet<u32> = module
        .types_global_values
        .iter()
        .filter(|i| i.class.opcode == Op::TypePointer)
        .filter(|i| points_to_array(module, i))
        .filter_map(|i| i.result_id)
        .collect();
    let blocks = module.functions.iter_mut().flat_map(|f| &mut f.blocks);
    let inside = blocks.flat_map(|b| &mut b.instructions);
    for i in inside.chain(&mut module.types_global_values) {
        let stack =
            i.class.opcode == Op::Variable && i.result_type.is_some_and(|t| arrays.contains(&t));
        let cleared = matches!(i.operands.get(1), Some(Operand::IdRef(id)) if nulls.contains(id));
        if stack && cleared {
            i.operands.truncate(1);
        }
    }
}

fn points_to_array(module: &Module, pointer: &Instruction) -> bool {
    let Some(Operand::IdRef(pointee)) = pointer.operands.get(1) else {
        return false;
    };
    module
        .types_global_values
        .iter()
        .any(|i| i.result_id == Some(*pointee) && i.class.opcode == Op::TypeArray)
}
