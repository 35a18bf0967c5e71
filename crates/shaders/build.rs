//! Compiles every kernel: composes, validates and reflects it, translates it to SPIR-V, and hardens its arithmetic.

#[path = "build/compose.rs"]
mod compose;
#[path = "build/harden.rs"]
mod harden;
#[path = "build/rays.rs"]
mod rays;
#[path = "build/reflect.rs"]
mod reflect;
#[path = "build/syntax.rs"]
mod syntax;
#[path = "build/variants.rs"]
mod variants;

use anyhow::{Context, Result, anyhow, ensure};
use compose::{Files, Sources};
use naga::back::spv;
use naga::valid::{
    Capabilities, ModuleInfo, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator,
};
use std::path::{Path, PathBuf};
use variants::{EntryPoint, Text, Variant};

fn main() -> Result<()> {
    println!("cargo::rerun-if-changed=wgsl");
    println!("cargo::rerun-if-changed=build");
    let out = PathBuf::from(std::env::var("OUT_DIR").context("cargo sets OUT_DIR")?);
    let files = read(Path::new("wgsl"))?;
    let entries = variants::entries(&files)?;
    let sources = Sources::new(&files, variants::conditions(&entries))?;
    let kernels = compile_all(&out, &sources, &entries)?;
    let kernels = format!("/// Every kernel.\npub static KERNELS: &[Kernel] = &[\n{kernels}];\n");
    let pipeline = rays::compile(&out, &sources).context(rays::PIPELINE_FILE)?;
    let module = variants::module(&sources).context("cannot compose the module")?;
    parse(&module, CAPABILITIES)?;
    std::fs::write(out.join("module.wgsl"), module)?;
    let all = [kernels, pipeline].concat();
    std::fs::write(out.join("kernels.rs"), all).context("kernels.rs")
}

/// Reads all files in the folders of `root`.
fn read(root: &Path) -> Result<Files> {
    let mut files = Files::new();
    for folder in root.read_dir().context("wgsl")? {
        for file in folder?.path().read_dir().context("a folder in wgsl")? {
            let path = file?.path();
            let name = path.strip_prefix(root)?.with_extension("");
            let text = std::fs::read_to_string(&path);
            let text = text.with_context(|| path.display().to_string())?;
            files.insert(name.to_string_lossy().into_owned(), text);
        }
    }
    Ok(files)
}

/// Compiles kernels, each on its own thread. Returns them in their order, as Rust expressions.
fn compile_all(out: &Path, sources: &Sources, entries: &[EntryPoint]) -> Result<String> {
    std::thread::scope(|scope| {
        let start = |entry| scope.spawn(move || compile(out, sources, entry));
        let threads: Vec<_> = entries.iter().map(start).collect();
        let joined = threads.into_iter().map(|thread| thread.join());
        joined.map(|done| done.expect("no thread panics")).collect()
    })
}

/// Compiles all variants of a kernel. Returns them as Rust expressions.
fn compile(out: &Path, sources: &Sources, entry: &EntryPoint) -> Result<String> {
    let variants = entry.variants(sources);
    let variants = variants.with_context(|| entry.name.clone())?;
    let each = variants.iter().map(|v| compile_variant(out, entry, v));
    each.collect()
}

fn compile_variant(out: &Path, entry: &EntryPoint, variant: &Variant) -> Result<String> {
    let intersectors = &variant.intersectors;
    let mut name = entry.name.clone();
    if !intersectors.is_empty() {
        name = format!("{name}.{}", intersectors.join("+"));
    }
    let (code, module) = code(out, &name, &variant.text).with_context(|| name.clone())?;
    let fused = variant.fused.as_ref().map(|text| {
        let (code, _) = self::code(out, &format!("{name}.fused"), text)?;
        anyhow::Ok(format!("Some({code})"))
    });
    let fused = fused.transpose()?.unwrap_or("None".to_owned());
    let workgroup = reflect::workgroup(&module, &entry.name)?;
    let shared = reflect::shared_bytes(&module);
    let bindings = reflect::bindings(&module)?;
    // wgpu renumbers a kernel's buffers without gaps, but does not change SPIR-V that is passed through.
    ensure!(
        bindings.keys().copied().eq(0..bindings.len() as u32),
        "bindings of {name} are not numbered from 0 on without gaps"
    );
    let bindings: String = bindings.into_values().collect();
    let EntryPoint {
        name: entry,
        parameters,
        loads_with_scene,
        ..
    } = entry;
    Ok(format!(
        "Kernel {{ name: {name:?}, entry: {entry:?}, parameters: {parameters:?}, \
         loads_with_scene: {loads_with_scene}, intersectors: &{intersectors:?}, code: {code}, \
         fused: {fused}, workgroup: {workgroup:?}, \
         shared_bytes: {shared}, bindings: &[{bindings}] }},\n"
    ))
}

/// Writes WGSL and SPIR-V to files. Returns a Rust expression that includes them, and the module.
fn code(out: &Path, name: &str, text: &Text) -> Result<(String, naga::Module)> {
    parse(&text.opaque, CAPABILITIES)?;
    let (module, info) = parse(&text.plain, CAPABILITIES)?;
    let words = spv::write_vec(&module, &info, &options(3), None)?;
    let spirv = include_words(out, name, &harden::harden(&words)?)?;
    std::fs::write(out.join(format!("{name}.wgsl")), &text.opaque)?;
    let wgsl = format!("include_str!(concat!(env!(\"OUT_DIR\"), \"/{name}.wgsl\"))");
    Ok((format!("Code {{ wgsl: {wgsl}, spirv: {spirv} }}"), module))
}

/// Writes words to a file. Returns a Rust expression that includes it.
fn include_words(out: &Path, name: &str, words: &[u32]) -> Result<String> {
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_ne_bytes()).collect();
    std::fs::write(out.join(format!("{name}.spv")), bytes)?;
    Ok(format!(
        "include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.spv\"))"
    ))
}

/// Capabilities that kernels may use. A backend loads a kernel only on devices that have all capabilities that the
/// kernel uses.
const CAPABILITIES: Capabilities = Capabilities::SUBGROUP
    .union(Capabilities::SHADER_INT64)
    .union(Capabilities::SHADER_INT64_ATOMIC_ALL_OPS);

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

/// Returns options for SPIR-V 1.`minor_version`. Turns off code that naga adds by default to bound loops and to clear
/// memory. Memory accesses are not checked.
fn options(minor_version: u8) -> spv::Options<'static> {
    spv::Options {
        lang_version: (1, minor_version),
        // `harden` needs names to find `multiply_32` and the functions whose operations may be fused. It then removes
        // all names.
        flags: spv::WriterFlags::DEBUG,
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        ray_query_initialization_tracking: false,
        trace_ray_argument_validation: false,
        use_storage_input_output_16: false,
        ..spv::Options::default()
    }
}
