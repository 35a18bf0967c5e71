//! Reads workgroup size, workgroup memory and bindings from the compiled kernel, so that they need not be declared
//! again in Rust.

use anyhow::{Context, Result, bail};
use naga::{AddressSpace, StorageAccess};
use std::collections::BTreeMap;

pub(crate) fn workgroup(module: &naga::Module, name: &str) -> Result<[u32; 3]> {
    let entry = module.entry_points.iter().find(|e| e.name == name);
    Ok(entry.context("the entry point is missing")?.workgroup_size)
}

fn is_tree(module: &naga::Module, variable: &naga::GlobalVariable) -> bool {
    let inner = &module.types[variable.ty].inner;
    matches!(inner, naga::TypeInner::AccelerationStructure { .. })
}

/// Returns the binding of the driver's tree.
pub(crate) fn scene(module: &naga::Module) -> Result<u32> {
    let mut all = module.global_variables.iter().map(|(_, v)| v);
    let tree = all.find(|v| is_tree(module, v));
    let binding = tree.and_then(|v| v.binding.as_ref());
    Ok(binding.context("no acceleration structure")?.binding)
}

/// Returns the workgroup memory of a kernel in bytes, with each variable rounded up to 16.
pub(crate) fn shared_bytes(module: &naga::Module) -> u32 {
    let shared = module.global_variables.iter().map(|(_, v)| v);
    let shared = shared.filter(|v| v.space == AddressSpace::WorkGroup);
    let bytes = shared.map(|v| module.types[v.ty].inner.size(module.to_ctx()));
    bytes.map(|b| b.next_multiple_of(16)).sum()
}

/// Returns the bindings of group 0 by number, as Rust expressions, without the driver's tree.
pub(crate) fn bindings(module: &naga::Module) -> Result<BTreeMap<u32, String>> {
    let mut found = BTreeMap::new();
    for (_, variable) in module.global_variables.iter() {
        let Some(binding) = &variable.binding else {
            continue;
        };
        if binding.group != 0 {
            bail!("binding outside group 0");
        }
        let kind = match variable.space {
            AddressSpace::Uniform => "Uniform",
            AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => {
                "ReadWrite"
            }
            AddressSpace::Storage { .. } => "Read",
            AddressSpace::Handle if is_tree(module, variable) => continue,
            other => bail!("unexpected address space {other:?}"),
        };
        let name = camel_case(variable.name.as_deref().unwrap_or_default());
        let number = binding.binding;
        let text = format!(
            "Binding {{ number: {number}, kind: Kind::{kind}, name: BufferName::{name} }}, "
        );
        found.insert(number, text);
    }
    Ok(found)
}

/// Converts `leaf_corners` to `LeafCorners`.
fn camel_case(name: &str) -> String {
    let words = name.split('_').map(|word| {
        let (first, rest) = word.split_at(word.len().min(1));
        first.to_uppercase() + rest
    });
    words.collect()
}
