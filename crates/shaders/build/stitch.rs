//! A kernel's file after the shared files that its first line asks for: `//! use a b c`.

use anyhow::{Context, Result};
use std::fs::read_to_string;
use std::path::Path;

/// How single IEEE operations are kept single.
#[derive(Clone, Copy)]
pub(crate) enum Arithmetic {
    /// By decorations that are added to the SPIR-V.
    Plain,
    /// By arithmetic that a compiler cannot see through.
    Opaque,
}

/// The stems of all kernels, sorted.
pub(crate) fn kernels(folder: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in folder.read_dir().context("wgsl")? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "wgsl") {
            let stem = path.file_stem().context("a kernel has a name")?;
            names.push(stem.to_string_lossy().into_owned());
        }
    }
    names.sort();
    Ok(names)
}

pub(crate) fn stitch(name: &str, arithmetic: Arithmetic) -> Result<String> {
    let kernel = read_to_string(format!("wgsl/{name}.wgsl"))?;
    let head = kernel.lines().next().unwrap_or_default();
    let uses = head
        .strip_prefix("//! use ")
        .context("the first line must say '//! use ...'")?;
    let mut source = String::new();
    for part in uses.split_whitespace() {
        let part = match (part, arithmetic) {
            ("ieee", Arithmetic::Plain) => "ieee_plain",
            ("ieee", Arithmetic::Opaque) => "ieee_opaque",
            _ => part,
        };
        let path = format!("wgsl/shared/{part}.wgsl");
        source.push_str(&read_to_string(&path).context(path)?);
        source.push('\n');
    }
    let body = kernel.split_once('\n').map_or("", |(_, body)| body);
    Ok(source + body)
}
