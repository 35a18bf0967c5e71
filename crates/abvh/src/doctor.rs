//! Diagnoses why a GPU cannot be used, and how to fix it.

use crate::backends::{BACKENDS, BackendEntry};
use backend::{AdapterInfo, DeviceKind};
use host::NVIDIA_LIBRARIES;
use std::fs::File;
use std::path::PathBuf;

/// Result of [`doctor`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Diagnosis {
    /// Names of the GPUs that can be opened. [`Device::Auto`](crate::Device::Auto) takes the first one.
    pub gpus: Vec<String>,
    /// Problems found if no GPU can be opened.
    pub problems: Vec<Problem>,
}

/// A problem, and how to fix it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Description of the problem.
    pub what: String,
    /// Instructions to fix it.
    pub fix: String,
}

impl Problem {
    fn new(what: String, fix: &str) -> Self {
        let fix = fix.to_owned();
        Self { what, fix }
    }
}

/// Checks if a GPU can be used on this machine. If not, returns the problems and how to fix them. On Linux, this covers
/// the drivers of NVIDIA and Mesa. Opens each GPU with each backend.
#[must_use]
pub fn doctor() -> Diagnosis {
    diagnose(&adapters(), &nodes(), has_nvidia_library())
}

/// Folders of driver libraries.
const FOLDERS: [&str; 6] = [
    "/usr/lib/x86_64-linux-gnu",
    "/usr/lib/aarch64-linux-gnu",
    "/usr/lib64",
    "/usr/lib",
    "/usr/local/nvidia/lib64",
    "/usr/lib/nvidia",
];
/// Device files of GPUs: the file of NVIDIA's driver, and the folder of other drivers.
const NVIDIA_NODE: &str = "/dev/nvidiactl";
const NODES: &str = "/dev/dri";

/// The adapters of a backend, or the reason why they cannot be listed.
type Adapters = Result<Vec<ListedAdapter>, Problem>;

/// A listed adapter.
struct ListedAdapter {
    name: String,
    is_gpu: bool,
    /// Reason why the GPU cannot be opened. Other adapters are not opened.
    error: Option<String>,
}

impl ListedAdapter {
    fn is_usable_gpu(&self) -> bool {
        self.is_gpu && self.error.is_none()
    }
}

/// Returns the device files of GPUs, and whether this process may open them.
fn nodes() -> Vec<(PathBuf, bool)> {
    let entries = std::fs::read_dir(NODES).into_iter().flatten().flatten();
    let nodes = entries.map(|entry| entry.path());
    let nodes = nodes.filter(|path| path.to_string_lossy().contains("render"));
    let nvidia = Some(PathBuf::from(NVIDIA_NODE)).filter(|node| node.exists());
    let may_use = |node: &PathBuf| File::options().read(true).write(true).open(node).is_ok();
    let nodes = nodes
        .chain(nvidia)
        .map(|node| (node.clone(), may_use(&node)));
    nodes.collect()
}

fn has_nvidia_library() -> bool {
    let own = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let folders = FOLDERS.map(PathBuf::from).into_iter();
    let folders = folders.chain(std::env::split_paths(&own));
    let mut files = folders.flat_map(|folder| NVIDIA_LIBRARIES.map(|name| folder.join(name)));
    files.any(|file| file.exists())
}

/// Diagnoses a machine from its list of adapters, or the reason why there is none, and from the driver's files.
fn diagnose(adapters: &Adapters, nodes: &[(PathBuf, bool)], has_nvidia_library: bool) -> Diagnosis {
    let listed = adapters.as_deref().unwrap_or_default();
    let names = |is_listed: fn(&&ListedAdapter) -> bool| -> Vec<String> {
        let named = listed.iter().filter(is_listed);
        named.map(|adapter| adapter.name.clone()).collect()
    };
    let (gpus, mut problems) = (names(|a| a.is_usable_gpu()), Vec::new());
    if !gpus.is_empty() {
        return Diagnosis { gpus, problems };
    }
    let mut say = |what: String, fix: &str| problems.push(Problem::new(what, fix));
    for adapter in listed {
        if let Some(error) = &adapter.error {
            let what = format!("{}: {error}", adapter.name);
            say(what, "update the GPU's driver");
        }
    }
    match adapters {
        Err(problem) => say(problem.what.clone(), &problem.fix),
        Ok(all) if !all.iter().any(|a| a.is_gpu) => say(
            format!(
                "no GPU is listed, only drivers on the host's cores: {}",
                names(|_| true).join(", ")
            ),
            "install the GPU's own driver (Debian: mesa-vulkan-drivers, or NVIDIA's driver)",
        ),
        Ok(_) => {}
    }
    for (node, _) in nodes.iter().filter(|(_, may_use)| !may_use) {
        say(
            format!("{} may not be used by this user", node.display()),
            "join the group that owns it (`ls -l` shows it, mostly `render` or `video`), or pass it to the container with --device",
        );
    }
    let has_nvidia = nodes.iter().any(|(node, _)| node.ends_with("nvidiactl"));
    if has_nvidia && !has_nvidia_library {
        say(
            format!("NVIDIA's driver is here without {}", NVIDIA_LIBRARIES[0]),
            "start the container with NVIDIA_DRIVER_CAPABILITIES=graphics,compute, or install the driver's graphics libraries",
        );
    }
    if nodes.is_empty() {
        say(
            format!("no GPU is visible: neither {NODES}/renderD* nor {NVIDIA_NODE} exists"),
            "pass a GPU to the container or virtual machine (docker run --gpus all, or --device /dev/dri)",
        );
    }
    Diagnosis { gpus, problems }
}

fn adapters() -> Adapters {
    let finds_gpus = |entry: &&BackendEntry<'_>| entry.kinds.contains(&DeviceKind::Gpu);
    best(BACKENDS.iter().filter(finds_gpus).map(listed))
}

/// Returns the adapters of the first backend with a usable GPU, else with any GPU, else of the first backend.
fn best(backends: impl Iterator<Item = Adapters>) -> Adapters {
    let deficits = |found: &Adapters| {
        let all = found.as_deref().unwrap_or_default();
        let lacks = |is_it: fn(&ListedAdapter) -> bool| !all.iter().any(is_it);
        [lacks(ListedAdapter::is_usable_gpu), lacks(|a| a.is_gpu)]
    };
    let best = backends.min_by_key(deficits);
    best.unwrap_or_else(|| {
        let what = "this program was built without vulkan and wgpu".to_owned();
        Err(Problem::new(
            what,
            "build it with the feature `vulkan` or `wgpu`",
        ))
    })
}

/// Lists the adapters of a backend, and opens those that are GPUs.
fn listed(entry: &BackendEntry<'_>) -> Adapters {
    let fix = "install a Vulkan loader and driver (Debian: libvulkan1 and mesa-vulkan-drivers, or NVIDIA's driver)";
    let all = entry.adapters();
    let all = all.map_err(|e| Problem::new(e.to_string(), fix))?;
    let adapter = |a: AdapterInfo| {
        let is_gpu = a.kind == DeviceKind::Gpu;
        let opened = is_gpu.then(|| entry.open(Some(&a.index.to_string()), 1));
        ListedAdapter {
            name: a.name,
            is_gpu,
            error: opened.and_then(Result::err),
        }
    };
    Ok(all.into_iter().map(adapter).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(adapters: Adapters, nodes: &[(&str, bool)], has_nvidia_library: bool) -> String {
        let nodes = nodes.iter().map(|(node, may)| (PathBuf::from(node), *may));
        let nodes: Vec<_> = nodes.collect();
        let found = diagnose(&adapters, &nodes, has_nvidia_library);
        let all = found.problems.into_iter();
        all.map(|p| p.what + " -> " + &p.fix + "\n").collect()
    }

    fn adapter(name: &str, is_gpu: bool, error: Option<&str>) -> Adapters {
        Ok(vec![ListedAdapter {
            name: name.to_owned(),
            is_gpu,
            error: error.map(str::to_owned),
        }])
    }

    #[test]
    fn usable_gpu_of_any_backend_has_no_problems() {
        let broken = || adapter("H100", true, Some("quotients are wrong"));
        let software = || adapter("llvmpipe", false, None);
        let usable = || adapter("H100", true, None);
        for backends in [
            vec![usable()],
            vec![broken(), usable()],
            vec![software(), usable()],
        ] {
            assert_eq!(problems(best(backends.into_iter()), &[], false), "");
        }
        let found = problems(best([software(), broken()].into_iter()), &[], false);
        assert!(
            found.contains("H100: quotients are wrong -> update"),
            "{found}"
        );
    }

    #[test]
    fn each_problem_suggests_its_fix() {
        let none = || Err(Problem::new("no Vulkan loader".to_owned(), "install one"));
        let software = || adapter("llvmpipe", false, None);
        let (nvidia, render) = ("/dev/nvidiactl", "/dev/dri/renderD128");
        let capabilities = "NVIDIA_DRIVER_CAPABILITIES=graphics,compute";
        let lists = "only drivers on the host's cores: llvmpipe";
        for (adapters, nodes, says) in [
            (none(), &[][..], "docker run --gpus all"),
            (software(), &[], lists),
            (software(), &[(nvidia, true)], capabilities),
            (
                software(),
                &[(render, false)],
                "renderD128 may not be used by this user",
            ),
            (none(), &[(render, true)], "no Vulkan loader -> install one"),
            (best(std::iter::empty()), &[], "feature `vulkan`"),
        ] {
            let found = problems(adapters, nodes, false);
            assert!(found.contains(says), "{found}");
        }
        let found = problems(software(), &[(nvidia, true)], true);
        assert!(!found.contains("CAPABILITIES"), "{found}");
    }
}
