//! Compiles every kernel: stitch, validate, reflect, translate to SPIR-V, make its arithmetic safe.

#[path = "build/harden.rs"]
mod harden;
#[path = "build/reflect.rs"]
mod reflect;
#[path = "build/stitch.rs"]
mod stitch;

use anyhow::{Context, Result, anyhow};
use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use std::fmt::Write;
use std::path::Path;
use stitch::Arithmetic;

fn main() -> Result<()> {
    println!("cargo::rerun-if-changed=wgsl");
    println!("cargo::rerun-if-changed=build");
    let out = std::env::var("OUT_DIR").context("cargo sets OUT_DIR")?;
    let mut table = String::from("/// Every kernel.\npub const KERNELS: &[Kernel] = &[\n");
    for name in stitch::kernels(Path::new("wgsl"))? {
        let entry = compile(&name).with_context(|| format!("wgsl/{name}.wgsl"))?;
        table.push_str(&entry);
    }
    table.push_str("];\n");
    std::fs::write(Path::new(&out).join("kernels.rs"), table).context("kernels.rs")
}

/// One kernel as a Rust expression.
fn compile(name: &str) -> Result<String> {
    let opaque = stitch::stitch(name, Arithmetic::Opaque)?;
    parse(&opaque)?;
    let (module, info) = parse(&stitch::stitch(name, Arithmetic::Plain)?)?;
    let words = spv::write_vec(&module, &info, &options(), None)?;
    let spirv = harden::harden(&words)?;
    let workgroup = reflect::workgroup(&module, name)?;
    let bindings = reflect::bindings(&module)?;
    let mut entry = String::new();
    writeln!(
        entry,
        "Kernel {{ name: {name:?}, wgsl: {opaque:?}, spirv: &{spirv:?}, \
         workgroup: {workgroup:?}, bindings: &[{bindings}] }},"
    )?;
    Ok(entry)
}

fn parse(source: &str) -> Result<(naga::Module, ModuleInfo)> {
    let module = naga::front::wgsl::parse_str(source)
        .map_err(|e| anyhow!("{}", e.emit_to_string(source)))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|e| anyhow!("{}", e.emit_to_string(source)))?;
    Ok((module, info))
}

/// Every option by name: nothing is left to a default that may change.
fn options() -> spv::Options<'static> {
    let unchecked = BoundsCheckPolicy::Unchecked;
    spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::empty(),
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
        use_storage_input_output_16: false,
        fake_missing_bindings: true,
        debug_info: None,
        ..spv::Options::default()
    }
}
