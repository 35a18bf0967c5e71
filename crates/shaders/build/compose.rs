//! Composes a kernel from its file and its imports: plain WGSL with one entry point, without unused declarations.

use anyhow::{Context, Result, anyhow};
use std::collections::BTreeMap;
use std::fs::read_to_string;
use std::path::Path;
use wesl::syntax::{ModulePath, PathOrigin};
use wesl::{CompileOptions, Feature, Features, Mangler, NoMangler, VirtualResolver};

/// Keeps all names: hosts find buffers by name, and each name has one meaning in all files.
pub(crate) const KEPT: NoMangler = NoMangler;

pub(crate) struct Sources {
    /// Contents of all files, by path relative to the folder `wgsl` and without extension.
    pub(crate) files: BTreeMap<String, String>,
    /// All conditions that the files may use.
    pub(crate) conditions: Vec<String>,
}

impl Sources {
    pub(crate) fn read(root: &Path) -> Result<Self> {
        let (mut files, conditions) = (BTreeMap::new(), Vec::new());
        for folder in root.read_dir().context("wgsl")? {
            for file in folder?.path().read_dir().context("a folder in wgsl")? {
                let path = file?.path();
                let name = path.strip_prefix(root)?.with_extension("");
                let text = read_to_string(&path).with_context(|| path.display().to_string())?;
                files.insert(name.to_string_lossy().into_owned(), text);
            }
        }
        Ok(Self { files, conditions })
    }

    /// Returns the entry points of a file with everything they use, where the conditions `on` hold. `mangler` renames
    /// declarations of other files.
    pub(crate) fn compose(
        &self,
        file: &str,
        entries: &[&str],
        mangler: &impl Mangler,
        on: &[&str],
    ) -> Result<String> {
        let mut resolver = VirtualResolver::new();
        for (name, text) in &self.files {
            resolver.add_module(module(name), text.into());
        }
        let flag = |name: &String| (name.clone(), Feature::from(on.contains(&name.as_str())));
        let options = CompileOptions {
            imports: true,
            condcomp: true,
            generics: false,
            strip: true,
            lower: false,
            validate: false,
            lazy: true,
            mangle_root: false,
            keep: Some(entries.iter().map(|e| (*e).to_owned()).collect()),
            keep_root: false,
            features: Features {
                default: Feature::Error,
                flags: self.conditions.iter().map(flag).collect(),
            },
        };
        let made = wesl::compile(&module(file), &resolver, mangler, &options);
        let made = made.map_err(|e| anyhow!("{e}"))?;
        Ok(number_bindings(&made.syntax.to_string()))
    }
}

fn module(name: &str) -> ModulePath {
    let parts = name.split('/').map(str::to_owned);
    ModulePath::new(PathOrigin::Absolute, parts.collect())
}

/// Numbers each `@binding(next)`, from 1 on. Binding 0 holds the parameters.
fn number_bindings(source: &str) -> String {
    let mut parts = source.split("@binding(next)");
    let first = parts.next().unwrap_or_default().to_owned();
    let number = |all, (part, i)| format!("{all}@binding({i}){part}");
    parts.zip(1..).fold(first, number)
}
