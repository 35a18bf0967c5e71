//! Lists the kernels and the variants of each. Comments above an entry point declare its properties.
//!
//! `// Variants: intersector, arithmetic.` means all intersectors, and both ways to compute the remainder of a quotient.
//! `// Variants: intersector(exact).` means one intersector only. `subgroups` means that the kernel uses subgroups.
//! `// Parameters: search.` means that the kernel reads `params.search`: see `lib/params.wgsl`.
//! `// Loaded with every scene.` means that a frame of any scene may run the kernel before it traces rays. So the
//! kernel is loaded with every scene instead of at first use.

use crate::compose::{Files, Sources};
use anyhow::{Context, Result, bail};
use std::collections::BTreeSet;

/// The names of all intersectors, with underscores. The conditions are the names in capitals.
const INTERSECTORS: [&str; 4] = ["moller_trumbore", "woop", "watertight", "exact"];
/// Condition: IEEE operations are kept separate by arithmetic that a compiler cannot see through, instead of by
/// decorations of the SPIR-V.
const OPAQUE: &str = "OPAQUE";
/// Condition: remainders of quotients and errors of products are computed by a fused multiply-add, instead of by
/// splitting the factors (Dekker 1971).
const FUSED: &str = "FUSED";
/// Condition: the kernel uses subgroups.
const SUBGROUPS: &str = "SUBGROUPS";
/// Condition: the text is the module that a program's own shaders call. In it, the code that increments the hit counter
/// is left out.
const MODULE: &str = "MODULE";

/// A compute kernel before its variants are selected.
#[derive(Default)]
pub(crate) struct EntryPoint {
    /// File, without extension.
    file: String,
    pub(crate) name: String,
    /// The intersectors that the kernel serves, or none if it does not depend on the intersector.
    intersectors: Vec<&'static str>,
    /// Whether the kernel computes remainders of quotients, so that its text with fused multiply-adds may differ.
    divides: bool,
    uses_subgroups: bool,
    /// The kernel's own parameters, if any: a member of `Params`. The condition is the name in capitals.
    pub(crate) parameters: Option<String>,
    /// Whether a frame of any scene may run the kernel before it traces rays.
    pub(crate) loads_with_scene: bool,
}

/// A compiled kernel, for all intersectors for which it has the same text.
pub(crate) struct Variant {
    /// Empty if the variant serves all intersectors.
    pub(crate) intersectors: Vec<&'static str>,
    /// The text without fused multiply-adds.
    pub(crate) text: Text,
    /// The text with fused multiply-adds, if it differs.
    pub(crate) fused: Option<Text>,
}

/// A kernel's WGSL in two forms: `plain` is translated to SPIR-V by the build. `opaque` (condition [`OPAQUE`]) is
/// shipped as WGSL, for backends that cannot load SPIR-V.
#[derive(PartialEq, Eq)]
pub(crate) struct Text {
    pub(crate) plain: String,
    pub(crate) opaque: String,
}

/// Composes single-ray functions for shaders of a program, with `watertight`.
pub(crate) fn module(sources: &Sources) -> Result<String> {
    let names = [
        "abvh_closest",
        "abvh_any",
        "AbvhHit",
        "ABVH_MISS",
        "ABVH_EXTREME",
    ];
    let on = ["WATERTIGHT", OPAQUE, MODULE];
    sources.compose("traversal/module", &names, "abvh_", &on)
}

/// Returns all compute kernels, sorted by name.
pub(crate) fn entries(files: &Files) -> Result<Vec<EntryPoint>> {
    let mut all = Vec::new();
    for (file, text) in files {
        let lines: Vec<_> = text.lines().collect();
        for at in (0..lines.len()).filter(|&at| lines[at].starts_with("@compute")) {
            let name = lines[at + 1].strip_prefix("fn ");
            let name = name.and_then(|n| n.split_once('('));
            let error = "the line after `@compute` does not begin with `fn name(`";
            let (name, _) = name.context(error)?;
            let mut entry = EntryPoint {
                file: file.clone(),
                name: name.to_owned(),
                ..EntryPoint::default()
            };
            let above = lines[..at].iter().rev();
            for line in above.take_while(|line| line.starts_with("// ")) {
                entry.declare(line).with_context(|| name.to_owned())?;
            }
            all.push(entry);
        }
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

/// Returns the text between a prefix and the full stop at the end of a comment, or `None` for another comment.
fn declared<'a>(comment: &'a str, prefix: &str) -> Result<Option<&'a str>> {
    let text = comment.strip_prefix(prefix);
    text.map(|text| text.strip_suffix('.').context("no full stop"))
        .transpose()
}

impl EntryPoint {
    /// Sets the property that a comment above the entry point declares. Ignores other comments.
    fn declare(&mut self, comment: &str) -> Result<()> {
        if comment == "// Loaded with every scene." {
            self.loads_with_scene = true;
        } else if let Some(name) = declared(comment, "// Parameters: ")? {
            self.parameters = Some(name.to_owned());
        } else if let Some(axes) = declared(comment, "// Variants: ")? {
            for word in axes.split(", ") {
                match word {
                    "arithmetic" => self.divides = true,
                    "intersector" => self.intersectors = INTERSECTORS.to_vec(),
                    "intersector(exact)" => self.intersectors = vec!["exact"],
                    "subgroups" => self.uses_subgroups = true,
                    _ => bail!("unknown axis {word}"),
                }
            }
        }
        Ok(())
    }

    /// Returns one variant for each group of intersectors for which the kernel has the same text.
    pub(crate) fn variants(&self, sources: &Sources) -> Result<Vec<Variant>> {
        let mut made: Vec<Variant> = Vec::new();
        let each = self.intersectors.iter().map(|i| Some(*i));
        let none = self.intersectors.is_empty().then_some(None);
        for intersector in each.chain(none) {
            let text = |fused| self.text(sources, intersector, fused);
            let fused = self.divides.then(|| text(Some(FUSED))).transpose()?;
            let text = text(None)?;
            let fused = fused.filter(|f| *f != text);
            match made.iter_mut().find(|v| v.text == text && v.fused == fused) {
                Some(same) => same.intersectors.extend(intersector),
                None => made.push(Variant {
                    intersectors: intersector.into_iter().collect(),
                    text,
                    fused,
                }),
            }
        }
        for variant in &mut made {
            if variant.intersectors.len() == INTERSECTORS.len() {
                variant.intersectors.clear();
            }
        }
        Ok(made)
    }

    fn text(
        &self,
        sources: &Sources,
        intersector: Option<&str>,
        fused: Option<&str>,
    ) -> Result<Text> {
        let subgroups = self.uses_subgroups.then_some(SUBGROUPS);
        let intersector = intersector.map(str::to_uppercase);
        let parameters = self.parameters.as_deref().map(str::to_uppercase);
        let compose = |opaque: Option<&str>| {
            let named = intersector.iter().chain(&parameters).chain([&self.name]);
            let named = named.map(String::as_str);
            let on: Vec<_> = named.chain(subgroups).chain(fused).chain(opaque).collect();
            sources.compose(&self.file, &[&self.name], "", &on)
        };
        Ok(Text {
            plain: compose(None)?,
            opaque: compose(Some(OPAQUE))?,
        })
    }
}

/// Returns all conditions that a file may use.
pub(crate) fn conditions(all: &[EntryPoint]) -> BTreeSet<String> {
    let intersectors = INTERSECTORS.map(str::to_uppercase);
    let parameters = all.iter().filter_map(|e| e.parameters.as_deref());
    let others = [OPAQUE, FUSED, MODULE, SUBGROUPS].map(str::to_owned);
    let entries = all.iter().map(|e| e.name.clone());
    intersectors
        .into_iter()
        .chain(parameters.map(str::to_uppercase))
        .chain(others)
        .chain(entries)
        .collect()
}
