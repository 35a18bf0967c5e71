//! Backends and adapters: taken by name, left to `auto`, or not there at all.

use crate::bad::npy_of;
use crate::hits::array;
use crate::sandbox::{Run, SQUARE, Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::sync::LazyLock;

/// A backend that a machine may lack.
#[derive(Clone, Copy)]
pub(crate) struct Subject {
    /// Its name on the command line.
    pub(crate) name: &'static str,
    /// Why it cannot run here; asked once.
    absent: &'static LazyLock<Option<String>>,
}

/// All but the host's.
pub(crate) const BACKENDS: [Subject; 2] = [
    Subject {
        name: "vulkan",
        absent: &NO_VULKAN,
    },
    Subject {
        name: "wgpu",
        absent: &NO_WGPU,
    },
];

pub(crate) const HOST: Subject = Subject {
    name: "cpu",
    absent: &NOT_ABSENT,
};

static NO_VULKAN: LazyLock<Option<String>> =
    LazyLock::new(|| gpu_vulkan::adapters().err().map(|e| e.to_string()));
static NO_WGPU: LazyLock<Option<String>> =
    LazyLock::new(|| gpu_wgpu::adapters().err().map(|e| e.to_string()));
static NOT_ABSENT: LazyLock<Option<String>> = LazyLock::new(|| None);

impl Subject {
    /// A trial that shows as ignored, with the reason, where the backend is absent.
    pub(crate) fn trial(
        self,
        name: &str,
        body: impl FnOnce(&Sandbox) -> Result<(), Failed> + Send + 'static,
    ) -> Trial {
        let trial = trial(name, body);
        match self.absent.as_ref() {
            None => trial,
            Some(why) => trial
                .with_kind(format!("absent: {why}"))
                .with_ignored_flag(true),
        }
    }
}

pub(crate) fn trials() -> Vec<Trial> {
    let mut trials = vec![
        trial("devices::info_keeps_its_schema", info),
        trial("devices::auto_says_what_it_took_and_why", says_why),
        trial("devices::adapters_of_no_backend_are_refused", no_adapter),
        trial("devices::without_a_driver", |s| lacking(s, &NO_DRIVER)),
        trial("devices::no_window_system_is_asked_for", windowless),
        trial("devices::rays_that_are_none_miss", invalid_rays),
    ];
    if cfg!(target_os = "linux") {
        trials.push(trial("devices::without_a_loader", without_a_loader));
    }
    for backend in BACKENDS.into_iter().chain([HOST]) {
        let name = |what: &str| format!("devices::{}::{what}", backend.name);
        let of = |what: &str, body: fn(&Sandbox, &str) -> Result<(), Failed>| {
            backend.trial(&name(what), move |s| body(s, backend.name))
        };
        trials.push(of("it_can_do_what_info_lists_and_no_more", methods));
        trials.push(of("adapters_are_found_or_listed", adapters));
    }
    for backend in BACKENDS {
        let name = format!("devices::{}::trees_made_on_it_change_no_hit", backend.name);
        trials.push(backend.trial(&name, move |s| trees_made_there(s, backend.name)));
    }
    trials.push(trial("devices::the_host_makes_no_trees_on_a_device", |s| {
        let run = s.run(&format!("{RENDER} --backend cpu --update device-rebuild"));
        run.fails(2, &["cpu does not support trees made on the device"])
    }));
    trials
}

/// The same files as with trees of the host's, and a time for each tree.
fn trees_made_there(sandbox: &Sandbox, backend: &str) -> Result<(), Failed> {
    let words = "render demo:collide:2000 --frames 4 --size 40x30 --no-images --quiet";
    let with = |options: &str| sandbox.run(&format!("{words} {options}")).succeeds();
    with("--backend cpu --update rebuild --hits host")?;
    with(&format!(
        "--backend {backend} --update device-rebuild --hits made --stats s.json"
    ))?;
    for frame in 0..4 {
        let [a, b] = ["host", "made"].map(|d| sandbox.read(&format!("{d}/hits_{frame:04}.npz")));
        ensure(a == b, || format!("frame {frame} differs"))?;
    }
    let stats = sandbox.json("s.json")?;
    let frames = stats["frames"].as_array().ok_or("no frames")?;
    let made = |f: &&Value| f["adopted"] == true && f["tree_age_frames"] == 0;
    let count = frames.iter().filter(made).count();
    ensure(count == 4, || format!("{count} trees"))
}

/// Libraries of window systems complain on standard error where theirs does not run.
fn windowless(sandbox: &Sandbox) -> Result<(), Failed> {
    let [display, folder] = ["wayland-0", ""].map(OsStr::new);
    let nowhere = [("WAYLAND_DISPLAY", display), ("XDG_RUNTIME_DIR", folder)];
    let run = sandbox.run_where("info", &nowhere).succeeds()?;
    ensure(run.stderr.is_empty(), || run.stderr)
}

const RENDER: &str = "render demo:twist:100 --frames 1 --size 8x8 --no-images";

fn parsed(run: Run) -> Result<Value, Failed> {
    Ok(serde_json::from_str(&run.succeeds()?.stdout)?)
}

/// The entry of a list whose `key` is `value`.
fn entry<'a>(list: &'a Value, key: &str, value: &str) -> Result<&'a Value, Failed> {
    let all = list.as_array().map_or(&[][..], Vec::as_slice);
    let found = all.iter().find(|e| e[key] == value);
    found.ok_or_else(|| format!("no {key} {value} in {list}").into())
}

fn info(sandbox: &Sandbox) -> Result<(), Failed> {
    let info = parsed(sandbox.run("info --json"))?;
    ensure(
        info["schema"] == 1 && info["auto"]["why"].is_string(),
        || info.to_string(),
    )?;
    for name in ["cpu", "vulkan", "wgpu"] {
        let backend = entry(&info["backends"], "backend", name)?;
        let adapters = backend["adapters"].as_array().map_or(0, Vec::len);
        ensure(backend["absent"].is_string() == (adapters == 0), || {
            backend.to_string()
        })?;
        for i in 0..adapters {
            let adapter = &backend["adapters"][i];
            let kind = adapter["kind"].as_str().unwrap_or_default();
            ensure(
                adapter["index"] == i && ["gpu", "cpu", "software"].contains(&kind),
                || adapter.to_string(),
            )?;
        }
    }
    let text = sandbox.run("info").succeeds()?.stdout;
    ensure(text.lines().all(|l| l.chars().count() <= 100), || text)
}

/// The same on standard error, in the statistics, and as `info` and `inspect` foretell.
fn says_why(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox
        .run(&format!("{RENDER} --stats s.json"))
        .succeeds()?;
    let stats = sandbox.json("s.json")?;
    let taken = entry(&stats["auto"], "what", "backend")?;
    ensure(taken["takes"] == stats["backend"], || stats.to_string())?;
    let [takes, why] = ["takes", "why"].map(|key| taken[key].as_str().unwrap_or_default());
    let remark = format!("backend auto takes {takes}: {why}");
    ensure(run.stderr.lines().any(|l| l == remark), || run.stderr)?;
    ensure(
        &parsed(sandbox.run("info --json"))?["auto"] == taken,
        || format!("info foretells something other than {taken}"),
    )?;
    let inspected = parsed(sandbox.run("inspect demo:twist:100 --json"))?;
    ensure(
        entry(&inspected["auto"], "what", "backend")? == taken,
        || inspected.to_string(),
    )
}

fn no_adapter(sandbox: &Sandbox) -> Result<(), Failed> {
    let run = sandbox.run(&format!("{RENDER} --adapter voodoo"));
    run.fails(2, &["backend has an adapter 'voodoo'", "cpu 0: host"])
}

const NOWHERE: &str = "/nonexistent";
const NO_DRIVER: [(&str, &str); 2] = [("VK_DRIVER_FILES", NOWHERE), ("VK_ICD_FILENAMES", NOWHERE)];

/// A file that is no library stands where the loader would be found first.
fn without_a_loader(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("lib/libvulkan.so.1", "");
    let folder = sandbox.path().join("lib");
    let folder = folder.to_str().ok_or("a temporary folder has a name")?;
    lacking(sandbox, &[("LD_LIBRARY_PATH", folder)])
}

/// Where graphics drivers are out of reach, the host renders, and nobody stands in for a backend that was named.
fn lacking(sandbox: &Sandbox, variables: &[(&str, &str)]) -> Result<(), Failed> {
    // Metal and DirectX 12 need no Vulkan.
    let wgpu_too = cfg!(target_os = "linux");
    let variables: Vec<_> = (variables.iter())
        .map(|&(name, value)| (name, OsStr::new(value)))
        .collect();
    let run = |words: &str| sandbox.run_where(words, &variables);
    let info = parsed(run("info --json"))?;
    let reason = entry(&info["backends"], "backend", "vulkan")?["absent"].as_str();
    let reason = reason.ok_or_else(|| info.to_string())?;
    run(&format!("{RENDER} --backend vulkan"))
        .fails(2, &["backend vulkan cannot run: no device", reason])?;
    if !wgpu_too {
        return Ok(());
    }
    run(&format!("{RENDER} --backend wgpu")).fails(2, &["backend wgpu cannot run: no device"])?;
    let rendered = run(&format!("{RENDER} --hits h")).succeeds()?;
    let remark = format!("backend auto takes cpu: vulkan cannot run: {reason}");
    ensure(rendered.stderr.contains(&remark), || rendered.stderr)?;
    ensure(info["auto"]["takes"] == "cpu", || info.to_string())?;
    array::<u32>(sandbox, "h/hits_0000.npz", "triangle").map(|_| ())
}

/// What `info` lists can be had, and that is all there is.
fn methods(sandbox: &Sandbox, backend: &str) -> Result<(), Failed> {
    let info = parsed(sandbox.run("info --json"))?;
    let lists = entry(&info["backends"], "backend", backend)?;
    let intersectors = ["moller-trumbore", "woop", "watertight", "exact"];
    let complete =
        lists["intersectors"] == json!(intersectors) && lists["layouts"] == json!(["bvh2", "fast"]);
    ensure(complete, || lists.to_string())?;
    for (intersector, layout) in intersectors.iter().zip(["bvh2", "fast", "bvh2", "fast"]) {
        let words = format!("--intersector {intersector} --layout {layout}");
        sandbox
            .run(&format!("{RENDER} --backend {backend} {words}"))
            .succeeds()?;
    }
    ensure(sandbox.files().is_empty(), || "it left files".to_owned())
}

fn adapters(sandbox: &Sandbox, backend: &str) -> Result<(), Failed> {
    let info = parsed(sandbox.run("info --json"))?;
    let adapters = &entry(&info["backends"], "backend", backend)?["adapters"];
    let name = adapters[0]["name"]
        .as_str()
        .ok_or("an adapter has a name")?;
    let render =
        |adapter: &str| sandbox.run(&format!("{RENDER} --backend {backend} --adapter {adapter}"));
    let stdout = render("0").succeeds()?.stdout;
    ensure(stdout.contains(name), || stdout)?;
    for none in ["999999", "voodoo"] {
        let says = format!("backend {backend} has no adapter '{none}'; there is 0: {name}");
        render(none).fails(2, &[&says])?;
    }
    Ok(())
}

/// Rays without a direction, with one that is infinite, from nowhere: all miss. The last one hits.
fn invalid_rays(sandbox: &Sandbox) -> Result<(), Failed> {
    let (inf, nan) = (f32::INFINITY, f32::NAN);
    let rays = [
        [0.6, 0.3, 1.0, 0.0, 0.0, 0.0],
        [0.6, 0.3, 1.0, 0.0, 0.0, -inf],
        [0.6, 0.3, 1.0, nan, 0.0, -1.0],
        [nan, 0.3, 1.0, 0.0, 0.0, -1.0],
        [0.6, inf, 1.0, 0.0, 0.0, -1.0],
        [0.6, 0.3, 1.0, 0.0, 0.0, -1.0],
    ];
    let bytes: Vec<u8> = rays
        .iter()
        .flatten()
        .flat_map(|x: &f32| x.to_le_bytes())
        .collect();
    sandbox.write("rays.npy", npy_of("<f4", "(6, 6)", &bytes));
    sandbox.write("a.obj", SQUARE);
    let words = "trace a.obj --time 0 --rays rays.npy --out hits.npz --backend cpu";
    sandbox.run(words).succeeds()?;
    let (_, triangles) = array::<u32>(sandbox, "hits.npz", "triangle")?;
    let miss = u32::MAX;
    ensure(triangles == [miss, miss, miss, miss, miss, 0], || {
        format!("{triangles:?}")
    })?;
    sandbox.run(&format!("{words} --any-hit")).succeeds()?;
    let (_, hit) = array::<u8>(sandbox, "hits.npz", "hit")?;
    ensure(hit == [0, 0, 0, 0, 0, 1], || format!("{hit:?}"))
}
