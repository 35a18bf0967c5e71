//! The one place that names backends.

use crate::args::BackendName;
use crate::stop::Stop;
use backend::{Backend, BackendError};
use cpu_ref::CpuBackend;
use gpu_vulkan::VulkanBackend;
use gpu_wgpu::WgpuBackend;
use serde::Serialize;

/// Whether a backend can run here.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Presence {
    /// Its name on the command line.
    pub(crate) backend: &'static str,
    /// The adapters it would run on.
    pub(crate) adapters: Vec<String>,
    /// Why it cannot run; `None` if it can.
    pub(crate) absent: Option<String>,
}

/// A backend ready to load a scene, and why `auto` took it.
pub(crate) struct Opened {
    /// The backend.
    pub(crate) backend: Box<dyn Backend>,
    /// The reason; `None` if it was asked for by name.
    pub(crate) why: Option<String>,
}

const AUTO: &str = "wgpu and vulkan are not measured on a GPU yet: name one to use it";

/// Opens a backend on `threads` host threads (where it uses them). Never takes another than the one named.
pub(crate) fn open(
    name: BackendName,
    adapter: Option<&str>,
    threads: usize,
) -> Result<Opened, Stop> {
    let backend: Box<dyn Backend> = match name {
        BackendName::Cpu | BackendName::Auto => cpu_with(adapter, threads)?,
        BackendName::Wgpu => {
            let adapter = adapter.map(str::to_owned);
            let options = gpu_wgpu::Options {
                adapter,
                ..Default::default()
            };
            Box::new(WgpuBackend::new(&options).map_err(|e| absent("wgpu", &e))?)
        }
        BackendName::Vulkan => {
            let adapter = adapter.map(str::to_owned);
            let options = gpu_vulkan::Options {
                adapter,
                ..Default::default()
            };
            Box::new(VulkanBackend::new(&options).map_err(|e| absent("vulkan", &e))?)
        }
    };
    let why = (name == BackendName::Auto).then(|| AUTO.to_owned());
    Ok(Opened { backend, why })
}

fn absent(name: &str, why: &BackendError) -> Stop {
    Stop::bad(format!("backend {name} cannot run: {why}"))
}

fn cpu_with(adapter: Option<&str>, threads: usize) -> Result<Box<dyn Backend>, Stop> {
    let backend = CpuBackend::new(Some(threads))?;
    if let Some(adapter) = adapter {
        check_adapter(&backend.device().adapter, adapter)?;
    }
    Ok(Box::new(backend))
}

/// All backends, present or absent.
pub(crate) fn presences() -> Vec<Presence> {
    let names = |(name, driver): (String, String)| format!("{name} ({})", driver.trim());
    let vulkan = gpu_vulkan::adapters()
        .map(|all| all.into_iter().map(|a| names((a.name, a.driver))).collect());
    let wgpu = gpu_wgpu::adapters()
        .map(|all| all.into_iter().map(|a| names((a.name, a.driver))).collect());
    vec![cpu(), presence("wgpu", wgpu), presence("vulkan", vulkan)]
}

fn presence(backend: &'static str, found: backend::Result<Vec<String>>) -> Presence {
    let (adapters, absent) = match found {
        Ok(adapters) => (adapters, None),
        Err(e) => (Vec::new(), Some(e.to_string())),
    };
    Presence {
        backend,
        adapters,
        absent,
    }
}

fn cpu() -> Presence {
    let opened = CpuBackend::new(None);
    presence("cpu", opened.map(|cpu| vec![cpu.device().adapter.clone()]))
}

/// There is one adapter: number 0.
fn check_adapter(found: &str, asked: &str) -> Result<(), Stop> {
    let by_name = || found.to_lowercase().contains(&asked.to_lowercase());
    let fits = asked
        .parse::<usize>()
        .map_or_else(|_| by_name(), |i| i == 0);
    if fits {
        return Ok(());
    }
    Err(Stop::bad(format!(
        "backend cpu has no adapter '{asked}'; there is 0: {found}"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_backend_that_cannot_run_is_never_replaced() {
        for name in [BackendName::Wgpu, BackendName::Vulkan] {
            assert!(matches!(
                open(name, Some("no such adapter"), 1),
                Err(Stop::Bad(_))
            ));
        }
    }

    #[test]
    fn adapters_go_by_number_or_by_part_of_the_name() {
        for good in ["0", "epyc", "AMD"] {
            check_adapter("AMD EPYC 9000", good).unwrap();
        }
        for bad in ["1", "xeon"] {
            check_adapter("AMD EPYC 9000", bad).unwrap_err();
        }
    }
}
