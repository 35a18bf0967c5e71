//! Lists the kernels and the variants of each. A comment above an entry point names the axes along which it varies.
//!
//! `// Variants: intersector, layout(fast), arithmetic.` means all intersectors, layout `fast` only, and both ways to
//! compute the remainder of a quotient.

use crate::compose::{KEPT, Sources};
use anyhow::{Context, Result, ensure};
use wesl::EscapeMangler;

/// The axes that hosts select values of. The conditions are the values in capitals.
/// `src/method.rs` returns the value for a method.
const AXES: [(&str, &[&str]); 2] = [
    (
        "intersector",
        &["moller_trumbore", "woop", "watertight", "exact"],
    ),
    ("layout", &["bvh2", "fast"]),
];
/// Condition: arithmetic that a compiler cannot see through keeps IEEE operations single, not decorations of the SPIR-V.
const OPAQUE: &str = "OPAQUE";
/// Condition: a fused multiply-add computes the remainder of a quotient, not products of halves.
const FUSED: &str = "FUSED";
/// Condition that holds for entry points with this suffix.
const SUBGROUPS: (&str, &str) = ("SUBGROUPS", "_by_subgroups");
/// Condition: the text is for shaders of a program, which do not count hits.
const MODULE: &str = "MODULE";

/// An axis, and all or some of its values.
type Choice = (&'static str, Vec<&'static str>);

/// A compute kernel before its variants are selected.
pub(crate) struct EntryPoint {
    /// File, without extension.
    pub(crate) file: String,
    pub(crate) name: String,
    choices: Vec<Choice>,
    divides: bool,
}

/// A compiled kernel, for all choices that compose to the same text.
pub(crate) struct Variant {
    chosen: Vec<Vec<&'static str>>,
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

/// Composes single-ray functions for shaders of a program, with the default method.
pub(crate) fn module(sources: &Sources) -> Result<String> {
    let names = [
        "abvh_closest",
        "abvh_any",
        "AbvhHit",
        "ABVH_MISS",
        "ABVH_EXTREME",
    ];
    let on = ["WATERTIGHT", "FAST", OPAQUE, MODULE];
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
        let (mut choices, mut divides) = (Vec::new(), false);
        for word in axes.split(", ").filter(|w| !w.is_empty()) {
            match word.strip_suffix(')').and_then(|w| w.split_once('(')) {
                None if word == "arithmetic" => divides = true,
                None => choices.push(axis(word)?),
                Some((name, only)) => {
                    let (axis, mut values) = axis(name)?;
                    values.retain(|v| only.split(' ').any(|o| o == *v));
                    ensure!(!values.is_empty(), "{axis} has no value {only}");
                    choices.push((axis, values));
                }
            }
        }
        Ok(Self {
            file: file.to_owned(),
            name: name.to_owned(),
            choices,
            divides,
        })
    }

    /// Returns one variant for each group of choices that compose to the same text.
    pub(crate) fn variants(&self, sources: &Sources) -> Result<Vec<Variant>> {
        let mut ways: Vec<Vec<&str>> = vec![Vec::new()];
        for (_, values) in &self.choices {
            let pairs = ways
                .iter()
                .flat_map(|way| values.iter().map(move |&v| (way, v)));
            ways = pairs.map(|(way, v)| [&way[..], &[v]].concat()).collect();
        }
        let mut made: Vec<Variant> = Vec::new();
        for way in ways {
            let text = |fused| self.text(sources, &way, fused);
            let fused = self.divides.then(|| text(Some(FUSED))).transpose()?;
            let text = text(None)?;
            let fused = fused.filter(|f| *f != text);
            match made.iter_mut().find(|v| v.text == text && v.fused == fused) {
                Some(same) => same.chosen.push(way),
                None => made.push(Variant {
                    chosen: vec![way],
                    text,
                    fused,
                }),
            }
        }
        Ok(made)
    }

    fn text(&self, sources: &Sources, way: &[&str], fused: Option<&str>) -> Result<Text> {
        let subgroups = self.name.ends_with(SUBGROUPS.1).then_some(SUBGROUPS.0);
        let values: Vec<_> = way.iter().map(|v| v.to_uppercase()).collect();
        let compose = |opaque: Option<&str>| {
            let named = values.iter().chain([&self.name]).map(String::as_str);
            let on: Vec<_> = named.chain(subgroups).chain(fused).chain(opaque).collect();
            sources.compose(&self.file, (&[&self.name], &KEPT), &on)
        };
        Ok(Text {
            plain: compose(None)?,
            opaque: compose(Some(OPAQUE))?,
        })
    }
}

impl Variant {
    /// Returns each axis with the values that the variant serves. An axis is left out if the variant serves all its values.
    pub(crate) fn serves(&self, entry: &EntryPoint) -> Result<Vec<Choice>> {
        let (mut served, mut combinations) = (Vec::new(), 1);
        for (i, (name, values)) in entry.choices.iter().enumerate() {
            let mut values = values.clone();
            values.retain(|v| self.chosen.iter().any(|way| way[i] == *v));
            combinations *= values.len();
            if values.len() < axis(name)?.1.len() {
                served.push((*name, values));
            }
        }
        let (is_whole, name) = (combinations == self.chosen.len(), &entry.name);
        ensure!(
            is_whole,
            "equal variants of {name} are no whole rows of an axis"
        );
        Ok(served)
    }
}

/// Returns an axis with all its values.
fn axis(name: &str) -> Result<Choice> {
    let found = AXES.iter().find(|(axis, _)| *axis == name);
    let (axis, values) = found.with_context(|| format!("no axis {name}"))?;
    Ok((axis, values.to_vec()))
}

/// Returns all conditions that a file may use.
pub(crate) fn conditions(all: &[EntryPoint]) -> Vec<String> {
    let values = AXES.iter().flat_map(|(_, values)| *values);
    let others = [OPAQUE, FUSED, MODULE, SUBGROUPS.0].map(str::to_owned);
    let entries = all.iter().map(|e| e.name.clone());
    let values = values.map(|v| v.to_uppercase());
    values.chain(others).chain(entries).collect()
}
