//! Backends put to the test, and those that cannot be.

use crate::args::{BackendName, TestArgs};
use crate::open;
use crate::stop::Stop;
use crate::{adapters, info, record, threads};
use backend::Backend;
use serde::Serialize;
use serde_json::{Value, json};

pub(crate) struct Subject {
    pub(crate) name: &'static str,
    pub(crate) backend: Box<dyn Backend>,
}

/// What every report of a test begins with.
#[derive(Default, Serialize)]
pub(crate) struct Tested {
    pub(crate) schema: u32,
    pub(crate) version: &'static str,
    pub(crate) command_line: Vec<String>,
    pub(crate) machine: Value,
    pub(crate) backends: Vec<Examined>,
    pub(crate) absent: Vec<Absent>,
}

/// What is said of a backend that was put to the test.
#[derive(Default, Serialize)]
pub(crate) struct Examined {
    pub(crate) backend: &'static str,
    pub(crate) adapter: String,
    pub(crate) driver: String,
    pub(crate) kind: &'static str,
    pub(crate) threads: usize,
    /// How it computes where nobody tells it how to round.
    pub(crate) arithmetic: String,
}

/// A backend that was not, because it cannot run here.
#[derive(Serialize)]
pub(crate) struct Absent {
    pub(crate) backend: &'static str,
    pub(crate) reason: String,
}

impl Tested {
    fn new(subjects: &[Subject], absent: Vec<Absent>) -> Self {
        let examined = |subject: &Subject| {
            let device = subject.backend.device();
            Examined {
                backend: subject.name,
                adapter: device.adapter.clone(),
                driver: device.driver.clone(),
                kind: adapters::kind_name(device.kind),
                threads: device.threads,
                arithmetic: device.arithmetic.to_string(),
            }
        };
        Self {
            schema: output::SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            command_line: record::command_line(),
            machine: json!({
                "cpu": info::cpu_model(),
                "cores": threads::cores(),
                "os": std::env::consts::OS,
            }),
            backends: subjects.iter().map(examined).collect(),
            absent,
        }
    }

    /// One line for each backend, present or absent.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        for b in &self.backends {
            let driver = match b.driver.trim() {
                "" => String::new(),
                driver => format!(" ({driver})"),
            };
            let (backend, adapter, own) = (b.backend, &b.adapter, &b.arithmetic);
            text += &format!("{backend}: {adapter}{driver}; by itself: {own}\n");
        }
        for a in &self.absent {
            text += &format!("{}: absent; {}\n", a.backend, a.reason);
        }
        text
    }
}

/// Opens what was named, or whatever is present.
/// Those that leave to a driver what a ray hits are asked for by name, or with all others where `drivers` says so.
pub(crate) fn open_all(
    TestArgs {
        backend, adapter, ..
    }: &TestArgs,
    drivers: bool,
) -> Result<(Vec<Subject>, Tested), Stop> {
    use BackendName as B;
    let all = [
        B::Cpu,
        B::Vulkan,
        B::VulkanRt,
        B::VulkanRtFastTrace,
        B::Wgpu,
        B::WgpuWgsl,
    ];
    let (mut subjects, mut absent) = (Vec::new(), Vec::new());
    for one in all {
        let named = backend.contains(&one);
        let among = backend.contains(&B::Auto) && (drivers || !open::has_own_trees(one));
        if !named && !among {
            continue;
        }
        let name = open::name(one);
        match open::bare(one, adapter.as_deref(), threads::cores()) {
            Ok(backend) => subjects.push(Subject { name, backend }),
            Err(stop) if named => return Err(stop),
            Err(stop) => absent.push(Absent {
                backend: name,
                reason: stop.to_string(),
            }),
        }
    }
    if subjects.is_empty() {
        let reasons: Vec<_> = absent.iter().map(|a| a.reason.as_str()).collect();
        return Err(Stop::bad(reasons.join("; ")));
    }
    let tested = Tested::new(&subjects, absent);
    Ok((subjects, tested))
}
