//! Products of two words in one instruction, which WGSL cannot say. (Not sums that carry: what Mesa 22.3's software driver
//! makes of `OpIAddCarry` is wrong for some.)

use anyhow::{Context, Result};
use rspirv::dr::{Block, Function, Instruction, Module, Operand};
use rspirv::spirv::Op;

/// A function of two words that gives two, the low one of their product first.
const MULTIPLY: &str = "multiply_32";

/// Puts the instruction in place of what the function holds.
pub(crate) fn widen(module: &mut Module) -> Result<()> {
    match function(module, MULTIPLY) {
        Some(at) => replace(module, at).context(MULTIPLY),
        None => Ok(()),
    }
}

/// A function by its name in WGSL.
fn function(module: &Module, name: &str) -> Option<usize> {
    let named = |i: &&Instruction| {
        i.class.opcode == Op::Name
            && matches!(i.operands.get(1), Some(Operand::LiteralString(n)) if n == name)
    };
    let id = match module.debug_names.iter().find(named)?.operands.first()? {
        Operand::IdRef(id) => *id,
        _ => return None,
    };
    let mut all = module.functions.iter();
    all.position(|f| f.def_id() == Some(id))
}

fn replace(module: &mut Module, at: usize) -> Result<()> {
    let header = module.header.as_mut().context("a header")?;
    let [both, whole, low, high, pair] = std::array::from_fn(|i| header.bound + i as u32);
    header.bound += 5;
    let function = &mut module.functions[at];
    let (word, operands) = parameters(function)?;
    let result = function.def.as_ref().and_then(|i| i.result_type);
    let result = result.context("a result")?;
    let make = |op, ty, id, operands| Instruction::new(op, Some(ty), Some(id), operands);
    let part = |id, number| {
        let operands = vec![Operand::IdRef(whole), Operand::LiteralBit32(number)];
        make(Op::CompositeExtract, word, id, operands)
    };
    let parts = vec![Operand::IdRef(low), Operand::IdRef(high)];
    let back = vec![Operand::IdRef(pair)];
    let block = Block {
        label: function.blocks.first().and_then(|b| b.label.clone()),
        instructions: vec![
            make(Op::UMulExtended, both, whole, operands),
            part(low, 0),
            part(high, 1),
            make(Op::CompositeConstruct, result, pair, parts),
            Instruction::new(Op::ReturnValue, None, None, back),
        ],
    };
    function.blocks = vec![block];
    let words = vec![Operand::IdRef(word); 2];
    let both = Instruction::new(Op::TypeStruct, None, Some(both), words);
    module.types_global_values.push(both);
    Ok(())
}

/// The type of a function's two parameters, and them.
fn parameters(function: &Function) -> Result<(u32, Vec<Operand>)> {
    let mut types = function.parameters.iter().filter_map(|p| p.result_type);
    let word = types.next().context("parameters")?;
    let ids = function.parameters.iter().filter_map(|p| p.result_id);
    let operands: Vec<_> = ids.map(Operand::IdRef).collect();
    anyhow::ensure!(operands.len() == 2, "two parameters");
    Ok((word, operands))
}
