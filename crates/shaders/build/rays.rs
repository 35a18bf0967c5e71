//! Compiles the stages of a ray-tracing pipeline: all entry points of one file, in one module.

use crate::compose::Sources;
use crate::{harden, include_words, options, parse, reflect};
use anyhow::{Result, anyhow, bail, ensure};
use naga::back::spv;
use naga::valid::Capabilities;
use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand, load_words};
use rspirv::spirv::{Capability, Op, StorageClass};
use std::path::Path;

/// File of the pipeline's stages.
pub(crate) const PIPELINE_FILE: &str = "traversal/ray_pipeline";

/// Entry points that generate rays.
const GENERATE: [&str; 4] = [
    "camera_closest",
    "camera_shadow",
    "explicit_closest",
    "explicit_shadow",
];

/// Compiles the pipeline. Returns its stages as a Rust constant.
pub(crate) fn compile(out: &Path, sources: &Sources) -> Result<String> {
    let stages = [&GENERATE[..], &["closest_hit", "miss"]].concat();
    let source = sources.compose(PIPELINE_FILE, &stages, "", &[])?;
    let source = format!("enable wgpu_ray_tracing_pipeline, primitive_index;\n{source}");
    let (module, info) = parse(
        &source,
        Capabilities::RAY_TRACING_PIPELINE | Capabilities::PRIMITIVE_INDEX,
    )?;
    let words = spv::write_vec(&module, &info, &options(4), None)?;
    let mut lowered = load_words(words).map_err(|e| anyhow!("{e}"))?;
    harden::harden_module(&mut lowered);
    hand_over_attributes(&mut lowered)?;
    drop_geometry(&mut lowered);
    let spirv = include_words(out, "rays", &lowered.assemble())?;
    let bindings: String = reflect::bindings(&module)?.into_values().collect();
    let scene = reflect::scene(&module)?;
    Ok(format!(
        "/// The stages of the pipeline that traces a driver's own tree.\n\
         pub const RAYS: RayStages = RayStages {{ spirv: {spirv}, scene: {scene}, bindings: &[{bindings}], \
         generate: &{GENERATE:?} }};\n"
    ))
}

/// Gives the only private variable the storage class of hit attributes, which naga does not know, and removes its
/// initialiser.
fn hand_over_attributes(module: &mut Module) -> Result<()> {
    let private = Operand::StorageClass(StorageClass::Private);
    let attributes = Operand::StorageClass(StorageClass::HitAttributeKHR);
    let is_private = |i: &Instruction, op| i.class.opcode == op && i.operands.contains(&private);
    let all = &module.types_global_values;
    let variables = all.iter().filter(|i| is_private(i, Op::Variable));
    let variables: Vec<_> = variables.filter_map(|i| i.result_id).collect();
    let [variable] = variables[..] else {
        bail!("expected one private variable, found {}", variables.len());
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
    ensure!(whole, "hit attributes must only be loaded as a whole");
    Ok(())
}

/// Drops the capability that naga adds for `primitive_index` in geometry shaders. Ray-tracing stages do not need it.
fn drop_geometry(module: &mut Module) {
    let geometry = Operand::Capability(Capability::Geometry);
    module.capabilities.retain(|i| i.operands[0] != geometry);
}
