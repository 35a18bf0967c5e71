//! Chooses the update policy for `auto`. The choice uses estimates and never traces a frame. It affects only the speed.

use crate::devices::Selected;
use crate::error::CliError;
use crate::tracer_settings::{TracerSettings, Workload};
use backend::{Backend, DeviceKind, Policy};
use geom::Animation;
use output::AutoChoice;
use pipeline::{DriverOptions, ExpectedMemory, RefitDegradation, RunFacts};

/// Describes the value that was chosen for an option that is `auto`. Returns `None` if `why` is `None`, which means
/// that the user chose the value.
pub(crate) fn choice(option: &str, value: &str, why: Option<String>) -> Option<AutoChoice> {
    Some(AutoChoice {
        what: option.to_owned(),
        takes: value.to_owned(),
        why: why?,
    })
}

/// Facts about an open backend that choices depend on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capabilities {
    pub(crate) device: DeviceKind,
    /// Whether trees can be built on the device.
    builds_trees: bool,
}

impl Capabilities {
    pub(crate) fn of(backend: &dyn Backend) -> Self {
        Self {
            device: backend.device().kind,
            builds_trees: backend.device().capabilities.device_rebuild.is_ok(),
        }
    }
}

/// Returns the policy of the settings. If the workload lists frames, replaces `auto` by the policy that is expected to
/// finish it first.
pub(crate) fn choose_policy(
    capabilities: Capabilities,
    animation: &Animation,
    settings: &TracerSettings,
    workload: Workload<'_>,
) -> Result<Selected<Policy>, CliError> {
    if !settings.is_policy_auto() || workload.frames.is_empty() {
        return Ok(settings.policy());
    }
    let (value, why) = facts(capabilities, animation, settings, workload)?.choose();
    let why = Some(why);
    Ok(Selected { value, why })
}

fn facts(
    capabilities: Capabilities,
    animation: &Animation,
    settings: &TracerSettings,
    workload: Workload<'_>,
) -> Result<RunFacts, CliError> {
    let device = capabilities.device;
    let times: Vec<f64> = workload.frames.iter().map(|f| f.time).collect();
    let rays = workload.rays;
    let threads = settings.share(device, Policy::Async);
    // Options with `device-rebuild`, to estimate the memory of trees that the device builds.
    let options = DriverOptions {
        intersector: settings.intersector,
        update: Policy::DeviceRebuild,
        time_range: workload.time_range(),
        predict: settings.predict,
    };
    let memory = ExpectedMemory::of(animation, device, &options, rays);
    Ok(RunFacts {
        frames: times.len(),
        step: mean_step(&times),
        moves: animation.moving_count() > 0,
        triangles: animation.live_count(),
        rays,
        degradation: RefitDegradation::sample(animation, &times).map_err(CliError::failed)?,
        device,
        rebuild_bytes: memory
            .device_bytes
            .filter(|_| device == DeviceKind::Gpu && capabilities.builds_trees),
        threads: threads.render,
        builder_threads: threads.build,
    })
}

/// Returns the mean step from one time to the next. Times can be in any order.
fn mean_step(times: &[f64]) -> f64 {
    let steps = times.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    steps.sum::<f64>() / (times.len().max(2) - 1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::{BackendName, Intersector};
    use pipeline::Frame;
    use scene::Scene;

    fn settings() -> TracerSettings {
        TracerSettings::of(Some(BackendName::Vulkan), Intersector::Watertight, None)
    }

    fn demo(name: &str) -> Scene {
        scene::open(name, &scene::SceneOptions::default()).unwrap()
    }

    #[test]
    fn mean_step_counts_both_directions() {
        assert_eq!(mean_step(&[0.0, 9.0, 1.0]), 8.5);
        assert_eq!(mean_step(&[3.0, 2.0, 1.0]), 1.0);
        assert_eq!(mean_step(&[3.0]), 0.0);
    }

    #[test]
    fn device_rebuild_requires_a_capable_gpu() {
        let scene = demo("demo:collide:400");
        // Frames so far apart that every frame needs a new tree.
        let frames = [0.0, 4.0, 8.0].map(|time| Frame { index: 0, time });
        let workload = Workload {
            frames: &frames,
            rays: 0,
        };
        for (device, builds_trees, expected) in [
            (DeviceKind::Gpu, true, Policy::DeviceRebuild),
            (DeviceKind::Gpu, false, Policy::Rebuild),
            (DeviceKind::Software, true, Policy::Rebuild),
            (DeviceKind::Cpu, false, Policy::Rebuild),
        ] {
            let capabilities = Capabilities {
                device,
                builds_trees,
            };
            let chosen = choose_policy(capabilities, &scene.animation, &settings(), workload);
            let policy = chosen.unwrap().value;
            assert_eq!(policy, expected, "{device:?} {builds_trees}");
        }
    }
}
