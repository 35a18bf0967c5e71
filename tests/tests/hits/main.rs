//! Compares hits of `exact` and `watertight` with exact answers, on whole scenes and hard rays. Also tests `t_min` and
//! `t_max` with every intersector that rounds.

mod exact;
mod hard;
mod rounding;

use backend::Backend;
use cpu_ref::CpuBackend;
use geom::lock;
use integration::scenes::{DEMOS, REAL};
use integration::{device_trial, named, trial};
use libtest_mimic::Trial;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};

fn main() -> ExitCode {
    let arguments = integration::arguments();
    let mut trials: Vec<Trial> = Vec::new();
    for scene in DEMOS.into_iter().chain(REAL) {
        trials.push(scene.trial("ray_limits_are_exact_at_hits", exact::check_ray_limits));
        trials.push(scene.trial("shadows_match_the_oracle", exact::shadows));
        trials.push(scene.trial("rays_match_the_oracle", exact::rays));
    }
    trials.extend(device_trials());
    trials.push(trial("odd_scenes", exact::odd_scenes));
    libtest_mimic::run(&arguments, trials).exit_code()
}

type Test = (&'static str, fn(&mut dyn Backend));

/// Tests of every device.
const OF_DEVICES: &[Test] = named![
    rounding::hits_of_extreme_rays_are_lit_by_infinite_lights,
    rounding::distances_that_underflow_are_plus_zero,
    rounding::shadow_rays_start_finite_if_edges_overflow,
    rounding::overflow_by_scaling_loses_no_hit,
    rounding::boxes_near_the_origin_lose_no_exact_hit,
    rounding::underflowing_determinants_leave_limits_exact,
    rounding::ties_at_zero_go_to_the_lowest_triangle,
    rounding::camera_hits_on_needles_match_single_rays,
];
/// Tests of GPUs.
const OF_GPUS: &[Test] = named![
    hard::rays_match_the_oracle,
    hard::watertight_finds_stacks_and_slivers,
    hard::pictures_match_the_host,
];

type Open = fn() -> backend::Result<Box<dyn Backend>>;

fn device_trials() -> Vec<Trial> {
    let devices: [(&str, Open, &[Test]); 4] = [
        ("cpu-ref", || Ok(Box::new(CpuBackend::new(Some(2))?)), &[]),
        ("cpu", || Ok(Box::new(cpu_simd::open(Some(2))?)), &[]),
        (
            "vulkan",
            || Ok(Box::new(gpu_vulkan::open(&Default::default())?)),
            OF_GPUS,
        ),
        (
            "wgpu",
            || Ok(Box::new(gpu_wgpu::open(&Default::default())?)),
            OF_GPUS,
        ),
    ];
    let mut trials = Vec::new();
    for (name, open, own) in devices {
        let opened = open();
        let absent = opened.as_ref().err().map(|e| e.to_string());
        let opened = Arc::new(Mutex::new(opened));
        for &(property, test) in OF_DEVICES.iter().chain(own) {
            let (opened, full_name) = (Arc::clone(&opened), format!("{name}::{property}"));
            trials.push(device_trial(full_name, name, absent.clone(), move || {
                let mut opened = lock(&opened);
                test(&mut **opened.as_mut().unwrap());
            }));
        }
    }
    trials
}
