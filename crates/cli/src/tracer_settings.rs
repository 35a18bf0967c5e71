//! Options that control tracing: device, intersector and update policy.

use crate::command::Requirement;
use crate::devices::{BackendChoice, DeviceSettings, Selected};
use crate::parsers::{self, AUTO};
use backend::{DeviceKind, Intersector, Policy};
use clap::{ArgAction, Args};
use pipeline::{Frame, Threads};

/// Options that control tracing. [`crate::setup`] resolves the options that are `auto`.
#[derive(Args, Clone, Debug)]
pub(crate) struct TracerSettings {
    /// Backend
    #[arg(long, value_name = "NAME", default_value = AUTO, value_parser = parsers::backend("The best available backend"))]
    pub(crate) backend: BackendChoice,
    #[command(flatten)]
    pub(crate) device: DeviceSettings,
    /// How a ray is tested against a triangle
    #[arg(long, value_name = "NAME", default_value = "watertight", value_parser = parsers::intersector())]
    pub(crate) intersector: Intersector,
    /// Update policy: how trees are kept up to date as triangles move
    #[arg(long, value_name = "POLICY", default_value = AUTO, value_parser = parsers::update(|_| true))]
    pub(crate) update: PolicyChoice,
    /// With async: adopt each tree exactly K frames after its request
    #[arg(long, value_name = "K")]
    pub(crate) lockstep: Option<u32>,
    /// With async: time for which each new tree is built. 'on': the middle of the period in which the tree will be
    /// used, predicted from the key frames. 'off': the time of the frame that requests the tree. Hits are the same;
    /// predicted trees fit better, so frames are faster
    #[arg(long, value_name = "on|off", default_value = "on", action = ArgAction::Set, value_parser = parsers::switch())]
    pub(crate) predict: bool,
}

/// An update policy; `None` leaves the choice to `auto`.
pub(crate) type PolicyChoice = Option<Policy>;

/// Returns the name of a policy on the command line.
pub(crate) fn policy_name(update: PolicyChoice) -> &'static str {
    update.map_or(AUTO, Policy::name)
}

impl TracerSettings {
    /// Returns settings with defaults for all other options.
    pub(crate) fn of(
        backend: BackendChoice,
        intersector: Intersector,
        update: PolicyChoice,
    ) -> Self {
        Self {
            backend,
            device: DeviceSettings::default(),
            intersector,
            update,
            lockstep: None,
            predict: true,
        }
    }

    /// Returns the policy that the options determine without an open backend. If the policy is left to `auto`, returns
    /// `async`, which [`crate::auto`] may replace.
    pub(crate) fn policy(&self) -> Selected<Policy> {
        let concurrent = self.lockstep.map_or(Policy::Async, Policy::Lockstep);
        let (value, why) = match self.update {
            Some(named) if named.builds_concurrently() => (concurrent, None),
            Some(named) => (named, None),
            None if self.is_policy_auto() => (concurrent, Some("it suits most scenes that deform")),
            None => (concurrent, Some("--lockstep requires it")),
        };
        let why = why.map(str::to_owned);
        Selected { value, why }
    }

    /// Returns whether the policy is left to `auto`. [`crate::auto`] chooses it once the backend is open.
    pub(crate) fn is_policy_auto(&self) -> bool {
        self.update.is_none() && self.lockstep.is_none()
    }

    /// Returns the numbers of rendering and builder threads for a kind of device and a policy.
    pub(crate) fn share(&self, device: DeviceKind, policy: Policy) -> Threads {
        let requested = [self.device.threads, self.device.builder_threads];
        Threads::share(host::cores(), device, policy, requested)
    }

    /// Returns the settings of the device to open. A backend on the host gets the rendering threads, not those of the
    /// builder.
    pub(crate) fn device_to_open(&self) -> DeviceSettings {
        let host = self.share(DeviceKind::Cpu, self.policy().value);
        DeviceSettings {
            threads: Some(host.render),
            ..self.device.clone()
        }
    }

    /// Returns what `--lockstep`, `--predict` and `--builder-threads` require of the policy.
    pub(crate) fn requirements(&self) -> Vec<Requirement> {
        vec![
            needs_async("lockstep", self.update),
            needs_async("predict", self.update),
            needs_host_builds(&[self.update]),
        ]
    }
}

/// Requires a policy that builds trees while frames are traced.
fn needs_async(option: &'static str, update: PolicyChoice) -> Requirement {
    Requirement::new(
        option,
        update.is_none_or(Policy::builds_concurrently),
        "applies only with --update async",
    )
}

/// Requires, for `--builder-threads`, a policy whose trees the host builds.
pub(crate) fn needs_host_builds(updates: &[PolicyChoice]) -> Requirement {
    let host_builds = |update: &PolicyChoice| !update.is_some_and(Policy::builds_on_device);
    Requirement::new(
        "builder_threads",
        updates.iter().any(host_builds),
        "applies only to trees that the host builds",
    )
}

/// The frames and rays of a run. `auto` and the memory estimate use them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Workload<'a> {
    /// Frames to trace. May be empty if `auto` does not choose the policy, or if they are not known in advance.
    pub(crate) frames: &'a [Frame],
    /// Number of rays of a frame.
    pub(crate) rays: usize,
}

impl Workload<'_> {
    /// Returns the earliest and the latest time of the frames, in key frames. Returns 0 to infinity if the list of
    /// frames is empty.
    pub(crate) fn time_range(&self) -> [f64; 2] {
        if self.frames.is_empty() {
            return [0.0, f64::INFINITY];
        }
        let times = || self.frames.iter().map(|f| f.time);
        let last = times().fold(0.0, f64::max);
        [times().fold(last, f64::min), last]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::BackendName;

    #[test]
    fn explicit_choices_are_respected() {
        let settings = |update, lockstep| TracerSettings {
            lockstep,
            ..TracerSettings::of(Some(BackendName::Cpu), Intersector::Watertight, update)
        };
        let three = Policy::Lockstep(3);
        let free = Policy::Async;
        for (settings, policy, is_named) in [
            (settings(Some(Policy::Async), Some(3)), three, true),
            (settings(None, Some(3)), three, false),
            (settings(None, None), free, false),
            (settings(Some(Policy::Refit), None), Policy::Refit, true),
            (settings(Some(Policy::Async), None), free, true),
        ] {
            let chosen = settings.policy();
            let found = (chosen.value, chosen.why.is_none());
            assert_eq!(found, (policy, is_named), "{settings:?}");
        }
        assert!(settings(None, None).is_policy_auto() && !settings(None, Some(3)).is_policy_auto());
    }

    #[test]
    fn time_range_spans_all_frames() {
        let frames = [3.0, 1.5, 2.0].map(|time| Frame { index: 0, time });
        let range = |frames| Workload { frames, rays: 0 }.time_range();
        assert_eq!(range(&frames), [1.5, 3.0]);
        assert_eq!(range(&[]), [0.0, f64::INFINITY]);
    }
}
