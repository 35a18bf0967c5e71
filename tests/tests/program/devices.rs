//! Backends and adapters that are named, chosen by `auto`, or absent.

use crate::files::array;
use crate::sandbox::{Sandbox, assert_contains, list, trial};
use backend::BackendName;
use integration::device_trial;
use libtest_mimic::Trial;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::sync::LazyLock;

/// Names of all backends except the host's. Either may be absent.
pub(crate) const BACKENDS: [&str; 2] = ["vulkan", "wgpu"];
pub(crate) const HOST: &str = "cpu";

/// Reasons why backends are absent, by name.
static ABSENT: LazyLock<BTreeMap<&str, String>> = LazyLock::new(|| {
    let found = [gpu_vulkan::adapters(), gpu_wgpu::adapters()];
    let all = BACKENDS.into_iter().zip(found);
    let absent = all.filter_map(|(backend, found)| Some((backend, found.err()?.to_string())));
    absent.collect()
});

/// Creates a test of a backend. If the backend is absent, the test is ignored with the reason, or fails if the backend
/// is required.
pub(crate) fn backend_trial(
    what: &str,
    backend: &'static str,
    body: impl FnOnce(&Sandbox, &str) + Send + 'static,
) -> Trial {
    let name = format!("{what}::{backend}");
    let absent = ABSENT.get(backend).map(|why| format!("absent: {why}"));
    device_trial(name, backend, absent, move || {
        body(&Sandbox::new(), backend);
    })
}

pub(crate) fn trials() -> Vec<Trial> {
    let mut trials = vec![
        trial("devices::info_keeps_its_schema", info),
        trial("devices::auto_reports_choice_and_reason", says_why),
        trial("devices::without_a_driver", |s| {
            without_a_driver(s, &NO_DRIVER)
        }),
    ];
    if cfg!(target_os = "linux") {
        trials.push(trial("devices::without_a_loader", without_a_loader));
    }
    let all = BackendName::ALL.map(BackendName::name);
    trials.extend(all.map(|b| backend_trial("devices::listed_choices_are_usable", b, as_listed)));
    trials
}

const RENDER: &str = "render demo:twist:100 --frames 1 --size 8x8 --no-images";

/// Returns the entry of a list whose `key` is `value`.
fn entry<'a>(all: &'a Value, key: &str, value: &str) -> &'a Value {
    let found = list(all).iter().find(|e| e[key] == value);
    found.unwrap_or_else(|| panic!("no {key} {value} in {all}"))
}

fn info(sandbox: &Sandbox) {
    let info = sandbox.run("info --json").parsed();
    let says_why = info["auto"]["why"].is_string();
    assert!(info["schema"] == 1 && says_why, "{info}");
    for name in BackendName::ALL.map(BackendName::name) {
        let backend = entry(&info["backends"], "backend", name);
        let adapters = list(&backend["adapters"]);
        let is_absent = backend["absent"].is_string();
        assert!(is_absent == adapters.is_empty(), "{backend}");
        for (i, adapter) in adapters.iter().enumerate() {
            let kind = adapter["kind"].as_str().unwrap_or_default();
            let known = ["gpu", "cpu", "software"].contains(&kind);
            assert!(adapter["index"] == i && known, "{adapter}");
        }
    }
    let all = list(&info["backends"]).iter();
    let mut adapters = all.flat_map(|backend| list(&backend["adapters"]));
    let doctor = sandbox.run("doctor");
    match adapters.any(|adapter| adapter["kind"] == "gpu") {
        true => assert_contains(&doctor.succeeds().stdout, "usable GPUs:"),
        false => {
            assert_contains(&doctor.stdout, "missing:|fix:");
            doctor.fails(1, &["no GPU can be used here"]);
        }
    }
    // Without a display, window system libraries print complaints to standard error, which must not appear.
    let [display, folder] = ["wayland-0", ""].map(OsStr::new);
    let nowhere = [("WAYLAND_DISPLAY", display), ("XDG_RUNTIME_DIR", folder)];
    let run = sandbox.run_where("info", &nowhere).succeeds();
    assert_eq!(run.stderr, "");
    assert_contains(&run.stdout, "auto chooses|cpu-ref|adapter 0|[cpu]");
    let mut lines = run.stdout.lines();
    assert!(lines.all(|l| l.chars().count() <= 100), "{}", run.stdout);
}

/// Checks that standard error, the statistics, `info` and `inspect` name the same choice and reason.
fn says_why(sandbox: &Sandbox) {
    let (run, stats) = sandbox.run_json(RENDER, "--stats");
    let taken = entry(&stats["auto"], "what", "backend");
    assert!(taken["takes"] == stats["backend"], "{stats}");
    let [takes, why] = ["takes", "why"].map(|key| taken[key].as_str().unwrap_or_default());
    let remark = format!("auto chooses backend {takes}: {why}");
    assert!(run.stderr.lines().any(|l| l == remark), "{}", run.stderr);
    assert_eq!(&sandbox.run("info --json").parsed()["auto"], taken);
    let inspected = sandbox.run("inspect demo:twist:100 --json").parsed();
    assert_eq!(entry(&inspected["auto"], "what", "backend"), taken);
}

const NOWHERE: &str = "/nonexistent";
const NO_DRIVER: [(&str, &str); 2] = [("VK_DRIVER_FILES", NOWHERE), ("VK_ICD_FILENAMES", NOWHERE)];

/// Puts an empty `libvulkan.so.1` first in the search path of the dynamic linker, so that the Vulkan loader cannot be
/// loaded.
fn without_a_loader(sandbox: &Sandbox) {
    sandbox.write("lib/libvulkan.so.1", "");
    let folder = sandbox.path().join("lib");
    without_a_driver(sandbox, &[("LD_LIBRARY_PATH", folder.to_str().unwrap())]);
}

/// Checks that the host renders without graphics drivers, and that a named backend is never replaced by another one.
fn without_a_driver(sandbox: &Sandbox, variables: &[(&str, &str)]) {
    let variables = variables.iter();
    let variables: Vec<_> = variables.map(|&(n, v)| (n, OsStr::new(v))).collect();
    let run = |words: &str| sandbox.run_where(words, &variables);
    let info = run("info --json").parsed();
    let vulkan = entry(&info["backends"], "backend", "vulkan");
    let reason = vulkan["absent"].as_str().unwrap();
    let says = ["backend vulkan cannot run: no device", reason];
    run(&format!("{RENDER} --backend vulkan")).fails(2, &says);
    // Metal and DirectX 12 need no Vulkan.
    if cfg!(not(target_os = "linux")) {
        return;
    }
    run(&format!("{RENDER} --backend wgpu")).fails(2, &["backend wgpu cannot run: no device"]);
    let rendered = run(&format!("{RENDER} --hits h")).succeeds();
    let remark = format!("auto chooses backend cpu: vulkan cannot run: {reason}");
    assert!(rendered.stderr.contains(&remark), "{}", rendered.stderr);
    assert!(info["auto"]["takes"] == "cpu", "{info}");
    array::<u32>(sandbox, "h/hits_0000.npz", "triangle");
}

/// Checks that every intersector and the first adapter can be used, and that unknown adapters are refused.
fn as_listed(sandbox: &Sandbox, backend: &str) {
    let info = sandbox.run("info --json").parsed();
    let lists = entry(&info["backends"], "backend", backend);
    let intersectors = ["moller-trumbore", "woop", "watertight", "exact"];
    let adapter = lists["adapters"][0]["name"].as_str().unwrap();
    let render = format!("{RENDER} --backend {backend} --adapter");
    for intersector in intersectors {
        let how = format!("0 --intersector {intersector}");
        let stdout = sandbox.run_ok(&format!("{render} {how}")).stdout;
        assert!(stdout.contains(adapter), "{stdout}");
    }
    assert!(sandbox.files().is_empty(), "it left files");
    for none in ["999999", "voodoo"] {
        let says = format!("{backend} has no adapter '{none}'; there is 0: {adapter}");
        sandbox.assert_refused(&format!("{render} {none}"), &[&says]);
    }
}
