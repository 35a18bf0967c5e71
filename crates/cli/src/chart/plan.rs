//! Ways of tracing that this machine can chart, and the command that measures one again.

use crate::args::{BackendChoice, ChartArgs, backend_name};
use crate::bench::Row;
use crate::choose::Ask;
use crate::open::{self, Presence};
use crate::rival::{self, Contest, OWN};
use crate::stop::Stop;
use crate::values::Frames;
use backend::{AdapterInfo, DeviceKind, Intersector};
use output::plot::Failure;
use rivals::Known;
use std::fmt;

/// A way of tracing a scene.
#[derive(Clone, Copy, Debug)]
pub(super) enum Way {
    Ours(Ask<'static>),
    Rival(Contest),
}

/// What decides the hits of a way: a backend or a rival, and its intersector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Method {
    Ours(BackendChoice, Intersector),
    Rival(&'static Known),
}

impl Way {
    pub(super) fn method(&self) -> Method {
        match self {
            Self::Ours(ask) => Method::Ours(ask.backend, ask.intersector),
            Self::Rival(contest) => Method::Rival(contest.rival),
        }
    }
}

impl Method {
    /// Returns whether two methods are other intersectors of one backend.
    pub(super) fn competes_with(self, other: Self) -> bool {
        match (self, other) {
            (Self::Ours(backend, by), Self::Ours(other, intersector)) => {
                backend == other && by != intersector
            }
            _ => false,
        }
    }
}

/// Returns every way that backends and rivals support, once, and remarks on those that are skipped.
pub(super) fn ways(args: &ChartArgs) -> Result<(Vec<Way>, Vec<String>), Stop> {
    let (mut ways, mut skipped) = (Vec::new(), Vec::new());
    for backend in backends(args, &mut skipped) {
        for &intersector in &args.measure.intersector {
            let updates = args.measure.update.iter();
            ways.extend(updates.map(|&update| Way::Ours(Ask::of(backend, intersector, update))));
        }
    }
    let (contests, unknown) = rival::contests(&args.measure.rival, &args.measure.update);
    ways.extend(contests.into_iter().map(Way::Rival));
    skipped.extend(unknown);
    if ways.is_empty() {
        let why = skipped.join("; ");
        return Err(Stop::bad(format!("there is nothing to chart: {why}")));
    }
    Ok((unique(&ways), skipped))
}

/// Returns each method among `ways` once.
pub(super) fn methods(ways: impl IntoIterator<Item = Way>) -> Vec<Method> {
    let mut methods = Vec::new();
    for way in ways {
        if !methods.contains(&way.method()) {
            methods.push(way.method());
        }
    }
    methods
}

/// Returns the row of a way that could not be measured.
pub(super) fn failure(scene: &str, way: &Way, stop: &Stop) -> Failure {
    let names = match way {
        Way::Ours(ask) => [
            backend_name(ask.backend),
            ask.intersector.name(),
            ask.update().0.name(),
        ],
        Way::Rival(Contest { rival, upkeep }) => [rival.name, OWN, upkeep.name()],
    };
    let [backend, intersector, update] = names.map(str::to_owned);
    Failure {
        scene: scene.to_owned(),
        backend,
        intersector,
        update,
        error: stop.to_string(),
    }
}

/// Returns the backends to chart: those that were named, then those that `auto` finds, the host first.
fn backends(args: &ChartArgs, skipped: &mut Vec<String>) -> Vec<BackendChoice> {
    let (auto, named): (Vec<BackendChoice>, Vec<_>) =
        args.measure.backend.iter().partition(|b| b.is_none());
    let mut found = named;
    if !auto.is_empty() {
        for presence in open::presences()
            .rev()
            .filter(|p| !p.backend.is_reference())
        {
            let name = presence.backend;
            match why_not(presence) {
                Some(why) => skipped.push(format!("{name} is skipped: {why}")),
                None => found.push(Some(name)),
            }
        }
    }
    found
}

/// Returns the reason why `auto` skips a backend that finds no GPU.
fn why_not(presence: Presence) -> Option<String> {
    let is_fit = |a: &AdapterInfo| a.kind != DeviceKind::Software;
    if presence.adapters.iter().any(is_fit) {
        return None;
    }
    Some(presence.absent.unwrap_or_else(|| {
        let there = AdapterInfo::numbered(&presence.adapters);
        format!("it finds no GPU but {there}; --backend takes it by name")
    }))
}

/// Returns the elements in order, without those whose text occurred before.
pub(super) fn unique<T: Clone + ToString>(all: &[T]) -> Vec<T> {
    let mut kept: Vec<T> = Vec::new();
    for one in all {
        if kept.iter().all(|k| k.to_string() != one.to_string()) {
            kept.push(one.clone());
        }
    }
    kept
}

/// Backend, intersector and policy, as far as they are known without a run.
impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ask = match self {
            Self::Ours(ask) => ask,
            Self::Rival(contest) => return contest.fmt(f),
        };
        let (backend, update) = (backend_name(ask.backend), ask.update().0);
        write!(f, "{backend} {} {update}", ask.intersector)
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ours(backend, intersector) => {
                write!(f, "{} {intersector}", backend_name(*backend))
            }
            Self::Rival(rival) => f.write_str(rival.name),
        }
    }
}

/// Returns the command that measures the row of a way again.
pub(super) fn command(args: &ChartArgs, (spec, way): (&str, &Way), row: &Row) -> String {
    let [width, height] = args.measure.size;
    let frames = match &args.measure.frames {
        Frames::Count(n) => n.to_string(),
        // A single number would be read as a count.
        Frames::Keys(keys) => keys.iter().map(|key| format!("{key},")).collect(),
    };
    let mut source = String::new();
    if (args.measure.source.fps - 24.0).abs() > 0.0 {
        source += &format!(" --fps {}", args.measure.source.fps);
    }
    if let Some(clip) = &args.measure.source.clip {
        source += &format!(" --clip {}", quoted(clip));
    }
    let warm_up = args.measure.warm_up;
    let warm_up = warm_up.map_or(String::new(), |seconds| format!(" --warm-up {seconds}"));
    let how = &row.setup;
    let name = how.backend;
    let by = match way {
        Way::Ours(_) => format!("--backend {name} --intersector {}", how.intersector),
        Way::Rival(_) => format!("--rival {name}"),
    };
    format!(
        "abvh bench {}{source} {by} --update {} --size {width}x{height} --frames {frames}{warm_up}",
        quoted(spec),
        how.update,
    )
}

/// Quotes a word so that a shell reads it as one.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./:,=+@%".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::{Command, parse};
    use backend::BackendName;

    #[test]
    fn what_is_named_twice_is_done_once() {
        let words = "abvh chart a b a --update refit,async,refit --backend cpu --intersector woop,exact,woop";
        let parsed = parse(words.split(' ').map(Into::into));
        let Ok(Command::Chart(args)) = parsed else {
            panic!("{words}: {parsed:?}");
        };
        let (ways, skipped) = ways(&args).unwrap();
        let ways: Vec<_> = ways.iter().map(ToString::to_string).collect();
        let methods = ["woop", "exact"];
        let expected = methods.map(|m| ["refit", "async"].map(|u| format!("cpu {m} {u}")));
        assert_eq!(ways, expected.concat());
        assert_eq!(unique(&args.measure.scenes), ["a", "b"]);
        assert!(skipped.is_empty(), "{skipped:?}");
    }

    #[test]
    fn auto_charts_gpus_and_the_host_but_no_software_driver() {
        let presence = |backend, kinds: &[DeviceKind]| {
            let adapter = |(index, &kind): (usize, &DeviceKind)| AdapterInfo {
                index,
                name: kind.name().to_owned(),
                driver: String::new(),
                kind,
                limits: Vec::new(),
            };
            Presence {
                backend,
                absent: kinds.is_empty().then(|| "no loader".to_owned()),
                adapters: kinds.iter().enumerate().map(adapter).collect(),
                intersectors: Vec::new(),
            }
        };
        use BackendName::{Vulkan, Wgpu};
        use DeviceKind::{Cpu, Gpu, Software};
        for (backend, kinds, why) in [
            (BackendName::Cpu, &[Cpu][..], None),
            (Vulkan, &[Software, Gpu], None),
            (Wgpu, &[Gpu], None),
            (Wgpu, &[Software], Some("no GPU but 0: software")),
            (Vulkan, &[], Some("no loader")),
        ] {
            let found = why_not(presence(backend, kinds));
            let told = found.as_deref().unwrap_or_default();
            let right = why.map_or(found.is_none(), |why| told.contains(why));
            assert!(right, "{backend} {kinds:?}: {found:?}");
        }
    }

    #[test]
    fn a_shell_reads_every_word_as_one() {
        for (word, shell) in [
            ("demo:grove:50", "demo:grove:50"),
            ("my scene/*.obj", "'my scene/*.obj'"),
            ("it's", "'it'\\''s'"),
            ("", "''"),
        ] {
            assert_eq!(quoted(word), shell);
        }
    }
}
