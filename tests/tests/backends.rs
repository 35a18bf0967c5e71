//! Every property on every backend. Tests are named `backend::property`.
//!
//! Tests of an absent backend show as ignored, with the reason in their kind.
//! `ABVH_REQUIRE_BACKENDS=cpu,wgpu,vulkan` makes them fail instead. GPU backends run under the Vulkan validation layers
//! where these are installed, and any message is a failure. A required `vulkan` needs the layers too, unless
//! `ABVH_VALIDATION=if-installed`. `ABVH_CASES` and `ABVH_SEED` choose the number of cases and the cases of a property.

use backend::Backend;
use conformance::{LAWS, Law, OWN_TREE_LAWS, Reference, hold, laws_of};
use cpu_ref::CpuBackend;
use gpu_common::{Options, Validation};
use gpu_vulkan::VulkanBackend;
use gpu_vulkan_rt::{DriverTreeBackend, Prefer};
use gpu_wgpu::WgpuBackend;
use integration::{is_required, number};
use libtest_mimic::Trial;
use std::sync::{Arc, Mutex, PoisonError};

type Open = fn() -> backend::Result<Box<dyn Backend>>;

/// All backends: test name, name in `ABVH_REQUIRE_BACKENDS`, constructor.
const BACKENDS: &[(&str, &str, Open)] = &[
    ("cpu", "cpu", || Ok(Box::new(cpu_simd::open(Some(2))?))),
    ("vulkan", "vulkan", || {
        Ok(Box::new(VulkanBackend::new(&vulkan())?))
    }),
    ("vulkan-rt", "vulkan-rt", || driver(Prefer::FastBuild)),
    ("vulkan-rt:fast-trace", "vulkan-rt", || {
        driver(Prefer::FastTrace)
    }),
    ("wgpu", "wgpu", || wgpu(false)),
    ("wgpu-wgsl", "wgpu", || wgpu(true)),
];

fn driver(prefer: Prefer) -> backend::Result<Box<dyn Backend>> {
    Ok(Box::new(DriverTreeBackend::new(&vulkan(), prefer)?))
}

fn vulkan() -> Options {
    let lenient = std::env::var("ABVH_VALIDATION").is_ok_and(|v| v == "if-installed");
    let validation = if is_required("vulkan") && !lenient {
        Validation::Required
    } else {
        Validation::IfInstalled
    };
    Options {
        validation,
        ..Default::default()
    }
}

fn wgpu(checks_kernels: bool) -> backend::Result<Box<dyn Backend>> {
    let options = Options {
        validation: Validation::IfInstalled,
        checks_kernels,
        ..Default::default()
    };
    Ok(Box::new(WgpuBackend::new(&options)?))
}

fn main() {
    let arguments = integration::arguments();
    let of_each = BACKENDS.iter().map(|&backend| trials_of(backend));
    // Interleaves the backends' tests: tests of one backend wait for each other, tests of different backends do not.
    let mut trials: Vec<_> = of_each.flat_map(|all| (0..).zip(all)).collect();
    trials.sort_by_key(|&(n, _): &(u32, _)| n);
    let trials = trials.into_iter().map(|(_, trial)| trial).collect();
    libtest_mimic::run(&arguments, trials).exit();
}

/// Creates a backend's tests. Those of an absent backend are ignored, or fail if the backend is required.
fn trials_of((name, requirement, open): (&'static str, &str, Open)) -> Vec<Trial> {
    let opened = open();
    let absent = opened.as_ref().err().map(|e| format!("absent: {e}"));
    let is_ignored = absent.is_some() && !is_required(requirement);
    let laws = match &opened {
        Ok(subject) => laws_of(&**subject),
        Err(_) if name.starts_with("vulkan-rt") => OWN_TREE_LAWS,
        Err(_) => LAWS,
    };
    let host = CpuBackend::new(Some(1)).expect("one thread can be had");
    let reference = Reference::new(Box::new(host));
    // The number is that of the complaints reported so far. It starts at 0, to include complaints while opening.
    let shared = Arc::new(Mutex::new((opened, reference, 0)));
    // A software driver would take a minute to compile a third variant of all kernels.
    let is_narrowed = name == "wgpu-wgsl" && !integration::is_full();
    let trial = |law: &Law| {
        let shared = Arc::clone(&shared);
        let law = if is_narrowed {
            law.by_usual_intersector()?
        } else {
            *law
        };
        let trial = Trial::test(format!("{name}::{}", law.name), move || {
            let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
            let (subject, reference, heard) = &mut *shared;
            let subject = subject.as_mut().map_err(|e| format!("absent: {e}"))?;
            let seed = number("ABVH_SEED", 1);
            let held = hold(&law, &mut **subject, reference, seed, 0..cases(name));
            let complaints = subject.inspect().complaints();
            let new = complaints[*heard..].first();
            *heard = complaints.len();
            held.map_err(|e| e.to_string())?;
            new.map_or(Ok(()), |m| {
                Err(format!("the validation layer says: {m}").into())
            })
        });
        let trial = trial.with_kind(absent.as_deref().unwrap_or_default());
        Some(trial.with_ignored_flag(is_ignored))
    };
    laws.iter().filter_map(trial).collect()
}

/// Returns the number of cases: by default one for each kind of scene, and fewer for backends that differ from another
/// one only in device, kernel variant or preference. The full tier has more.
fn cases(name: &str) -> u32 {
    let default = match name {
        _ if integration::is_full() => 36,
        "wgpu" => 5,
        "wgpu-wgsl" | "vulkan-rt:fast-trace" => 4,
        _ => 15,
    };
    u32::try_from(number("ABVH_CASES", default)).unwrap_or(u32::MAX)
}
