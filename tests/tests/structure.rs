//! Tests the structure that ARCHITECTURE.md describes: the dependencies between crates, the number of files that name
//! one backend, policy, intersector or rival, the number of methods of the device traits, and imports between modules.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Crates, each with all crates of the workspace that it may depend on. The prefix `abvh-` is left out.
const EDGES: &str = "
geom:
host:
bvh-build: geom
bvh-layout: bvh-build geom
backend: bvh-layout geom
scene: geom host
shaders: backend bvh-build bvh-layout geom
cpu-ref: backend bvh-build bvh-layout geom
cpu-simd: backend bvh-build bvh-layout cpu-ref geom
gpu-common: backend bvh-layout geom host shaders
gpu-vulkan: backend geom gpu-common host shaders
gpu-wgpu: backend geom gpu-common shaders
pipeline: backend bvh-build bvh-layout geom
output: backend geom host pipeline
conformance: backend bvh-build bvh-layout geom scene
rivals: backend cpu-ref geom gpu-common gpu-vulkan host shaders
abvh: backend cpu-ref cpu-simd geom gpu-common gpu-vulkan gpu-wgpu host pipeline scene
cli: abvh backend conformance geom host output pipeline rivals scene
";

/// Kinds of choice, such as the backend. Each has one example value, spelled in two ways, and the maximum number of
/// files below `crates/`, outside tests, that may contain a spelling.
const CHOICES: [(&str, [&str; 2], usize); 4] = [
    ("backend", ["BackendName::CpuRef", "Self::CpuRef"], 5),
    ("intersector", ["MollerTrumbore", "moller-trumbore"], 6),
    ("policy", ["DeviceRebuild", "device-rebuild"], 5),
    ("rival", ["vulkan-rt", "vulkan_rt"], 0),
];

/// Traits, each with its file and the most methods that it may have.
const TRAITS: [(&str, &str, usize); 2] = [
    ("Backend", "crates/backend/src/lib.rs", 22),
    ("GpuDevice", "crates/gpu-common/src/device.rs", 20),
];

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn short(name: &str) -> &str {
    name.strip_prefix("abvh-").unwrap_or(name)
}

#[test]
fn crates_depend_only_on_crates_below() {
    let metadata = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--no-deps",
            "--offline",
            "--format-version",
            "1",
        ])
        .current_dir(root())
        .output()
        .unwrap();
    let metadata: Value = serde_json::from_slice(&metadata.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let rows = EDGES.lines().filter_map(|line| line.split_once(':'));
    let allowed: Vec<(&str, Vec<&str>)> = rows
        .map(|(name, below)| (name, below.split_whitespace().collect()))
        .collect();
    for package in packages {
        let name = short(package["name"].as_str().unwrap());
        // These test the other crates.
        if ["integration", "benches"].contains(&name) {
            continue;
        }
        let row = allowed.iter().find(|(of, _)| *of == name);
        let (_, below) = row.unwrap_or_else(|| panic!("{name} is not in the table"));
        for dependency in package["dependencies"].as_array().unwrap() {
            let other = short(dependency["name"].as_str().unwrap());
            let is_ours = allowed.iter().any(|(of, _)| *of == other);
            if dependency["kind"].is_null() && is_ours {
                assert!(below.contains(&other), "{name} must not depend on {other}");
            }
        }
    }
    // A crate may depend only on crates in earlier rows, so that there is no cycle.
    for (i, (name, below)) in allowed.iter().enumerate() {
        let is_earlier = |other: &&str| allowed[..i].iter().any(|(of, _)| of == other);
        assert!(below.iter().all(is_earlier), "{name}");
    }
}

/// Appends all files of Rust and WGSL below `folder` to `found`, except tests and examples.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy();
        let is_test =
            ["tests", "testing", "examples"].contains(&&*name) || name.ends_with("_tests");
        let is_source = path.extension().is_some_and(|e| e == "rs" || e == "wgsl");
        if path.is_dir() && !is_test {
            sources(&path, found);
        } else if is_source && !is_test {
            found.push(path);
        }
    }
}

/// Returns the text of a file, without unit tests at its end.
fn product(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let product = text.split("\n#[cfg(test)]\nmod ").next();
    product.unwrap_or_default().to_owned()
}

#[test]
fn few_files_name_one_choice() {
    let mut files = Vec::new();
    sources(&root().join("crates"), &mut files);
    assert!(files.len() > 300, "{} files", files.len());
    for (choice, names, most) in CHOICES {
        let knows = |path: &&PathBuf| {
            let product = product(path);
            names.iter().any(|name| product.contains(name))
        };
        let found: Vec<_> = files.iter().filter(knows).collect();
        assert!(found.len() <= most, "{choice}: {found:#?}");
    }
}

#[test]
fn device_traits_do_not_grow() {
    for (name, file, most) in TRAITS {
        let text = fs::read_to_string(root().join(file)).unwrap();
        let begin = text.find(&format!("pub trait {name}")).unwrap();
        let body = text[begin..].split("\n}").next().unwrap_or_default();
        let methods = body.matches("\n    fn ").count();
        assert!(
            (10..=most).contains(&methods),
            "{name} has {methods} methods"
        );
    }
}

/// The path of a module in its crate. It is empty for the crate root.
type Module = Vec<String>;

/// Returns the paths that follow `keyword` in a file: one, or those of a list in braces.
fn paths_after(keyword: &str, text: &str) -> Vec<Module> {
    let mut paths = Vec::new();
    for (at, _) in text.match_indices(keyword) {
        let is_whole_word = !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let rest = &text[at + keyword.len()..];
        let list = match rest.strip_prefix('{') {
            Some(list) => list
                .split('}')
                .next()
                .unwrap_or_default()
                .split(',')
                .collect(),
            None => vec![rest],
        };
        let names = |path: &str| {
            let end = path.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
            let path = &path[..end.unwrap_or(path.len())];
            path.split("::").map(str::to_owned).collect()
        };
        paths.extend(
            list.iter()
                .filter(|_| is_whole_word)
                .map(|path| names(path.trim())),
        );
    }
    paths
}

/// Returns the modules of a crate, each with the modules that it names by `crate::` or `super::`.
fn imports(src: &Path) -> BTreeMap<Module, BTreeSet<Module>> {
    let mut files = Vec::new();
    sources(src, &mut files);
    let module = |path: &PathBuf| {
        let path = path.strip_prefix(src).unwrap().with_extension("");
        let names = path.iter().map(|name| name.to_string_lossy().into_owned());
        let names = names.filter(|name| !["mod", "lib", "main"].contains(&name.as_str()));
        names.collect::<Module>()
    };
    let modules: BTreeSet<Module> = files.iter().map(module).collect();
    let imported = |path: &PathBuf| {
        let (own, text) = (module(path), product(path));
        let is_code = |line: &&str| !line.trim_start().starts_with("//");
        let code: String = text.lines().filter(is_code).collect::<Vec<_>>().join("\n");
        let parent = own[..own.len().saturating_sub(1)].to_vec();
        let of_crate = paths_after("crate::", &code).into_iter();
        let of_parent = paths_after("super::", &code).into_iter();
        let of_parent = of_parent.map(|path| [parent.clone(), path].concat());
        // The longest beginning of a path that is a module. The rest of the path is an item.
        let longest = |path: Module| {
            let beginnings = (1..=path.len()).rev().map(|n| path[..n].to_vec());
            beginnings
                .into_iter()
                .find(|module| modules.contains(module))
        };
        let found = of_crate.chain(of_parent).filter_map(longest);
        let others = found.filter(|module| *module != own).collect();
        (own.clone(), others)
    };
    files.iter().map(imported).collect()
}

#[test]
fn module_imports_have_no_cycles() {
    let folders = fs::read_dir(root().join("crates")).unwrap();
    for folder in folders {
        let src = folder.unwrap().path().join("src");
        let mut modules = imports(&src);
        assert!(!modules.is_empty(), "{}", src.display());
        // Modules without imports are in no cycle. Removes them until none is left.
        while let Some(leaf) = modules.iter().find(|(_, imports)| imports.is_empty()) {
            let leaf = leaf.0.clone();
            modules.remove(&leaf);
            for imports in modules.values_mut() {
                imports.remove(&leaf);
            }
        }
        assert!(
            modules.is_empty(),
            "{}: cycles in {modules:#?}",
            src.display()
        );
    }
}
