//! The stages of a ray-tracing pipeline: all entry points of one file, in one module.

use crate::stitch::{Arithmetic, Filling, Rests, Source};
use crate::{harden, options, parse, reflect};
use anyhow::{Context, Result, anyhow, bail};
use naga::ShaderStage;
use naga::back::spv;
use naga::valid::Capabilities;
use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand, load_words};
use rspirv::spirv::{Capability, Op, StorageClass};
use std::path::Path;

/// The stem of the file.
pub(crate) const FILE: &str = "pipeline";

/// The pipeline's stages as a Rust constant.
pub(crate) fn compile(folder: &Path) -> Result<String> {
    let source =
        Source::read(folder, FILE)?.stitch(&Filling::new(), Arithmetic::Plain, Rests::Halves)?;
    let source = format!("enable wgpu_ray_tracing_pipeline, primitive_index;\n{source}");
    let (module, info) = parse(
        &source,
        Capabilities::RAY_TRACING_PIPELINE | Capabilities::PRIMITIVE_INDEX,
    )?;
    let words = spv::write_vec(&module, &info, &options((1, 4)), None)?;
    let mut lowered = load_words(words).map_err(|e| anyhow!("{e}"))?;
    harden::harden_module(&mut lowered);
    hand_over_attributes(&mut lowered)?;
    drop_geometry(&mut lowered);
    let spirv = lowered.assemble();
    let bindings = reflect::bindings(&module)?;
    let scene = reflect::scene(&module)?;
    let entries = |stage| {
        let all = module.entry_points.iter().filter(move |e| e.stage == stage);
        all.map(|e| e.name.as_str()).collect::<Vec<_>>()
    };
    let generate = entries(ShaderStage::RayGeneration);
    let lone = |stage| match entries(stage)[..] {
        [name] => Ok(name),
        _ => bail!("one entry point for {stage:?}"),
    };
    let (hit, miss) = (lone(ShaderStage::ClosestHit)?, lone(ShaderStage::Miss)?);
    Ok(format!(
        "/// The stages of the pipeline that traces a driver's own tree.\n\
         pub const RAYS: RayStages = RayStages {{ spirv: &{spirv:?}, scene: {scene}, bindings: &[{bindings}], \
         generate: &{generate:?}, closest_hit: {hit:?}, miss: {miss:?} }};\n"
    ))
}

/// naga knows no attributes of hits: the only private variable stands for them. It gets their
/// storage class, and no first value.
fn hand_over_attributes(module: &mut Module) -> Result<()> {
    let private = Operand::StorageClass(StorageClass::Private);
    let attributes = Operand::StorageClass(StorageClass::HitAttributeKHR);
    let is_private = |i: &Instruction, op| i.class.opcode == op && i.operands.contains(&private);
    let all = &module.types_global_values;
    let variables: Vec<_> = all
        .iter()
        .filter(|i| is_private(i, Op::Variable))
        .filter_map(|i| i.result_id)
        .collect();
    let [variable] = variables[..] else {
        bail!("one private variable, found {}", variables.len());
    };
    for i in &mut module.types_global_values {
        if is_private(i, Op::TypePointer) {
            i.operands[0] = attributes.clone();
        } else if i.result_id == Some(variable) {
            i.operands = vec![attributes.clone()];
        }
    }
    let blocks = module.functions.iter().flat_map(|f| &f.blocks);
    let whole = blocks.flat_map(|b| &b.instructions).all(|i| {
        let mut used = i.operands.iter();
        i.class.opcode == Op::Load || !used.any(|o| *o == Operand::IdRef(variable))
    });
    whole
        .then_some(())
        .context("attributes are read as a whole, and only read")
}

/// naga takes a triangle's number for that of geometry shaders; those that trace rays have it anyway.
fn drop_geometry(module: &mut Module) {
    let geometry = Operand::Capability(Capability::Geometry);
    module.capabilities.retain(|i| i.operands[0] != geometry);
}
