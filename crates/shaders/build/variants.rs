//! Which kernels there are, and the variants of each: a comment above an entry point names the axes along which it differs.
//!
//! `// Variants: intersector, layout(fast), arithmetic.` stands for all intersectors, for layout `fast` alone, and for both ways to
//! find what a quotient leaves.

use crate::compose::{KEPT, Sources};
use anyhow::{Context, Result, ensure};
use wesl::EscapeMangler;

/// The axes that hosts choose along, each with its values and the condition that holds for each.
/// `src/method.rs` says which value a method takes.
const AXES: &[(&str, &[(&str, &str)])] = &[
    (
        "intersector",
        &[
            ("moller_trumbore", "MOLLER_TRUMBORE"),
            ("woop", "WOOP"),
            ("watertight", "WATERTIGHT"),
            ("exact", "EXACT"),
        ],
    ),
    (
        "layout",
        &[("bvh2", "LAYOUT_BVH2"), ("fast", "LAYOUT_FAST")],
    ),
];
/// Holds where single IEEE operations are kept single by arithmetic that a compiler cannot see through, not by decorations
/// of the SPIR-V.
const OPAQUE: &str = "OPAQUE";
/// Holds where what a quotient leaves is found by a fused product and sum, not by products of halves.
const FUSED: &str = "FUSED";
/// Holds for entry points that are named so.
const SUBGROUPS: (&str, &str) = ("SUBGROUPS", "_by_subgroups");

/// Holds for the text that shaders of others call: nothing is counted.
const MODULE: &str = "MODULE";

/// A value of an axis.
#[derive(Clone, Copy)]
struct Value {
    axis: &'static str,
    name: &'static str,
    condition: &'static str,
}

/// A compute kernel before its variants are chosen.
pub(crate) struct EntryPoint {
    /// Its file, and its name.
    pub(crate) file: String,
    pub(crate) name: String,
    choices: Vec<Vec<Value>>,
    divides: bool,
}

/// A kernel as it is compiled: for all choices that compose to the same text.
pub(crate) struct Variant {
    chosen: Vec<Vec<Value>>,
    /// With products of halves.
    pub(crate) text: Text,
    /// With fused products and sums, where that differs.
    pub(crate) fused: Option<Text>,
}

/// A kernel's text in both forms.
#[derive(PartialEq, Eq)]
pub(crate) struct Text {
    pub(crate) plain: String,
    pub(crate) opaque: String,
}

/// Single rays for shaders of others, by the usual method.
pub(crate) fn module(sources: &Sources, all: &[EntryPoint]) -> Result<String> {
    let names = [
        "abvh_closest",
        "abvh_any",
        "AbvhHit",
        "ABVH_MISS",
        "ABVH_EXTREME",
    ];
    let file = "traversal/module";
    let on = ["WATERTIGHT", "LAYOUT_FAST", OPAQUE, MODULE];
    sources.compose(file, (&names, &EscapeMangler), &on, &conditions(all))
}

/// Every compute kernel, sorted by name.
pub(crate) fn entries(sources: &Sources) -> Result<Vec<EntryPoint>> {
    let mut all = Vec::new();
    for (file, text) in sources.iter() {
        let lines: Vec<_> = text.lines().collect();
        for at in (0..lines.len()).filter(|&at| lines[at].starts_with("@compute")) {
            let name = lines[at + 1].strip_prefix("fn ");
            let name = name.and_then(|n| n.split_once('(')).context("an entry")?.0;
            let axes = at
                .checked_sub(1)
                .and_then(|i| lines[i].strip_prefix("// Variants: "));
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
        let mut entry = Self {
            file: file.to_owned(),
            name: name.to_owned(),
            choices: Vec::new(),
            divides: false,
        };
        for word in axes.split(", ").filter(|w| !w.is_empty()) {
            match word.strip_suffix(')').and_then(|w| w.split_once('(')) {
                None if word == "arithmetic" => entry.divides = true,
                None => entry.choices.push(values(word)?),
                Some((axis, only)) => {
                    let mut all = values(axis)?;
                    all.retain(|v| only.split(' ').any(|o| o == v.name));
                    ensure!(!all.is_empty(), "{axis} has no value {only}");
                    entry.choices.push(all);
                }
            }
        }
        Ok(entry)
    }

    /// Every way to choose, those together that come to the same text.
    pub(crate) fn variants(&self, sources: &Sources, all: &[EntryPoint]) -> Result<Vec<Variant>> {
        let mut ways: Vec<Vec<Value>> = vec![Vec::new()];
        for choice in &self.choices {
            let with = |way: &Vec<Value>, v| way.iter().copied().chain([v]).collect();
            let more = |way| choice.iter().map(move |&v| with(way, v));
            ways = ways.iter().flat_map(more).collect();
        }
        let mut made: Vec<Variant> = Vec::new();
        for way in ways {
            let text = |fused| self.text(sources, all, &way, fused);
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

    fn text(
        &self,
        sources: &Sources,
        all: &[EntryPoint],
        way: &[Value],
        fused: Option<&str>,
    ) -> Result<Text> {
        let subgroups = self.name.ends_with(SUBGROUPS.1).then_some(SUBGROUPS.0);
        let compose = |opaque: Option<&str>| {
            let way = way.iter().map(|v| v.condition).chain([&self.name[..]]);
            let on: Vec<_> = way.chain(subgroups).chain(fused).chain(opaque).collect();
            sources.compose(&self.file, (&[&self.name], &KEPT), &on, &conditions(all))
        };
        Ok(Text {
            plain: compose(None)?,
            opaque: compose(Some(OPAQUE))?,
        })
    }
}

impl Variant {
    /// Each axis with the values that it serves; axes along which nothing differs are left out.
    pub(crate) fn serves(
        &self,
        entry: &EntryPoint,
    ) -> Result<Vec<(&'static str, Vec<&'static str>)>> {
        let (mut served, mut combinations) = (Vec::new(), 1);
        for (i, choice) in entry.choices.iter().enumerate() {
            let has = |v: &&Value| self.chosen.iter().any(|c| c[i].name == v.name);
            let names: Vec<_> = choice.iter().filter(has).map(|v| v.name).collect();
            combinations *= names.len();
            if names.len() < values(choice[0].axis)?.len() {
                served.push((choice[0].axis, names));
            }
        }
        let is_whole = combinations == self.chosen.len();
        let name = &entry.name;
        ensure!(
            is_whole,
            "equal variants of {name} are no whole rows of an axis"
        );
        Ok(served)
    }
}

fn values(axis: &str) -> Result<Vec<Value>> {
    let found = AXES.iter().find(|(name, _)| *name == axis);
    let (axis, all) = found.with_context(|| format!("no axis {axis}"))?;
    let value = |&(name, condition)| Value {
        axis,
        name,
        condition,
    };
    Ok(all.iter().map(value).collect())
}

/// All conditions that a file may name.
pub(crate) fn conditions(all: &[EntryPoint]) -> Vec<&str> {
    let values = AXES.iter().flat_map(|(_, values)| values.iter());
    let values = values.map(|(_, condition)| *condition);
    let entries = all.iter().map(|e| e.name.as_str());
    values
        .chain([OPAQUE, FUSED, MODULE, SUBGROUPS.0])
        .chain(entries)
        .collect()
}
