//! Changes SPIR-V so that drivers do not fuse arithmetic, one instruction multiplies two words to 64 bits, and arrays
//! are not cleared.

use anyhow::{Context, Result, anyhow, ensure};
use rspirv::binary::Assemble;
use rspirv::dr::{Block, Function, Instruction, Module, Operand, load_words};
use rspirv::spirv::{Decoration, Op};
use std::collections::HashSet;

pub(crate) fn harden(words: &[u32]) -> Result<Vec<u32>> {
    let mut module = load_words(words).map_err(|e| anyhow!("{e}"))?;
    widen(&mut module)?;
    harden_module(&mut module);
    Ok(module.assemble())
}

pub(crate) fn harden_module(module: &mut Module) {
    forbid_contraction(module);
    drop_null_initialisers(module);
    module.debug_names.clear();
}

/// Decorates each FAdd, FSub and FMul with NoContraction, which naga does not emit. Without it, drivers fuse and
/// regroup them. Functions named `loose_…` are exempt. Their results only decide whether work can be skipped, or are
/// compared with error bounds that hold with and without fusing.
fn forbid_contraction(module: &mut Module) {
    let loose: HashSet<u32> = named(module, |name| name.starts_with("loose_")).collect();
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

/// Returns the ids of all objects whose WGSL name matches.
fn named(module: &Module, is_it: impl Fn(&str) -> bool) -> impl Iterator<Item = u32> {
    let names = module.debug_names.iter();
    let names = names.filter(|i| i.class.opcode == Op::Name);
    names.filter_map(move |i| match &i.operands[..] {
        [Operand::IdRef(id), Operand::LiteralString(name)] => is_it(name).then_some(*id),
        _ => None,
    })
}

/// Removes the null initialisers of arrays. naga clears local and private variables, which stacks and long integers
/// do not need.
fn drop_null_initialisers(module: &mut Module) {
    let ids = |is_it: &dyn Fn(&Instruction) -> bool| -> HashSet<u32> {
        let found = module.types_global_values.iter().filter(|i| is_it(i));
        found.filter_map(|i| i.result_id).collect()
    };
    let nulls = ids(&|i| i.class.opcode == Op::ConstantNull);
    let arrays = ids(&|i| i.class.opcode == Op::TypeArray);
    let pointers = ids(&|i| i.class.opcode == Op::TypePointer && is_second(i, &arrays));
    let blocks = module.functions.iter_mut().flat_map(|f| &mut f.blocks);
    let inside = blocks.flat_map(|b| &mut b.instructions);
    for i in inside.chain(&mut module.types_global_values) {
        let points_to_array = i.result_type.is_some_and(|t| pointers.contains(&t));
        if i.class.opcode == Op::Variable && points_to_array && is_second(i, &nulls) {
            i.operands.truncate(1);
        }
    }
}

/// Returns whether the second operand is one of `ids`.
fn is_second(i: &Instruction, ids: &HashSet<u32>) -> bool {
    matches!(i.operands.get(1), Some(Operand::IdRef(id)) if ids.contains(id))
}

/// Name of the function that multiplies two words and returns two, the low word of the product first.
const MULTIPLY: &str = "multiply_32";

/// Replaces the body of `multiply_32` by one instruction, which WGSL cannot express. Sums with carry are not replaced:
/// `OpIAddCarry` gives some wrong results on the software driver of Mesa 22.3.
fn widen(module: &mut Module) -> Result<()> {
    let id = named(module, |name| name == MULTIPLY).next();
    let mut all = module.functions.iter();
    match all.position(|f| id.is_some() && f.def_id() == id) {
        Some(at) => replace(module, at).context(MULTIPLY),
        None => Ok(()),
    }
}

fn replace(module: &mut Module, at: usize) -> Result<()> {
    let header = module.header.as_mut().context("no header")?;
    let [pair_type, product, low, high, result_id] =
        std::array::from_fn(|i| header.bound + i as u32);
    header.bound += 5;
    let function = &mut module.functions[at];
    let parameters = &function.parameters;
    ensure!(parameters.len() == 2, "expected two parameters");
    let word = parameters[0].result_type.context("no type")?;
    let operands = parameters.iter().filter_map(|p| p.result_id);
    let operands = operands.map(Operand::IdRef).collect();
    let result = function.def.as_ref().and_then(|i| i.result_type);
    let result = result.context("no result")?;
    let make = |op, ty, id, operands| Instruction::new(op, Some(ty), Some(id), operands);
    let part = |id, number| {
        let operands = vec![Operand::IdRef(product), Operand::LiteralBit32(number)];
        make(Op::CompositeExtract, word, id, operands)
    };
    let parts = vec![Operand::IdRef(low), Operand::IdRef(high)];
    let back = vec![Operand::IdRef(result_id)];
    let block = Block {
        label: function.blocks.first().and_then(|b| b.label.clone()),
        instructions: vec![
            make(Op::UMulExtended, pair_type, product, operands),
            part(low, 0),
            part(high, 1),
            make(Op::CompositeConstruct, result, result_id, parts),
            Instruction::new(Op::ReturnValue, None, None, back),
        ],
    };
    function.blocks = vec![block];
    let words = vec![Operand::IdRef(word); 2];
    let pair_type = Instruction::new(Op::TypeStruct, None, Some(pair_type), words);
    module.types_global_values.push(pair_type);
    Ok(())
}
