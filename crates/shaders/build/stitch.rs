//! A kernel's file after the shared files that its first line asks for: `//! use a {slot.face} b`.

use crate::slots::{SLOTS, Slot, Value};
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

/// How what a quotient leaves is found.
#[derive(Clone, Copy)]
pub(crate) enum Rests {
    /// By products of halves.
    Halves,
    /// By a fused product and sum.
    Fused,
}

/// A kernel's file, its slots not yet filled.
pub(crate) struct Source {
    /// The file's stem, which is the entry point's name.
    pub(crate) stem: String,
    uses: String,
    body: String,
}

/// The slots of a kernel, each with what fills it.
pub(crate) type Filling = Vec<(&'static Slot, &'static Value)>;

/// The stems of all kernels, sorted. What holds the stages of a pipeline is none.
pub(crate) fn kernels(folder: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in folder.read_dir().context("wgsl")? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "wgsl") {
            let stem = path.file_stem().context("a kernel has a name")?;
            names.push(stem.to_string_lossy().into_owned());
        }
    }
    names.retain(|name| name != crate::rays::FILE);
    names.sort();
    Ok(names)
}

impl Source {
    pub(crate) fn read(folder: &Path, stem: &str) -> Result<Self> {
        let text = read_to_string(folder.join(format!("{stem}.wgsl")))?;
        let (head, body) = text.split_once('\n').context("a kernel has a body")?;
        let uses = head
            .strip_prefix("//! use ")
            .context("the first line must say '//! use ...'")?;
        Ok(Self {
            stem: stem.to_owned(),
            uses: uses.to_owned(),
            body: body.to_owned(),
        })
    }

    /// The faces of a slot that the head names.
    fn faces_of(&self, slot: &Slot) -> impl Iterator<Item = &str> {
        let places = self.uses.split_whitespace().filter_map(place);
        places.filter_map(|(name, face)| (name == slot.name).then_some(face))
    }

    /// Every way to fill the slots. A value that lacks a face has no use for the kernel.
    pub(crate) fn fillings(&self) -> Vec<Filling> {
        let named = |slot: &&Slot| self.faces_of(slot).next().is_some();
        let mut all = vec![Filling::new()];
        for slot in SLOTS.iter().filter(named) {
            let fits = |value: &&Value| self.faces_of(slot).all(|f| value.face(f).is_some());
            let with = |filling: &Filling, value| {
                let filled = filling.iter().copied();
                filled.chain([(slot, value)]).collect()
            };
            let more = |f| slot.values.iter().filter(fits).map(move |v| with(f, v));
            all = all.iter().flat_map(more).collect();
        }
        all
    }

    /// Whether it tests triangles for each of many rays.
    pub(crate) fn searches(&self) -> bool {
        self.uses
            .split_whitespace()
            .any(|word| word.starts_with("slab_") || word == "seen")
    }

    /// The whole text.
    pub(crate) fn stitch(
        &self,
        filling: &Filling,
        arithmetic: Arithmetic,
        rests: Rests,
    ) -> Result<String> {
        let mut source = String::new();
        for word in self.uses.split_whitespace() {
            let parts = match place(word) {
                Some(place) => filler(filling, place).with_context(|| format!("no {word}"))?,
                None => std::slice::from_ref(&word),
            };
            for part in parts {
                append(&mut source, part, arithmetic, rests)?;
            }
        }
        Ok(number_bindings(&(source + &self.body)))
    }
}

/// Gives a shared file's `@binding(next)` the number after those of the kernel.
fn number_bindings(source: &str) -> String {
    let taken = source.matches("var<storage").count() - source.matches("@binding(next)").count();
    let mut parts = source.split("@binding(next)");
    let mut numbered = parts.next().unwrap_or_default().to_owned();
    for (i, part) in parts.enumerate() {
        // The parameters have number 0.
        numbered.push_str(&format!("@binding({})", taken + i + 1));
        numbered.push_str(part);
    }
    numbered
}

/// What fills a place.
fn filler(filling: &Filling, (name, face): (&str, &str)) -> Option<&'static [&'static str]> {
    let (_, value) = filling.iter().find(|(slot, _)| slot.name == name)?;
    value.face(face)
}

fn append(source: &mut String, part: &str, arithmetic: Arithmetic, rests: Rests) -> Result<()> {
    let part = match part {
        "ieee" => match arithmetic {
            Arithmetic::Plain => "ieee_plain",
            Arithmetic::Opaque => "ieee_opaque",
        },
        "rest" => match rests {
            Rests::Halves => "rest_halves",
            Rests::Fused => "rest_fused",
        },
        _ => part,
    };
    let path = format!("wgsl/shared/{part}.wgsl");
    source.push_str(&read_to_string(&path).context(path)?);
    source.push('\n');
    Ok(())
}

/// Slot and face of `{slot.face}`.
fn place(word: &str) -> Option<(&str, &str)> {
    word.strip_prefix('{')?.strip_suffix('}')?.split_once('.')
}
