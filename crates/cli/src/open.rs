//! The one place that names backends.

use crate::args::BackendName;
use crate::stop::Stop;
use backend::{Backend, BackendError};
use cpu_ref::CpuBackend;
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

const NOT_BUILT: &str = "this build has no code for it yet; only cpu is part of it";

/// Opens a backend on `threads` host threads (where it uses them). Never takes another than the one named.
pub(crate) fn open(
    name: BackendName,
    adapter: Option<&str>,
    threads: usize,
) -> Result<Opened, Stop> {
    let absent = |name: &str| Stop::bad(format!("backend {name} cannot run: {NOT_BUILT}"));
    let why = match name {
        BackendName::Cpu => None,
        BackendName::Auto => Some(format!("wgpu and vulkan cannot run: {NOT_BUILT}")),
        BackendName::Wgpu => return Err(absent("wgpu")),
        BackendName::Vulkan => return Err(absent("vulkan")),
    };
    let backend = CpuBackend::new(Some(threads))?;
    if let Some(adapter) = adapter {
        check_adapter(&backend.device().adapter, adapter)?;
    }
    Ok(Opened {
        backend: Box::new(backend),
        why,
    })
}

/// All backends, present or absent.
pub(crate) fn presences() -> Vec<Presence> {
    let absent = |backend| Presence {
        backend,
        adapters: Vec::new(),
        absent: Some(NOT_BUILT.to_owned()),
    };
    vec![cpu(), absent("wgpu"), absent("vulkan")]
}

fn cpu() -> Presence {
    let opened: Result<CpuBackend, BackendError> = CpuBackend::new(None);
    let (adapters, absent) = match opened {
        Ok(cpu) => (vec![cpu.device().adapter.clone()], None),
        Err(e) => (Vec::new(), Some(e.to_string())),
    };
    Presence {
        backend: "cpu",
        adapters,
        absent,
    }
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
            assert!(matches!(open(name, None, 1), Err(Stop::Bad(_))));
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
