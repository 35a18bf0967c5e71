//! The one place that names backends.

mod each;

use crate::adapters::{self, Adapter};
use crate::args::BackendName;
use crate::auto::{self, Rival};
use crate::stop::Stop;
use backend::{Backend, DeviceKind, Intersector, Layout, Method};
use serde::Serialize;

/// Opens an adapter, or the backend's own choice; with host threads, where it uses them.
type OpenAdapter = fn(Option<&Adapter>, usize) -> backend::Result<Box<dyn Backend>>;

/// A backend of this program.
struct Known {
    name: BackendName,
    text: &'static str,
    /// Why it has its place in the list.
    place: &'static str,
    kinds: &'static [DeviceKind],
    covered_by: Option<&'static str>,
    supports: fn(Method) -> bool,
    /// Whether it makes and traces trees in ways of its own. `auto` takes none of these.
    own_trees: bool,
    /// Whether it can make a tree in each frame.
    makes_trees: bool,
    list: fn() -> backend::Result<Vec<Adapter>>,
    open: OpenAdapter,
}

const ON_DRIVERS: &[DeviceKind] = &[DeviceKind::Gpu, DeviceKind::Software];

/// Where wgpu has but Vulkan to go through.
const WGPU_IS_VULKAN: bool = cfg!(not(any(windows, target_vendor = "apple")));

/// All there are. Among backends that offer the same kind of device, `auto` tries them in this order.
const KNOWN: [Known; 5] = [
    Known {
        name: BackendName::Vulkan,
        text: "vulkan",
        place: "vulkan comes before wgpu: trees and vertices travel on a queue of their own",
        kinds: ON_DRIVERS,
        covered_by: None,
        supports: gpu_vulkan::supports,
        own_trees: false,
        makes_trees: true,
        list: each::list_vulkan,
        open: each::open_vulkan,
    },
    Known {
        name: BackendName::Wgpu,
        text: "wgpu",
        place: "wgpu is next after vulkan",
        kinds: ON_DRIVERS,
        covered_by: if WGPU_IS_VULKAN { Some("vulkan") } else { None },
        supports: gpu_wgpu::supports,
        own_trees: false,
        makes_trees: true,
        list: each::list_wgpu,
        open: each::open_wgpu,
    },
    Known {
        name: BackendName::Cpu,
        text: "cpu",
        place: "the host is always there",
        kinds: &[DeviceKind::Cpu],
        covered_by: None,
        supports: each::cpu_supports,
        own_trees: false,
        makes_trees: false,
        list: each::list_cpu,
        open: each::open_cpu,
    },
    Known {
        name: BackendName::VulkanRt,
        text: "vulkan-rt",
        place: RIVAL,
        kinds: ON_DRIVERS,
        covered_by: None,
        supports: gpu_vulkan_rt::driver_tree_supports,
        own_trees: true,
        makes_trees: true,
        list: each::list_vulkan_rt,
        open: each::open_vulkan_rt,
    },
    Known {
        name: BackendName::VulkanRtFastTrace,
        text: "vulkan-rt:fast-trace",
        place: RIVAL,
        kinds: ON_DRIVERS,
        covered_by: None,
        supports: gpu_vulkan_rt::driver_tree_supports,
        own_trees: true,
        makes_trees: true,
        list: each::list_vulkan_rt,
        open: each::open_vulkan_rt_fast_trace,
    },
];

/// Why `auto` does not take what the driver makes, though it may be the fastest where hardware traces: it only says so.
const RIVAL: &str = "it is there to be measured against";

/// What is to be opened.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Want<'a> {
    /// Backend.
    pub(crate) backend: BackendName,
    /// Adapter of the backend, by index or by part of its name.
    pub(crate) adapter: Option<&'a str>,
    /// How rays will be traced.
    pub(crate) method: Method,
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
    let ours = KNOWN.iter().filter(|k| !k.own_trees);
    let rivals: Vec<_> = ours.map(|k| k.rival(want, &ready)).collect();
    let (value, why) = auto::take(&rivals, want.adapter)?;
    let why = Some(why);
    Ok(Opened { value, why })
}

impl Known {
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

    fn rival<'a, T>(
        &'a self,
        want: &Want<'a>,
        ready: &'a impl Fn(Box<dyn Backend>) -> Result<T, Stop>,
    ) -> Rival<'a, T> {
        let threads = want.threads;
        Rival {
            name: self.text,
            place: self.place,
            kinds: self.kinds,
            covered_by: self.covered_by,
            lacks: self.lacks(want.method),
            answers_rays: Box::new(|adapter| {
                each::list_vulkan_rt().is_ok_and(|able| answers_rays(&able, adapter))
            }),
            list: Box::new(self.list),
            open: Box::new(move |adapter| ready((self.open)(Some(adapter), threads)?)),
        }
    }

    /// What the backend lacks of a method.
    fn lacks(&self, method: Method) -> Option<String> {
        if (self.supports)(method) {
            return None;
        }
        let intersector = method.intersector;
        let layout = method.layout;
        Some(if self.intersectors().contains(&intersector.name()) {
            format!("layout '{layout}'")
        } else {
            format!("intersector '{intersector}'")
        })
    }

    fn intersectors(&self) -> Vec<&'static str> {
        if self.own_trees {
            return vec![DRIVERS];
        }
        let with = |intersector| Method {
            intersector,
            ..Method::default()
        };
        let all = Intersector::ALL.into_iter();
        all.filter(|&i| (self.supports)(with(i)))
            .map(Intersector::name)
            .collect()
    }

    fn layouts(&self) -> Vec<&'static str> {
        if self.own_trees {
            return vec![DRIVERS];
        }
        let with = |layout| Method {
            layout,
            ..Method::default()
        };
        let all = Layout::ALL.into_iter();
        all.filter(|&l| (self.supports)(with(l)))
            .map(Layout::name)
            .collect()
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
    let presence = |known: &Known| {
        let found = (known.list)();
        Presence {
            backend: known.text,
            absent: found.as_ref().err().map(ToString::to_string),
            adapters: found.unwrap_or_default(),
            intersectors: known.intersectors(),
            layouts: known.layouts(),
            own_trees: known.own_trees,
        }
    };
    KNOWN.iter().map(presence).collect()
}

/// What a backend lacks of a method; `None` if it supports it. It need not be present.
pub(crate) fn lacks(backend: BackendName, method: Method) -> Option<String> {
    let known = KNOWN.iter().find(|k| k.name == backend)?;
    known.lacks(method)
}

/// Whether a backend makes and traces trees in ways of its own. It need not be present.
pub(crate) fn has_own_trees(backend: BackendName) -> bool {
    KNOWN.iter().any(|k| k.name == backend && k.own_trees)
}

/// Whether a backend can make a tree in each frame, as far as is known while it is not open.
pub(crate) fn makes_trees(backend: BackendName) -> bool {
    let found = KNOWN.iter().find(|k| k.name == backend);
    found.is_none_or(|k| k.makes_trees)
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
        open: each::open_wgsl,
        list: each::list_wgpu,
        ..KNOWN[1]
    };
    translated.open_named(want)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn want(backend: BackendName, adapter: Option<&str>) -> Want<'_> {
        Want {
            backend,
            adapter,
            method: Method::default(),
            threads: 1,
        }
    }

    #[test]
    fn a_backend_that_cannot_run_is_never_replaced() {
        for name in [BackendName::Wgpu, BackendName::Vulkan, BackendName::Cpu] {
            let opened = open(&want(name, Some("no such adapter")), Ok);
            assert!(matches!(opened, Err(Stop::Bad(_))));
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

    #[test]
    fn every_backend_has_every_intersector_but_that_of_the_drivers_own_trees() {
        for known in &KNOWN {
            for intersector in Intersector::ALL {
                let lacks = known.lacks(Method {
                    intersector,
                    ..Method::default()
                });
                let usual = intersector == Intersector::Watertight;
                let expected =
                    (known.own_trees && !usual).then(|| format!("intersector '{intersector}'"));
                assert_eq!(lacks, expected, "{}", known.text);
            }
        }
    }

    #[test]
    fn every_backend_knows_the_method_that_auto_takes() {
        for known in &KNOWN {
            assert_eq!(known.lacks(Method::default()), None, "{}", known.text);
        }
        let fast = Method {
            layout: Layout::Fast,
            ..Method::default()
        };
        let cpu = KNOWN.iter().find(|k| k.text == "cpu").unwrap();
        assert_eq!(cpu.lacks(fast), None);
    }
}
