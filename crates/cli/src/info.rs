//! `abvh info`: this build and this machine.

use crate::args::InfoArgs;
use crate::open::{self, Presence};
use crate::stop::Stop;
use crate::{talk, threads};
use backend::{Intersector, Layout};
use serde::Serialize;

#[derive(Serialize)]
struct Info {
    version: &'static str,
    cpu: Option<String>,
    threads: usize,
    backends: Vec<Presence>,
    intersectors: Vec<&'static str>,
    layouts: Vec<&'static str>,
}

/// Tells.
pub(crate) fn run(args: &InfoArgs) -> Result<(), Stop> {
    let info = Info {
        version: env!("CARGO_PKG_VERSION"),
        cpu: cpu_model(),
        threads: threads::cores(),
        backends: open::presences(),
        intersectors: Intersector::ALL.map(Intersector::name).to_vec(),
        layouts: Layout::ALL.map(Layout::name).to_vec(),
    };
    if args.json {
        return talk::print_json(&info);
    }
    let cpu = info.cpu.as_deref().unwrap_or("unknown");
    let mut text = format!(
        "abvh {}\ncpu: {cpu}, {} threads\n",
        info.version, info.threads
    );
    for b in &info.backends {
        text += &match &b.absent {
            None => format!("backend {}: {}\n", b.backend, b.adapters.join("; ")),
            Some(why) => format!("backend {}: absent; {why}\n", b.backend),
        };
    }
    talk::print(&text)
}

/// The processor's own name, where the system tells.
pub(crate) fn cpu_model() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    Some(name.trim().to_owned())
}
