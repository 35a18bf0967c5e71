//! Compiles every kernel: stitch, validate, reflect, translate to SPIR-V, make its arithmetic safe.

#[path = "build/harden.rs"]
mod harden;
#[path = "build/reflect.rs"]
mod reflect;
#[path = "build/slots.rs"]
mod slots;
#[path = "build/stitch.rs"]
mod stitch;

use anyhow::{Context, Result, anyhow};
use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use std::fmt::Write;
use std::path::Path;
use stitch::{Arithmetic, Filling, Source};

fn main() -> Result<()> {
    println!("cargo::rerun-if-changed=wgsl");
    println!("cargo::rerun-if-changed=build");
    let out = std::env::var("OUT_DIR").context("cargo sets OUT_DIR")?;
    let mut table = String::from("/// Every kernel.\npub const KERNELS: &[Kernel] = &[\n");
    for stem in stitch::kernels(Path::new("wgsl"))? {
        let entries = compile(&stem).with_context(|| format!("wgsl/{stem}.wgsl"))?;
        table.push_str(&entries);
    }
    table.push_str("];\n");
    std::fs::write(Path::new(&out).join("kernels.rs"), table).context("kernels.rs")
}

/// All variants of a kernel as Rust expressions.
fn compile(stem: &str) -> Result<String> {
    let source = Source::read(stem)?;
    let fillings = source.fillings();
    let each = fillings.iter().map(|f| compile_variant(&source, f));
    each.collect()
}

fn compile_variant(source: &Source, filling: &Filling) -> Result<String> {
    let values = filling.iter().map(|(_, value)| value.name);
    let name: Vec<_> = [source.stem.as_str()].into_iter().chain(values).collect();
    let name = name.join(".");
    let opaque = source.stitch(filling, Arithmetic::Opaque)?;
    parse(&opaque).with_context(|| name.clone())?;
    let plain = source.stitch(filling, Arithmetic::Plain)?;
    let (module, info) = parse(&plain).with_context(|| name.clone())?;
    let words = spv::write_vec(&module, &info, &options(), None)?;
    let spirv = harden::harden(&words)?;
    let entry = &source.stem;
    let workgroup = reflect::workgroup(&module, entry)?;
    let bindings = reflect::bindings(&module)?;
    let slots: Vec<_> = filling.iter().map(|(s, v)| (s.name, v.name)).collect();
    let mut text = String::new();
    writeln!(
        text,
        "Kernel {{ name: {name:?}, entry: {entry:?}, slots: &{slots:?}, wgsl: {opaque:?}, \
         spirv: &{spirv:?}, workgroup: {workgroup:?}, bindings: &[{bindings}] }},"
    )?;
    Ok(text)
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
