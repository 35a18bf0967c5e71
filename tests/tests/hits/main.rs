//! Compares hits of `exact` and `watertight` with exact answers, on whole scenes and hard rays. Also tests `t_min` and
//! `t_max` with every intersector that rounds.

mod exact;
mod hard;
mod rounding;

use backend::Backend;
use cpu_ref::CpuBackend;
use geom::lock;
use integration::scenes::{DEMOS, REAL};
use integration::{device_trial, trial};
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

type Test = (&'static str, fn(Box<dyn Backend>) -> Box<dyn Backend>);

/// Tests of every device. Each returns the backend for the next test.
const OF_DEVICES: [Test; 8] = [
    (
        "hits_of_extreme_rays_are_lit_by_infinite_lights",
        rounding::infinite_light,
    ),
    (
        "distances_that_underflow_are_plus_zero",
        rounding::underflowing_distances,
    ),
    (
        "shadow_rays_start_finite_if_edges_overflow",
        rounding::overflowing_edges,
    ),
    (
        "overflow_by_scaling_loses_no_hit",
        rounding::overflow_by_scaling,
    ),
    (
        "boxes_near_the_origin_lose_no_exact_hit",
        rounding::near_the_origin,
    ),
    (
        "underflowing_determinants_leave_limits_exact",
        rounding::small_determinants,
    ),
    (
        "ties_at_zero_go_to_the_lowest_triangle",
        rounding::ties_at_zero,
    ),
    (
        "camera_hits_on_needles_match_single_rays",
        rounding::needles_in_a_picture,
    ),
];
/// Tests of GPUs.
const OF_GPUS: [Test; 1] = [("hard_rays", hard::rays)];

type Open = fn() -> backend::Result<Box<dyn Backend>>;

fn device_trials() -> Vec<Trial> {
    let devices: [(&str, Open, &[Test]); 4] = [
        ("cpu-ref", || Ok(Box::new(CpuBackend::new(Some(2))?)), &[]),
        ("cpu", || Ok(Box::new(cpu_simd::open(Some(2))?)), &[]),
        (
            "vulkan",
            || Ok(Box::new(gpu_vulkan::open(&Default::default())?)),
            &OF_GPUS,
        ),
        (
            "wgpu",
            || Ok(Box::new(gpu_wgpu::open(&Default::default())?)),
            &OF_GPUS,
        ),
    ];
    let mut trials = Vec::new();
    for (name, open, own) in devices {
        let opened = open();
        let absent = opened.as_ref().err().map(|e| e.to_string());
        let idle = Arc::new(Mutex::new(opened.ok()));
        for &(property, test) in OF_DEVICES.iter().chain(own) {
            let (idle, full_name) = (Arc::clone(&idle), format!("{property}_on_{name}"));
            trials.push(device_trial(full_name, name, absent.clone(), move || {
                let mut idle = lock(&idle);
                // A failed test has dropped its backend.
                let backend = idle.take().map_or_else(open, Ok).unwrap();
                *idle = Some(test(backend));
            }));
        }
    }
    trials
}
