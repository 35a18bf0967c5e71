//! Diagnoses why a GPU cannot be used, and how to fix it.

use crate::backends::{BACKENDS, BackendEntry};
use backend::DeviceKind;
use host::NVIDIA_LIBRARIES;
use std::fs::File;
use std::path::PathBuf;

/// Result of [`doctor`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Diagnosis {
    /// Names of listed GPUs. [`Device::Auto`](crate::Device::Auto) takes the first that it can open.
    pub gpus: Vec<String>,
    /// Problems found if no GPU is listed.
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
/// the drivers of NVIDIA and Mesa. Lists adapters and opens the device files of GPUs, but creates no device.
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

/// Names of the adapters and whether each is a GPU, or the reason why they cannot be listed.
type Adapters = Result<Vec<(String, bool)>, Problem>;

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
    let listed = |gpus: bool| -> Vec<String> {
        let listed = adapters.as_deref().unwrap_or_default().iter();
        let listed = listed.filter(|(_, is_gpu)| *is_gpu == gpus);
        listed.map(|(name, _)| name.clone()).collect()
    };
    let (gpus, mut problems) = (listed(true), Vec::new());
    if !gpus.is_empty() {
        return Diagnosis { gpus, problems };
    }
    let mut say = |what: String, fix: &str| problems.push(Problem::new(what, fix));
    match adapters {
        Err(problem) => say(problem.what.clone(), &problem.fix),
        Ok(_) => say(
            format!(
                "no GPU is listed, only drivers on the host's cores: {}",
                listed(false).join(", ")
            ),
            "install the GPU's own driver (Debian: mesa-vulkan-drivers, or NVIDIA's driver)",
        ),
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
    first_with_gpu(BACKENDS.iter().filter(finds_gpus).map(listed).collect())
}

/// Returns the adapters of the first backend that has a GPU, or else of the first backend.
fn first_with_gpu(all: Vec<Adapters>) -> Adapters {
    let has_gpu = |found: &Adapters| found.as_ref().is_ok_and(|all| all.iter().any(|a| a.1));
    let at = all.iter().position(has_gpu).unwrap_or(0);
    let found = all.into_iter().nth(at);
    found.unwrap_or_else(|| {
        let what = "this program was built without vulkan and wgpu".to_owned();
        Err(Problem::new(
            what,
            "build it with the feature `vulkan` or `wgpu`",
        ))
    })
}

fn listed(entry: &BackendEntry<'_>) -> Adapters {
    let fix = "install a Vulkan loader and driver (Debian: libvulkan1 and mesa-vulkan-drivers, or NVIDIA's driver)";
    let all = entry.adapters();
    let all = all.map_err(|e| Problem::new(e.to_string(), fix))?;
    Ok(all
        .into_iter()
        .map(|a| (a.name, a.kind == DeviceKind::Gpu))
        .collect())
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

    #[test]
    fn listed_gpu_has_no_problems() {
        let adapters = Ok(vec![("H100".to_owned(), true)]);
        assert_eq!(problems(adapters, &[], false), "");
    }

    #[test]
    fn each_problem_suggests_its_fix() {
        let none = || Err(Problem::new("no Vulkan loader".to_owned(), "install one"));
        let software = || Ok(vec![("llvmpipe".to_owned(), false)]);
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
            (first_with_gpu(Vec::new()), &[], "feature `vulkan`"),
        ] {
            let found = problems(adapters, nodes, false);
            assert!(found.contains(says), "{found}");
        }
        let found = problems(software(), &[(nvidia, true)], true);
        assert!(!found.contains("CAPABILITIES"), "{found}");
    }
}
