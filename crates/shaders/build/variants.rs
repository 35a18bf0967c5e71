//! Lists the kernels and the variants of each. A comment above an entry point names the axes along which it varies.
//!
//! `// Variants: intersector, arithmetic.` means all intersectors, and both ways to compute the remainder of a quotient.
//! `// Variants: intersector(exact).` means one intersector only.

use crate::compose::{KEPT, Sources};
use anyhow::{Context, Result, bail};
use wesl::EscapeMangler;

/// The names of all intersectors, with underscores. The conditions are the names in capitals.
const INTERSECTORS: [&str; 4] = ["moller_trumbore", "woop", "watertight", "exact"];
/// Condition: arithmetic that a compiler cannot see through keeps IEEE operations single, not decorations of the SPIR-V.
const OPAQUE: &str = "OPAQUE";
/// Condition: a fused multiply-add computes the remainder of a quotient, not products of halves.
const FUSED: &str = "FUSED";
/// Condition that holds for entry points with this suffix.
const SUBGROUPS: (&str, &str) = ("SUBGROUPS", "_by_subgroups");
/// Condition: the text is for shaders of a program, which do not count hits.
const MODULE: &str = "MODULE";

/// A compute kernel before its variants are selected.
pub(crate) struct EntryPoint {
    /// File, without extension.
    pub(crate) file: String,
    pub(crate) name: String,
    /// The intersectors that the kernel serves, or none if it does not depend on the intersector.
    intersectors: Vec<&'static str>,
    divides: bool,
}

/// A compiled kernel, for all intersectors for which it has the same text.
pub(crate) struct Variant {
    /// Empty if the variant serves all intersectors.
    pub(crate) intersectors: Vec<&'static str>,
    /// The text with products of halves.
    pub(crate) text: Text,
    /// The text with fused multiply-adds, if it differs.
    pub(crate) fused: Option<Text>,
}

/// A kernel's text in both forms.
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
    sources.compose("traversal/module", (&names, &EscapeMangler), &on)
}

/// Returns all compute kernels, sorted by name.
pub(crate) fn entries(sources: &Sources) -> Result<Vec<EntryPoint>> {
    let mut all = Vec::new();
    for (file, text) in &sources.files {
        let lines: Vec<_> = text.lines().collect();
        for at in (0..lines.len()).filter(|&at| lines[at].starts_with("@compute")) {
            let name = lines[at + 1].strip_prefix("fn ");
            let name = name.and_then(|n| n.split_once('(')).context("an entry")?.0;
            let above = at.checked_sub(1).map(|i| lines[i]);
            let axes = above.and_then(|line| line.strip_prefix("// Variants: "));
            let entry = EntryPoint::new(file, name, axes.unwrap_or("."));
            all.push(entry.with_context(|| name.to_owned())?);
        }
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

impl EntryPoint {
    fn new(file: &str, name: &str, axes: &str) -> Result<Self> {
        let axes = axes.strip_suffix('.').context("a full stop")?;
        let (mut intersectors, mut divides) = (Vec::new(), false);
        for word in axes.split(", ").filter(|w| !w.is_empty()) {
            match word {
                "arithmetic" => divides = true,
                "intersector" => intersectors = INTERSECTORS.to_vec(),
                "intersector(exact)" => intersectors = vec!["exact"],
                _ => bail!("no axis {word}"),
            }
        }
        Ok(Self {
            file: file.to_owned(),
            name: name.to_owned(),
            intersectors,
            divides,
        })
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
        let subgroups = self.name.ends_with(SUBGROUPS.1).then_some(SUBGROUPS.0);
        let intersector = intersector.map(str::to_uppercase);
        let compose = |opaque: Option<&str>| {
            let named = intersector.iter().chain([&self.name]).map(String::as_str);
            let on: Vec<_> = named.chain(subgroups).chain(fused).chain(opaque).collect();
            sources.compose(&self.file, (&[&self.name], &KEPT), &on)
        };
        Ok(Text {
            plain: compose(None)?,
            opaque: compose(Some(OPAQUE))?,
        })
    }
}

/// Returns all conditions that a file may use.
pub(crate) fn conditions(all: &[EntryPoint]) -> Vec<String> {
    let intersectors = INTERSECTORS.map(str::to_uppercase);
    let others = [OPAQUE, FUSED, MODULE, SUBGROUPS.0].map(str::to_owned);
    let entries = all.iter().map(|e| e.name.clone());
    intersectors
        .into_iter()
        .chain(others)
        .chain(entries)
        .collect()
}
