//! The contenders that this machine can chart.

use super::ChartSettings;
use crate::devices::{
    BackendAvailability, BackendChoice, DeviceSettings, availability, backend_name,
};
use crate::error::CliError;
use crate::measure::{Contender, Contenders};
use crate::tracer_settings::TracerSettings;
use backend::{AdapterInfo, DeviceKind, Intersector};
use std::fmt;

/// The settings of a backend that decide its hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HitMethod {
    pub(super) backend: BackendChoice,
    pub(super) intersector: Intersector,
}

impl HitMethod {
    /// Returns the method of a contender, or `None` for a rival.
    pub(super) fn of(contender: &Contender) -> Option<Self> {
        match contender {
            Contender::Ours(tracer) => Some(Self {
                backend: tracer.backend,
                intersector: tracer.intersector,
            }),
            Contender::Rival(_) => None,
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
    contenders.add_rivals(measure, &DeviceSettings::default());
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
        write!(f, "{} {}", backend_name(self.backend), self.intersector)
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
