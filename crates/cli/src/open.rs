//! Opens backends by their names on the command line, and those that a test runs on.

use crate::args::{BackendChoice, TestArgs};
use crate::info;
use crate::stop::Stop;
use backend::{AdapterInfo, Backend, BackendName, Intersector};
use backends::{KNOWN, known};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;

/// Opens `backend` and calls `ready` with it. `adapter` is an index or part of a name. `threads` is the number of host
/// threads for a backend that computes on the host. A named backend is never replaced by another. `auto` skips backends
/// that fail to open or to become ready, and returns the reason for its choice.
pub(crate) fn open<T>(
    backend: BackendChoice,
    (adapter, threads): (Option<&str>, usize),
    ready: impl Fn(Box<dyn Backend>) -> Result<T, Stop>,
) -> Result<(T, Option<String>), Stop> {
    if let Some(name) = backend {
        let absent = || Stop::bad(format!("this program was built without backend {name}"));
        let known = known(name).ok_or_else(absent)?;
        let opened = known.open(adapter, threads).map_err(Stop::bad)?;
        return Ok((ready(opened)?, None));
    }
    match backends::open_best((adapter, threads), ready) {
        Ok((value, why)) => Ok((value, Some(why))),
        Err(vain) => Err(match vain.broken {
            Some(Stop::Failed(_)) => Stop::failed(vain.why),
            _ => Stop::bad(vain.why),
        }),
    }
}

/// Opens a backend without further preparation.
pub(crate) fn bare(
    backend: BackendChoice,
    adapter: Option<&str>,
    threads: usize,
) -> Result<Box<dyn Backend>, Stop> {
    Ok(open(backend, (adapter, threads), Ok)?.0)
}

/// A backend, and the reason why `auto` chose it.
type Opened = (Box<dyn Backend>, Option<String>);

/// A backend that is opened on its own thread, because opening takes long. Dropping it joins the thread, since drivers
/// may fail if the process ends while they work. NVIDIA's driver still works for 9 ms at that point. By default,
/// opening has not begun.
#[derive(Default)]
pub(crate) struct Opening {
    opened: Option<Receiver<Result<Opened, Stop>>>,
    thread: Option<JoinHandle<()>>,
}

impl Opening {
    /// Starts to open a backend as [`open`] would. Does nothing if no thread can be started.
    pub(crate) fn begin(backend: BackendChoice, (adapter, threads): (Option<&str>, usize)) -> Self {
        let adapter = adapter.map(str::to_owned);
        let (sender, opened) = channel();
        let open = move || {
            // Sending fails if the run has failed and dropped the receiver.
            let _ = sender.send(open(backend, (adapter.as_deref(), threads), Ok));
        };
        let thread = std::thread::Builder::new().spawn(open).ok();
        let opened = thread.is_some().then_some(opened);
        Self { opened, thread }
    }

    /// Returns a backend that is open already.
    pub(crate) fn of(backend: Box<dyn Backend>) -> Self {
        let (sender, opened) = channel();
        // The receiver is alive.
        let _ = sender.send(Ok((backend, None)));
        let opened = Some(opened);
        Self {
            opened,
            thread: None,
        }
    }

    /// Waits for the result. Returns `None` if opening never began or the result was taken before.
    pub(crate) fn wait(&mut self) -> Option<Result<Opened, Stop>> {
        let opened = self.opened.take()?.recv();
        if opened.is_err() {
            let ended = self.thread.take().map_or(Ok(()), JoinHandle::join);
            ended.unwrap_or_else(|e| std::panic::resume_unwind(e));
        }
        opened.ok()
    }
}

impl Drop for Opening {
    fn drop(&mut self) {
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Availability and capabilities of a backend on this machine.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Presence {
    #[serde(serialize_with = "serialize_name")]
    pub(crate) backend: BackendName,
    /// Reason why the backend is unavailable; `None` if it can run.
    pub(crate) absent: Option<String>,
    #[serde(serialize_with = "serialize")]
    pub(crate) adapters: Vec<AdapterInfo>,
    pub(crate) intersectors: Vec<&'static str>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn serialize_name<S: Serializer>(backend: &BackendName, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(backend.name())
}

/// Serializes adapters to JSON.
fn serialize<S: Serializer>(all: &[AdapterInfo], to: S) -> Result<S::Ok, S::Error> {
    let limit = |(name, value): &(_, _)| json!({ "name": name, "value": value });
    to.collect_seq(all.iter().map(|adapter| {
        json!({
            "index": adapter.index,
            "name": adapter.name,
            "driver": adapter.driver,
            "kind": adapter.kind.name(),
            "limits": adapter.limits.iter().map(limit).collect::<Vec<_>>(),
        })
    }))
}

/// Returns all backends, available or not, in the order in which `auto` tries them.
pub(crate) fn presences() -> impl DoubleEndedIterator<Item = Presence> {
    KNOWN.iter().map(|known| {
        let found = known.adapters();
        Presence {
            backend: known.name,
            absent: found.as_ref().err().map(ToString::to_string),
            adapters: found.unwrap_or_default(),
            intersectors: Intersector::ALL.map(Intersector::name).to_vec(),
        }
    })
}

/// Returns whether a backend can build a tree in each frame, as far as is known before it is open.
pub(crate) fn makes_trees(backend: BackendChoice) -> bool {
    !backend.is_some_and(BackendName::is_on_host)
}

/// A backend under test.
pub(crate) type Subject = Box<dyn Backend>;

/// Common part of all test reports.
#[derive(Default, Serialize)]
pub(crate) struct Tested {
    schema: u32,
    version: &'static str,
    command_line: Vec<String>,
    machine: Value,
    backends: Vec<Value>,
    absent: Vec<Value>,
    /// Names of the backends under test.
    #[serde(skip)]
    pub(crate) names: Vec<&'static str>,
    /// One line for each backend, available or not.
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
        for device in subjects.iter().map(|subject| subject.device()) {
            let name = device.backend;
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

/// Opens the backends that were named. `auto` stands for all that are present, except the reference.
pub(crate) fn open_all(args: &TestArgs) -> Result<(Vec<Subject>, Tested), Stop> {
    let (mut subjects, mut absent) = (Vec::new(), Vec::new());
    let takes_all = args.backend.contains(&None);
    for one in BackendName::ALL {
        let named = args.backend.contains(&Some(one));
        if !named && (!takes_all || one.is_reference()) {
            continue;
        }
        match bare(Some(one), args.adapter.as_deref(), host::cores()) {
            Ok(backend) => subjects.push(backend),
            Err(stop) if named => return Err(stop),
            Err(stop) => absent.push((one.name().to_owned(), stop.to_string())),
        }
    }
    if subjects.is_empty() {
        let reasons: Vec<_> = absent.into_iter().map(|(_, reason)| reason).collect();
        return Err(Stop::bad(reasons.join("; ")));
    }
    let tested = Tested::new(&subjects, &absent);
    Ok((subjects, tested))
}
