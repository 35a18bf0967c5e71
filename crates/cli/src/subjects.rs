//! Backends put to the test, and those that cannot be.

use crate::args::{BackendName, TestArgs, word};
use crate::info;
use crate::open;
use crate::stop::Stop;
use backend::Backend;
use clap::ValueEnum;
use serde::Serialize;
use serde_json::{Value, json};

pub(crate) struct Subject {
    pub(crate) name: &'static str,
    pub(crate) backend: Box<dyn Backend>,
}

/// What every report of a test begins with.
#[derive(Default, Serialize)]
pub(crate) struct Tested {
    schema: u32,
    version: &'static str,
    command_line: Vec<String>,
    machine: Value,
    backends: Vec<Value>,
    absent: Vec<Value>,
    /// Backends that were put to the test.
    #[serde(skip)]
    pub(crate) names: Vec<&'static str>,
    /// One line for each backend, present or absent.
    #[serde(skip)]
    pub(crate) text: String,
}

impl Tested {
    fn new(subjects: &[Subject], absent: &[(String, String)]) -> Self {
        let mut tested = Self {
            schema: output::SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            command_line: info::command_line(),
            machine: json!({
                "cpu": info::cpu_model(),
                "cores": host::cores(),
                "os": std::env::consts::OS,
            }),
            ..Self::default()
        };
        for Subject { name, backend } in subjects {
            let device = backend.device();
            let (adapter, own) = (&device.adapter, device.arithmetic.to_string());
            let driver = match device.driver.trim() {
                "" => String::new(),
                driver => format!(" ({driver})"),
            };
            tested.text += &format!("{name}: {adapter}{driver}; by itself: {own}\n");
            tested.names.push(name);
            tested.backends.push(json!({
                "backend": name,
                "adapter": adapter,
                "driver": device.driver,
                "kind": device.kind.name(),
                "threads": device.threads,
                "arithmetic": own,
            }));
        }
        for (name, reason) in absent {
            tested.text += &format!("{name}: absent; {reason}\n");
            (tested.absent).push(json!({ "backend": name, "reason": reason }));
        }
        tested
    }
}

/// Opens what was named, or whatever is present.
/// Those that leave to a driver what a ray hits are asked for by name, or with all others where `drivers` says so.
pub(crate) fn open_all(args: &TestArgs, drivers: bool) -> Result<(Vec<Subject>, Tested), Stop> {
    let (mut subjects, mut absent) = (Vec::new(), Vec::new());
    for &one in BackendName::value_variants() {
        if one == BackendName::Auto {
            continue;
        }
        let named = args.backend.contains(&one);
        let among =
            args.backend.contains(&BackendName::Auto) && (drivers || !open::has_own_trees(one));
        if !named && !among {
            continue;
        }
        match open::bare(one, args.adapter.as_deref(), host::cores()) {
            Ok(backend) => subjects.push(Subject {
                name: backend.device().backend,
                backend,
            }),
            Err(stop) if named => return Err(stop),
            Err(stop) => absent.push((word(&one), stop.to_string())),
        }
    }
    if subjects.is_empty() {
        let reasons: Vec<_> = absent.into_iter().map(|(_, reason)| reason).collect();
        return Err(Stop::bad(reasons.join("; ")));
    }
    let tested = Tested::new(&subjects, &absent);
    Ok((subjects, tested))
}
