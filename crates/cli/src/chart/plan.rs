//! The contenders that this machine can chart.

use super::ChartSettings;
use crate::devices::{BackendAvailability, BackendChoice, availability, backend_name};
use crate::error::CliError;
use crate::measure::{Contender, Contenders};
use crate::tracer_settings::TracerSettings;
use backend::{AdapterInfo, DeviceKind, Intersector};
use output::plot::Failure;
use std::fmt;

/// The part of a contender that decides its hits: a backend with an intersector, or a rival.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum HitMethod {
    Ours(BackendChoice, Intersector),
    Rival(&'static str),
}

impl HitMethod {
    pub(super) fn of(contender: &Contender) -> Self {
        match contender {
            Contender::Ours(tracer) => Self::Ours(tracer.device.backend, tracer.intersector),
            Contender::Rival(policy) => Self::Rival(policy.rival.name()),
        }
    }

    /// Returns whether two methods are different intersectors of one backend.
    pub(super) fn competes_with(self, other: Self) -> bool {
        match (self, other) {
            (Self::Ours(backend, by), Self::Ours(other, intersector)) => {
                backend == other && by != intersector
            }
            _ => false,
        }
    }
}

/// Returns all combinations of the requested backends, intersectors and policies, then the rivals with the policies
/// that they support. The list has no duplicates. It may contain policies that a backend does not support.
pub(super) fn contenders(settings: &ChartSettings) -> Result<Contenders, CliError> {
    let measure = &settings.measure;
    let mut contenders = Contenders::default();
    for backend in backends(&measure.backend, &mut contenders.skipped) {
        for &intersector in &measure.intersector {
            let contender =
                |&update| Contender::Ours(TracerSettings::of(backend, intersector, update));
            let all = measure.update.iter().map(contender);
            contenders.all.extend(all);
        }
    }
    contenders.add_rivals(measure);
    if contenders.all.is_empty() {
        let why = contenders.skipped.join("; ");
        return Err(CliError::invalid(format!(
            "there is nothing to chart: {why}"
        )));
    }
    contenders.all = unique(&contenders.all);
    Ok(contenders)
}

/// Returns the backends to chart: those that were named, then those that `auto` finds, the host first.
fn backends(requested: &[BackendChoice], skipped: &mut Vec<String>) -> Vec<BackendChoice> {
    let (auto, mut found): (Vec<_>, Vec<_>) = requested.iter().partition(|b| b.is_none());
    if !auto.is_empty() {
        let measured = availability().filter(|p| !p.backend.is_reference());
        for availability in measured.rev() {
            let name = availability.backend;
            match why_not(availability) {
                Some(why) => skipped.push(format!("{name} is skipped: {why}")),
                None => found.push(Some(name)),
            }
        }
    }
    found
}

/// Returns each method of the contenders once.
pub(super) fn methods<'a>(contenders: impl IntoIterator<Item = &'a Contender>) -> Vec<HitMethod> {
    let mut methods = Vec::new();
    for method in contenders.into_iter().map(HitMethod::of) {
        if !methods.contains(&method) {
            methods.push(method);
        }
    }
    methods
}

/// Returns the row of a contender that could not be measured.
pub(super) fn failure(scene: &str, contender: &Contender, error: &CliError) -> Failure {
    let names = contender.names();
    Failure {
        scene: scene.to_owned(),
        backend: names.backend.to_owned(),
        intersector: names.intersector.to_owned(),
        update: names.update.to_owned(),
        error: error.to_string(),
    }
}

/// Returns the reason why `auto` skips a backend, or `None` if it has an adapter that is not a software device.
fn why_not(availability: BackendAvailability) -> Option<String> {
    let is_fit = |a: &AdapterInfo| a.kind != DeviceKind::Software;
    if availability.adapters.iter().any(is_fit) {
        return None;
    }
    Some(availability.absent.unwrap_or_else(|| {
        let there = AdapterInfo::numbered(&availability.adapters);
        format!("it finds no GPU, only {there}; to chart it, name it with --backend")
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

impl fmt::Display for HitMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ours(backend, intersector) => {
                write!(f, "{} {intersector}", backend_name(*backend))
            }
            Self::Rival(rival) => f.write_str(rival),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command_line::{CommandSettings, parse};
    use backend::BackendName;

    #[test]
    fn duplicate_options_are_measured_once() {
        let words = "abvh chart a b a --update refit,async,refit --backend cpu --intersector woop,exact,woop";
        let parsed = parse(words.split(' ').map(Into::into));
        let Ok(CommandSettings::Chart(settings)) = parsed else {
            panic!("{words}: {parsed:?}");
        };
        let Contenders { all, skipped } = contenders(&settings).unwrap();
        let contenders: Vec<_> = all.iter().map(ToString::to_string).collect();
        let methods = ["woop", "exact"];
        let expected = methods.map(|m| ["refit", "async"].map(|u| format!("cpu {m} {u}")));
        assert_eq!(contenders, expected.concat());
        assert_eq!(unique(&settings.measure.scenes), ["a", "b"]);
        assert!(skipped.is_empty(), "{skipped:?}");
    }

    #[test]
    fn auto_skips_software_drivers() {
        let availability = |backend, kinds: &[DeviceKind]| {
            let adapter = |(index, &kind): (usize, &DeviceKind)| AdapterInfo {
                index,
                name: kind.name().to_owned(),
                driver: String::new(),
                kind,
                limits: Vec::new(),
            };
            BackendAvailability {
                backend,
                absent: kinds.is_empty().then(|| "no loader".to_owned()),
                adapters: kinds.iter().enumerate().map(adapter).collect(),
            }
        };
        use BackendName::{Vulkan, Wgpu};
        use DeviceKind::{Cpu, Gpu, Software};
        for (backend, kinds, why) in [
            (BackendName::Cpu, &[Cpu][..], None),
            (Vulkan, &[Software, Gpu], None),
            (Wgpu, &[Gpu], None),
            (Wgpu, &[Software], Some("no GPU, only 0: software")),
            (Vulkan, &[], Some("no loader")),
        ] {
            let found = why_not(availability(backend, kinds));
            let told = found.as_deref().unwrap_or_default();
            let right = why.map_or(found.is_none(), |why| told.contains(why));
            assert!(right, "{backend} {kinds:?}: {found:?}");
        }
    }
}
