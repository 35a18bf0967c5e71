//! The one place that names backends.

mod auto;
mod each;

use crate::adapters::{self, Adapter};
use crate::args::BackendName;
pub(crate) use crate::args::has_own_trees;
use crate::stop::Stop;
use backend::{Backend, DeviceKind, Intersector, Layout};
use gpu_vulkan_rt::Prefer;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Opens an adapter, or the backend's own choice; with host threads, where it uses them.
type OpenAdapter<'a> = dyn Fn(Option<&Adapter>, usize) -> backend::Result<Box<dyn Backend>> + 'a;

/// A backend of this program.
struct Known<'a> {
    name: BackendName,
    text: &'static str,
    /// Why it has its place in the list.
    place: &'static str,
    kinds: &'static [DeviceKind],
    /// The one that finds every GPU which this one could find.
    covered_by: Option<&'static str>,
    list: &'a dyn Fn() -> backend::Result<Vec<Adapter>>,
    open: &'a OpenAdapter<'a>,
}

const ON_DRIVERS: &[DeviceKind] = &[DeviceKind::Gpu, DeviceKind::Software];

/// Where wgpu has but Vulkan to go through.
const WGPU_IS_VULKAN: bool = cfg!(not(any(windows, target_vendor = "apple")));

/// All there are. Among backends that offer the same kind of device, `auto` tries them in this order. It takes none that
/// makes trees in ways of its own, though that may be the fastest where hardware traces: it only says so.
const KNOWN: [Known<'static>; 5] = [
    Known {
        name: BackendName::Vulkan,
        text: "vulkan",
        place: "vulkan comes before wgpu: trees and vertices travel on a queue of their own",
        kinds: ON_DRIVERS,
        covered_by: None,
        list: &each::list_vulkan,
        open: &|adapter, _| each::open_vulkan(adapter),
    },
    Known {
        name: BackendName::Wgpu,
        text: "wgpu",
        place: "wgpu is next after vulkan",
        kinds: ON_DRIVERS,
        covered_by: if WGPU_IS_VULKAN { Some("vulkan") } else { None },
        list: &each::list_wgpu,
        open: &|adapter, _| each::open_wgpu(adapter, false),
    },
    Known {
        name: BackendName::Cpu,
        text: "cpu",
        place: "the host is always there",
        kinds: &[DeviceKind::Cpu],
        covered_by: None,
        list: &each::list_cpu,
        open: &|_, threads| each::open_cpu(threads),
    },
    VULKAN_RT,
    Known {
        name: BackendName::VulkanRtFastTrace,
        text: "vulkan-rt:fast-trace",
        open: &|adapter, _| each::open_vulkan_rt(adapter, Prefer::FastTrace),
        ..VULKAN_RT
    },
];

const VULKAN_RT: Known<'static> = Known {
    name: BackendName::VulkanRt,
    text: "vulkan-rt",
    place: "it is there to be measured against",
    kinds: ON_DRIVERS,
    covered_by: None,
    list: &each::list_vulkan_rt,
    open: &|adapter, _| each::open_vulkan_rt(adapter, Prefer::FastBuild),
};

/// What is to be opened.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Want<'a> {
    /// Backend.
    pub(crate) backend: BackendName,
    /// Adapter of the backend, by index or by part of its name.
    pub(crate) adapter: Option<&'a str>,
    /// Host threads of a backend that computes on them.
    pub(crate) threads: usize,
}

/// What was opened, and why `auto` took it.
#[derive(Debug)]
pub(crate) struct Opened<T> {
    /// As it was made ready.
    pub(crate) value: T,
    /// The reason; `None` if it was asked for by name.
    pub(crate) why: Option<String>,
}

/// Opens a backend and makes it ready. Never takes another than the one named;
/// `auto` passes over those that cannot be made ready.
///
/// # Errors
/// The backend named cannot run, or there is no such adapter.
pub(crate) fn open<T>(
    want: &Want<'_>,
    ready: impl Fn(Box<dyn Backend>) -> Result<T, Stop>,
) -> Result<Opened<T>, Stop> {
    if let Some(known) = KNOWN.iter().find(|k| k.name == want.backend) {
        let value = ready(known.open_named(want)?)?;
        return Ok(Opened { value, why: None });
    }
    let ours: Vec<_> = KNOWN.iter().filter(|k| !has_own_trees(k.name)).collect();
    let traces = |adapter: &Adapter| {
        let able = each::list_vulkan_rt();
        able.is_ok_and(|able| answers_rays(&able, adapter))
    };
    let (value, why) = auto::take(&ours, want, &traces, ready)?;
    let why = Some(why);
    Ok(Opened { value, why })
}

/// Whether compiled kernels are kept in the user's folder for caches.
static KEEPS_KERNELS: AtomicBool = AtomicBool::new(true);

/// Has compiled kernels be neither read from the user's folder for caches nor kept there.
pub(crate) fn keep_no_kernels() {
    KEEPS_KERNELS.store(false, Ordering::Relaxed);
}

fn cache_folder() -> Option<PathBuf> {
    let folder = dirs::cache_dir().filter(|_| KEEPS_KERNELS.load(Ordering::Relaxed));
    folder.map(|folder| folder.join("abvh"))
}

/// Loads graphics drivers on a thread of its own, which takes long: what is opened then finds them loaded. Whoever drops
/// the result waits for it, since drivers do not like a process to end meanwhile.
pub(crate) fn load_drivers(backend: BackendName) -> Option<impl Sized> {
    struct Loading(Option<JoinHandle<()>>);
    impl Drop for Loading {
        fn drop(&mut self) {
            let _ = self.0.take().map(JoinHandle::join);
        }
    }
    // Whoever opens a backend hears what is wrong.
    let load = || drop(gpu_vulkan::adapters());
    let wanted = backend != BackendName::Cpu;
    let thread = wanted.then(|| std::thread::Builder::new().spawn(load).ok());
    thread.map(Loading)
}

impl Known<'_> {
    fn open_named(&self, want: &Want<'_>) -> Result<Box<dyn Backend>, Stop> {
        let absent = |e| Stop::bad(format!("backend {} cannot run: {e}", self.text));
        let list = want.adapter.map(|_| (self.list)()).transpose();
        let list = list.map_err(absent)?;
        let adapter = match want.adapter.zip(list.as_ref()) {
            Some((asked, list)) => Some(adapters::find_one(self.text, list, asked)?),
            None => None,
        };
        (self.open)(adapter, want.threads).map_err(absent)
    }
}

/// Whether a backend can run here, and what it can do.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Presence {
    /// Its name on the command line.
    pub(crate) backend: &'static str,
    /// Why it cannot run; `None` if it can.
    pub(crate) absent: Option<String>,
    /// What it can run on.
    pub(crate) adapters: Vec<Adapter>,
    /// The intersectors it knows.
    pub(crate) intersectors: Vec<&'static str>,
    /// The layouts it knows.
    pub(crate) layouts: Vec<&'static str>,
    /// Whether it makes and traces trees in ways of its own.
    pub(crate) own_trees: bool,
}

/// All backends, present or absent, in the order in which `auto` looks at them.
pub(crate) fn presences() -> Vec<Presence> {
    let presence = |known: &Known<'_>| {
        let found = (known.list)();
        let own_trees = has_own_trees(known.name);
        let (intersectors, layouts) = if own_trees {
            (vec![DRIVERS], vec![DRIVERS])
        } else {
            (
                Intersector::ALL.map(Intersector::name).to_vec(),
                Layout::ALL.map(Layout::name).to_vec(),
            )
        };
        Presence {
            backend: known.text,
            absent: found.as_ref().err().map(ToString::to_string),
            adapters: found.unwrap_or_default(),
            intersectors,
            layouts,
            own_trees,
        }
    };
    KNOWN.iter().map(presence).collect()
}

/// Whether a backend can make a tree in each frame, as far as is known while it is not open.
pub(crate) fn makes_trees(backend: BackendName) -> bool {
    backend != BackendName::Cpu
}

/// Whether an adapter is among those `able` to trace by their driver's trees, and answers ray queries beside.
fn answers_rays(able: &[Adapter], adapter: &Adapter) -> bool {
    let same = |a: &&Adapter| (&a.name, a.kind) == (&adapter.name, adapter.kind);
    let found = able.iter().find(same);
    found.is_some_and(|a| {
        let mut limits = a.limits.iter();
        limits.any(|l| l.name == "ray queries" && l.value == "yes")
    })
}

/// What stands for the intersector and the layout of such a backend.
pub(crate) const DRIVERS: &str = "driver";

/// wgpu with kernels that it translates even where it need not: for laws, not for work.
pub(crate) fn open_wgsl(want: &Want<'_>) -> Result<Box<dyn Backend>, Stop> {
    let translated = Known {
        text: "wgpu-wgsl",
        list: &each::list_wgpu,
        open: &|adapter, _| each::open_wgpu(adapter, true),
        ..KNOWN[1]
    };
    translated.open_named(want)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_backend_that_cannot_run_is_never_replaced() {
        for backend in [BackendName::Wgpu, BackendName::Vulkan, BackendName::Cpu] {
            let want = Want {
                backend,
                adapter: Some("no such adapter"),
                threads: 1,
            };
            assert!(matches!(open(&want, Ok), Err(Stop::Bad(_))));
        }
    }

    #[test]
    fn a_driver_answers_rays_if_it_lists_the_adapter_with_ray_queries() {
        let card = || adapters::named(&[("card", DeviceKind::Gpu)]);
        let able = |queries: &str| {
            let mut able = card();
            let value = queries.to_owned();
            let name = "ray queries";
            able[0].limits.push(adapters::Limit { name, value });
            able
        };
        assert!(answers_rays(&able("yes"), &card()[0]));
        assert!(!answers_rays(&able("no"), &card()[0]));
        assert!(!answers_rays(&card(), &card()[0]));
        let other = adapters::named(&[("other", DeviceKind::Gpu)]);
        assert!(!answers_rays(&able("yes"), &other[0]));
    }
}
