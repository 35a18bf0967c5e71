//! The one place that names backends.

mod auto;

use crate::adapters::{self, Adapter};
use crate::args::BackendName;
pub(crate) use crate::args::has_own_trees;
use crate::stop::Stop;
use crate::threads;
use backend::{Backend, DeviceKind, Intersector, Layout};
use gpu_vulkan::VulkanBackend;
use gpu_vulkan_rt::{DriverTreeBackend, Prefer};
use gpu_wgpu::WgpuBackend;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Opens an adapter, or the backend's own choice; with host threads, where it uses them.
type OpenAdapter<'a> = dyn Fn(Option<&Adapter>, usize) -> backend::Result<Box<dyn Backend>> + 'a;

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

/// Where wgpu has but Vulkan to go through.
const WGPU_IS_VULKAN: bool = cfg!(not(any(windows, target_vendor = "apple")));

/// All there are. Among backends that offer the same kind of device, `auto` tries them in this order. It takes none that
/// makes trees in ways of its own, though that may be the fastest where hardware traces: it only says so.
const KNOWN: [Known<'static>; 5] = [
    Known {
        name: BackendName::Vulkan,
        text: "vulkan",
        place: "vulkan comes before wgpu: trees and vertices travel on a queue of their own",
        list: &gpu_vulkan::adapters,
        open: &|adapter, _| Ok(Box::new(VulkanBackend::new(&vulkan_options(adapter))?)),
        ..VULKAN_RT
    },
    Known {
        name: BackendName::Wgpu,
        text: "wgpu",
        place: "wgpu is next after vulkan",
        covered_by: if WGPU_IS_VULKAN { Some("vulkan") } else { None },
        list: &gpu_wgpu::adapters,
        open: &|adapter, _| open_wgpu(adapter),
        ..VULKAN_RT
    },
    Known {
        name: BackendName::Cpu,
        text: "cpu",
        place: "the host is always there",
        kinds: &[DeviceKind::Cpu],
        list: &list_cpu,
        open: &|_, threads| Ok(Box::new(cpu_simd::open(Some(threads))?)),
        ..VULKAN_RT
    },
    VULKAN_RT,
    Known {
        name: BackendName::VulkanRtFastTrace,
        text: "vulkan-rt:fast-trace",
        open: &|adapter, _| open_vulkan_rt(adapter, Prefer::FastTrace),
        ..VULKAN_RT
    },
];

const VULKAN_RT: Known<'static> = Known {
    name: BackendName::VulkanRt,
    text: "vulkan-rt",
    place: "it is there to be measured against",
    kinds: &[DeviceKind::Gpu, DeviceKind::Software],
    covered_by: None,
    list: &gpu_vulkan_rt::ray_adapters,
    open: &|adapter, _| open_vulkan_rt(adapter, Prefer::FastBuild),
};

/// Opens a backend, on the adapter meant by an index or by part of its name, with so many host threads if it computes on
/// them; and makes it ready. Never takes another than the one named; `auto` passes over those that cannot be made ready,
/// and says why it took what it took.
///
/// # Errors
/// The backend named cannot run, or there is no such adapter.
pub(crate) fn open<T>(
    backend: BackendName,
    (adapter, threads): (Option<&str>, usize),
    ready: impl Fn(Box<dyn Backend>) -> Result<T, Stop>,
) -> Result<(T, Option<String>), Stop> {
    if let Some(known) = KNOWN.iter().find(|k| k.name == backend) {
        return Ok((ready(known.open_named(adapter, threads)?)?, None));
    }
    let ours: Vec<_> = (KNOWN.iter().filter(|k| !has_own_trees(k.name))).collect();
    let traces = |adapter: &Adapter| {
        let able = gpu_vulkan_rt::ray_adapters();
        able.is_ok_and(|able| answers_rays(&able, adapter))
    };
    let (value, why) = auto::take(&ours, (adapter, threads), &traces, ready)?;
    Ok((value, Some(why)))
}

/// Likewise, as it is.
pub(crate) fn bare(
    backend: BackendName,
    adapter: Option<&str>,
    threads: usize,
) -> Result<Box<dyn Backend>, Stop> {
    Ok(open(backend, (adapter, threads), Ok)?.0)
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
    fn open_named(&self, adapter: Option<&str>, threads: usize) -> Result<Box<dyn Backend>, Stop> {
        let absent = |e| Stop::bad(format!("backend {} cannot run: {e}", self.text));
        let Some(asked) = adapter else {
            return (self.open)(None, threads).map_err(absent);
        };
        let list = (self.list)().map_err(absent)?;
        let adapter = adapters::find_one(self.text, &list, asked)?;
        (self.open)(Some(adapter), threads).map_err(absent)
    }
}

/// Whether a backend can run here, and what it can do.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Presence {
    #[serde(skip)]
    pub(crate) name: BackendName,
    pub(crate) backend: &'static str,
    /// Why it cannot run; `None` if it can.
    pub(crate) absent: Option<String>,
    #[serde(serialize_with = "adapters::serialize")]
    pub(crate) adapters: Vec<Adapter>,
    pub(crate) intersectors: Vec<&'static str>,
    pub(crate) layouts: Vec<&'static str>,
    /// Whether it makes and traces trees in ways of its own.
    pub(crate) own_trees: bool,
}

/// All backends, present or absent, in the order in which `auto` looks at them.
pub(crate) fn presences() -> impl DoubleEndedIterator<Item = Presence> {
    KNOWN.iter().map(|known| {
        let found = (known.list)();
        let own_trees = has_own_trees(known.name);
        let names = |ours: Vec<&'static str>| if own_trees { vec![DRIVERS] } else { ours };
        Presence {
            name: known.name,
            backend: known.text,
            absent: found.as_ref().err().map(ToString::to_string),
            adapters: found.unwrap_or_default(),
            intersectors: names(Intersector::ALL.map(Intersector::name).to_vec()),
            layouts: names(Layout::ALL.map(Layout::name).to_vec()),
            own_trees,
        }
    })
}

/// Whether a backend can make a tree in each frame, as far as is known while it is not open.
pub(crate) fn makes_trees(backend: BackendName) -> bool {
    backend != BackendName::Cpu
}

/// Whether an adapter is among those `able` to trace by their driver's trees, and answers ray queries beside.
fn answers_rays(able: &[Adapter], adapter: &Adapter) -> bool {
    let same = |a: &&Adapter| (&a.name, a.kind) == (&adapter.name, adapter.kind);
    let queries = ("ray queries", "yes".to_owned());
    (able.iter().find(same)).is_some_and(|a| a.limits.contains(&queries))
}

/// What stands for the intersector and the layout of such a backend.
pub(crate) const DRIVERS: &str = "driver";

fn list_cpu() -> backend::Result<Vec<Adapter>> {
    let device = cpu_simd::open(Some(1))?.device().clone();
    Ok(vec![Adapter {
        index: 0,
        name: device.adapter,
        driver: device.driver,
        kind: device.kind,
        limits: vec![("threads", threads::cores().to_string())],
    }])
}

fn vulkan_options(adapter: Option<&Adapter>) -> gpu_vulkan::Options {
    gpu_vulkan::Options {
        adapter: adapter.map(|a| a.index.to_string()),
        cache: cache_folder(),
        ..Default::default()
    }
}

fn open_vulkan_rt(adapter: Option<&Adapter>, prefer: Prefer) -> backend::Result<Box<dyn Backend>> {
    let options = vulkan_options(adapter);
    Ok(Box::new(DriverTreeBackend::new(&options, prefer)?))
}

fn open_wgpu(adapter: Option<&Adapter>) -> backend::Result<Box<dyn Backend>> {
    let options = gpu_wgpu::Options {
        adapter: adapter.map(|a| a.index.to_string()),
        cache: cache_folder(),
        ..Default::default()
    };
    Ok(Box::new(WgpuBackend::new(&options)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_answers_rays_if_it_lists_the_adapter_with_ray_queries() {
        let card = || adapters::named(&[("card", DeviceKind::Gpu)]);
        let able = |queries: &str| {
            let mut able = card();
            able[0].limits.push(("ray queries", queries.to_owned()));
            able
        };
        assert!(answers_rays(&able("yes"), &card()[0]));
        assert!(!answers_rays(&able("no"), &card()[0]));
        assert!(!answers_rays(&card(), &card()[0]));
        let other = adapters::named(&[("other", DeviceKind::Gpu)]);
        assert!(!answers_rays(&able("yes"), &other[0]));
    }
}
