//! Compiles every kernel: stitch, validate, reflect, translate to SPIR-V, make its arithmetic safe.

#[path = "build/harden.rs"]
mod harden;
#[path = "build/rays.rs"]
mod rays;
#[path = "build/reflect.rs"]
mod reflect;
#[path = "build/slots.rs"]
mod slots;
#[path = "build/stitch.rs"]
mod stitch;
#[path = "build/wide.rs"]
mod wide;

use anyhow::{Context, Result, anyhow};
use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{
    Capabilities, ModuleInfo, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator,
};
use std::fmt::Write;
use std::path::Path;
use stitch::{Arithmetic, Filling, Rests, Source};

fn main() -> Result<()> {
    println!("cargo::rerun-if-changed=wgsl");
    println!("cargo::rerun-if-changed=build");
    let out = std::env::var("OUT_DIR").context("cargo sets OUT_DIR")?;
    let kernels = table("Every kernel.", "KERNELS", Path::new("wgsl"))?;
    let rays = Path::new("wgsl/rays");
    let beside = "Kernels beside [`RAYS`], for those who have a driver make trees.";
    let beside = table(beside, "RAY_KERNELS", rays)?;
    let pipeline = rays::compile(rays).context("wgsl/rays/pipeline.wgsl")?;
    let all = [kernels, beside, pipeline].concat();
    std::fs::write(Path::new(&out).join("kernels.rs"), all).context("kernels.rs")
}

/// All kernels of a folder as a Rust constant.
fn table(about: &str, constant: &str, folder: &Path) -> Result<String> {
    let mut table = format!("/// {about}\npub static {constant}: &[Kernel] = &[\n");
    for stem in stitch::kernels(folder)? {
        let path = || folder.join(&stem).display().to_string();
        table.push_str(&compile(folder, &stem).with_context(path)?);
    }
    table.push_str("];\n");
    Ok(table)
}

/// All variants of a kernel as Rust expressions.
fn compile(folder: &Path, stem: &str) -> Result<String> {
    let source = Source::read(folder, stem)?;
    let fillings = source.fillings();
    let each = fillings.iter().map(|f| compile_variant(&source, f));
    each.collect()
}

fn compile_variant(source: &Source, filling: &Filling) -> Result<String> {
    let values = filling.iter().map(|(_, value)| value.name);
    let name: Vec<_> = [source.stem.as_str()].into_iter().chain(values).collect();
    let name = name.join(".");
    let (code, module) = code(source, filling, Rests::Halves).with_context(|| name.clone())?;
    let fused = match source.searches() {
        true => format!("Some({})", self::code(source, filling, Rests::Fused)?.0),
        false => "None".to_owned(),
    };
    let entry = &source.stem;
    let workgroup = reflect::workgroup(&module, entry)?;
    let shared = reflect::shared_bytes(&module);
    reflect::refuse_gaps(&module)?;
    let bindings = reflect::bindings(&module)?;
    let slots: Vec<_> = filling.iter().map(|(s, v)| (s.name, v.name)).collect();
    let mut text = String::new();
    writeln!(
        text,
        "Kernel {{ name: {name:?}, entry: {entry:?}, slots: &{slots:?}, code: {code}, \
         fused: {fused}, workgroup: {workgroup:?}, \
         shared_bytes: {shared}, bindings: &[{bindings}] }},"
    )?;
    Ok(text)
}

/// WGSL and SPIR-V as a Rust expression, and the module.
fn code(source: &Source, filling: &Filling, rests: Rests) -> Result<(String, naga::Module)> {
    let opaque = source.stitch(filling, Arithmetic::Opaque, rests)?;
    parse(&opaque, CAPABILITIES)?;
    let plain = source.stitch(filling, Arithmetic::Plain, rests)?;
    let (module, info) = parse(&plain, CAPABILITIES)?;
    let words = spv::write_vec(&module, &info, &options((1, 3)), None)?;
    let spirv = harden::harden(&words)?;
    let code = format!("Code {{ wgsl: {opaque:?}, spirv: &{spirv:?} }}");
    Ok((code, module))
}

/// What kernels may ask of a device; hosts load those that ask for more than all have where it is there.
const CAPABILITIES: Capabilities = Capabilities::SUBGROUP
    .union(Capabilities::SHADER_INT64)
    .union(Capabilities::SHADER_INT64_ATOMIC_MIN_MAX);

fn parse(source: &str, capabilities: Capabilities) -> Result<(naga::Module, ModuleInfo)> {
    let module = naga::front::wgsl::parse_str(source)
        .map_err(|e| anyhow!("{}", e.emit_to_string(source)))?;
    let info = Validator::new(ValidationFlags::all(), capabilities)
        .subgroup_stages(ShaderStages::COMPUTE)
        .subgroup_operations(SubgroupOperationSet::all())
        .validate(&module)
        .map_err(|e| anyhow!("{}", e.emit_to_string(source)))?;
    Ok((module, info))
}

/// Every option by name: nothing is left to a default that may change.
fn options(lang_version: (u8, u8)) -> spv::Options<'static> {
    let unchecked = BoundsCheckPolicy::Unchecked;
    spv::Options {
        lang_version,
        // Names tell `harden` which functions are loose; it drops them.
        flags: spv::WriterFlags::DEBUG,
        binding_map: spv::BindingMap::default(),
        capabilities: None,
        bounds_check_policies: BoundsCheckPolicies {
            index: unchecked,
            buffer: unchecked,
            image_load: unchecked,
            binding_array: unchecked,
        },
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        ray_query_initialization_tracking: false,
        trace_ray_argument_validation: false,
        use_storage_input_output_16: false,
        fake_missing_bindings: true,
        debug_info: None,
        ..spv::Options::default()
    }
}
