//! Ways of tracing that this machine can chart, and the command that measures one again.

use crate::args::{BackendName, ChartArgs, LayoutName, MethodArgs, word};
use crate::bench::Row;
use crate::choose::Ask;
use crate::open::{self, Presence};
use crate::stop::Stop;
use crate::values::Frames;
use backend::{AdapterInfo, DeviceKind};
use clap::ValueEnum;
use output::plot::Failure;
use std::collections::BTreeSet;
use std::fmt;

/// Everything with everything, as far as backends support it, and remarks on what is skipped; what is named twice is done
/// once.
pub(super) fn ways(args: &ChartArgs) -> Result<(Vec<Ask<'static>>, Vec<String>), Stop> {
    let (mut ways, mut skipped) = (Vec::new(), Vec::new());
    for backend in backends(args, &mut skipped) {
        let layouts = [LayoutName::Bvh2, LayoutName::Fast];
        let by = args.measure.intersector.iter();
        for (&intersector, layout) in by.flat_map(|by| layouts.map(|layout| (by, layout))) {
            let method = MethodArgs::of(intersector, layout);
            let updates = args.measure.update.iter();
            ways.extend(updates.map(|&update| Ask::of(backend, method, update)));
        }
    }
    if ways.is_empty() {
        let why = skipped.join("; ");
        return Err(Stop::bad(format!("there is nothing to chart: {why}")));
    }
    Ok((unique(&ways), skipped))
}

/// Returns the number of pairs of a backend and an intersector among `ways`.
pub(super) fn methods(ways: &[Ask<'_>]) -> usize {
    let method = |way: &Ask<'_>| {
        let intersector = way.method.intersector;
        format!("{} {intersector}", word(&way.backend))
    };
    ways.iter().map(method).collect::<BTreeSet<_>>().len()
}

/// Returns the row of a way that could not be measured.
pub(super) fn failure(scene: &str, way: &Ask<'_>, stop: &Stop) -> Failure {
    Failure {
        scene: scene.to_owned(),
        backend: word(&way.backend),
        layout: word(&way.method.layout),
        intersector: way.method.intersector.to_string(),
        update: way.update().0.name().to_owned(),
        error: stop.to_string(),
    }
}

/// Returns the backends to chart: those that were named, then those that `auto` finds, the host first.
fn backends(args: &ChartArgs, skipped: &mut Vec<String>) -> Vec<BackendName> {
    let (auto, named): (Vec<BackendName>, Vec<_>) =
        (args.measure.backend.iter()).partition(|&&b| b == BackendName::Auto);
    let mut all: Vec<_> = named.into_iter().map(|name| (name, None)).collect();
    if !auto.is_empty() {
        let name = |p: &Presence| BackendName::from_str(p.backend, true).ok();
        let known = open::presences().rev();
        all.extend(known.filter_map(|p| Some((name(&p)?, why_not(p)))));
    }
    let mut found = Vec::new();
    for (name, why_not) in all {
        let own = "what its rays hit is the driver's affair, not an intersector's";
        match why_not.or(open::has_own_trees(name).then(|| own.to_owned())) {
            Some(why) => skipped.push(format!("{} is skipped: {why}", word(&name))),
            None => found.push(name),
        }
    }
    found
}

/// Returns the reason why `auto` skips a backend that finds no GPU.
fn why_not(presence: Presence) -> Option<String> {
    let is_fit = |a: &AdapterInfo| a.kind != DeviceKind::Software;
    if presence.own_trees || presence.adapters.iter().any(is_fit) {
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

/// Backend, layout, intersector and policy, as far as they are known without a run.
impl fmt::Display for Ask<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [backend, layout] = [word(&self.backend), word(&self.method.layout)];
        let intersector = self.method.intersector;
        let update = self.update().0.name();
        write!(f, "{backend} {layout} {intersector} {update}")
    }
}

pub(super) fn command(args: &ChartArgs, spec: &str, row: &Row) -> String {
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
    format!(
        "abvh bench {}{source} --backend {} --update {} --intersector {} --layout {} --size {width}x{height} --frames {frames}{warm_up}",
        quoted(spec),
        row.setup.backend,
        row.setup.update,
        row.setup.intersector,
        row.setup.layout,
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

    #[test]
    fn what_is_named_twice_is_done_once() {
        let words = "abvh chart a b a --update refit,async,refit --backend cpu --intersector woop,exact,woop";
        let parsed = parse(words.split(' ').map(Into::into));
        let Ok(Command::Chart(args)) = parsed else {
            panic!("{words}: {parsed:?}");
        };
        let (ways, skipped) = ways(&args).unwrap();
        let ways: Vec<_> = ways.iter().map(ToString::to_string).collect();
        let methods = ["bvh2 woop", "fast woop", "bvh2 exact", "fast exact"];
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
                layouts: Vec::new(),
                own_trees: false,
            }
        };
        use DeviceKind::{Cpu, Gpu, Software};
        for (backend, kinds, why) in [
            ("cpu", &[Cpu][..], None),
            ("vulkan", &[Software, Gpu], None),
            ("wgpu", &[Gpu], None),
            ("wgpu", &[Software], Some("no GPU but 0: software")),
            ("vulkan", &[], Some("no loader")),
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
