//! Every property on every backend except the reference, `cpu-ref`. Tests are named `backend::property`.
//!
//! Tests of an absent backend show as ignored, with the reason in their kind.
//! `ABVH_REQUIRE_BACKENDS=cpu,wgpu,vulkan` makes them fail instead. GPU backends run under the Vulkan validation layers
//! where these are installed, and any message is a failure. A required `vulkan` needs the layers too, unless
//! `ABVH_VALIDATION=if-installed`. `ABVH_CASES` sets the number of cases of each property, `ABVH_SEED` which cases
//! these are. A case that fails is stored in `tests/proptest-regressions`. Stored cases are tested before others.
//!
//! `wgpu` is tested with the default intersector only, and skips cases with other intersectors, including stored ones.
//! `ABVH_FULL=1` tests it with every intersector, and also with kernels that are passed as WGSL with run-time checks
//! (`wgpu-wgsl`).

use backend::Inspect;
use conformance::{Cases, Disagreement, PROPERTIES, Property, Reference, check_property, nth_case};
use cpu_ref::CpuBackend;
use geom::lock;
use gpu_common::{Options, Validation};
use integration::regressions::{Regressions, StoredCase};
use integration::{is_full, is_required, number};
use libtest_mimic::Trial;
use std::sync::{Arc, Mutex};

type Open = fn() -> backend::Result<Box<dyn Inspect>>;

/// All backends except the reference: test name, name in `ABVH_REQUIRE_BACKENDS`, constructor.
const BACKENDS: &[(&str, &str, Open)] = &[
    ("cpu", "cpu", || Ok(Box::new(cpu_simd::open(Some(2))?))),
    ("vulkan", "vulkan", || {
        Ok(Box::new(gpu_vulkan::open(&vulkan())?))
    }),
    ("wgpu", "wgpu", || wgpu(false)),
    ("wgpu-wgsl", "wgpu", || wgpu(true)),
];

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

fn wgpu(uses_checked_wgsl: bool) -> backend::Result<Box<dyn Inspect>> {
    let options = Options {
        validation: Validation::IfInstalled,
        uses_checked_wgsl,
        ..Default::default()
    };
    Ok(Box::new(gpu_wgpu::open(&options)?))
}

fn main() {
    let arguments = integration::arguments();
    // Without the full tier, only `wgpu_lent::featureless_device_gives_same_hits` tests kernels that are passed as WGSL
    // with run-time checks.
    let tested = BACKENDS
        .iter()
        .filter(|(name, ..)| *name != "wgpu-wgsl" || is_full());
    let of_each = tested.map(|&backend| trials_of(backend));
    // Interleaves the backends' tests: tests of one backend wait for each other, tests of different backends do not.
    let mut trials: Vec<_> = of_each.flat_map(|all| (0..).zip(all)).collect();
    trials.sort_by_key(|&(n, _): &(u32, _)| n);
    let mut trials: Vec<_> = trials.into_iter().map(|(_, trial)| trial).collect();
    trials.push(integration::trial(
        "regressions::cases_are_stored_once",
        cases_are_stored_once,
    ));
    libtest_mimic::run(&arguments, trials).exit();
}

fn cases_are_stored_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("property.txt");
    let mut regressions = Regressions::at(path.to_str().unwrap().to_owned());
    assert_eq!(regressions.cases(), []);
    let minimal = Box::new(nth_case(1, 0));
    for case in [3, u32::MAX, 3] {
        regressions.add(&Disagreement {
            property: "a_property",
            backend: "cpu",
            seed: u64::MAX - 1,
            case,
            what: "1 is not 2".to_owned(),
            minimal: minimal.clone(),
            held: 0,
        });
    }
    let stored = [3, u32::MAX].map(|number| StoredCase {
        seed: u64::MAX - 1,
        number,
    });
    assert_eq!(regressions.cases(), stored);
    let text = std::fs::read_to_string(path).unwrap();
    // Proptest replaces line breaks.
    let shown = minimal.to_string().replace('\n', " ");
    assert!(text.contains(&format!("# shrinks to {shown}\n")), "{text}");
}

/// Creates a backend's tests. Those of an absent backend are ignored, or fail if the backend is required.
fn trials_of((name, requirement, open): (&'static str, &str, Open)) -> Vec<Trial> {
    let opened = open();
    let absent = opened.as_ref().err().map(|e| format!("absent: {e}"));
    let is_ignored = absent.is_some() && !is_required(requirement);
    let host = CpuBackend::new(Some(1)).expect("one thread is available");
    let reference = Reference::new(Box::new(host));
    // The last value is the number of validation messages already seen. It starts at 0, so that the first test also
    // reports messages from opening the backend.
    let shared = Arc::new(Mutex::new((opened, reference, 0)));
    // A software driver would take minutes to compile all kernels again. `vulkan` uses the same ones.
    let is_narrowed = requirement == "wgpu" && !is_full();
    let trial = |property: &Property| {
        let shared = Arc::clone(&shared);
        let property = if is_narrowed {
            property.by_usual_intersector()?
        } else {
            *property
        };
        let trial = Trial::test(format!("{name}::{}", property.name), move || {
            let mut shared = lock(&shared);
            let (subject, reference, seen_messages) = &mut *shared;
            let subject = subject.as_mut().map_err(|e| format!("absent: {e}"))?;
            let seed = number("ABVH_SEED", 1);
            let numbers = property.case_numbers().take(cases(name) as usize);
            let mut regressions = Regressions::of(property.name);
            let stored = regressions.cases().into_iter();
            let stored = stored.map(|case| Cases::new(case.seed, case.number..=case.number));
            let mut all = stored.chain(numbers.map(|number| Cases::new(seed, number..=number)));
            let held = all.try_for_each(|cases| {
                check_property(&property, &mut **subject, reference, &cases).map(drop)
            });
            if let Err(found) = &held {
                regressions.add(found);
            }
            let validation_messages = subject.complaints();
            let new = validation_messages[*seen_messages..].first();
            *seen_messages = validation_messages.len();
            held.map_err(|found| {
                let (backend, options) = (found.backend, found.options());
                format!("{found}\nabvh conform --backend {backend} {options}")
            })?;
            new.map_or(Ok(()), |m| {
                Err(format!("the validation layer or wgpu says: {m}").into())
            })
        });
        let trial = trial.with_kind(absent.as_deref().unwrap_or_default());
        Some(trial.with_ignored_flag(is_ignored))
    };
    PROPERTIES.iter().filter_map(trial).collect()
}

/// Returns the number of cases: by default one for each kind of scene, and fewer for `wgpu`, because `vulkan` tests
/// the same kernels. The full tier has more.
fn cases(name: &str) -> u32 {
    let default = match name {
        _ if is_full() => 36,
        "wgpu" => 5,
        _ => 15,
    };
    u32::try_from(number("ABVH_CASES", default)).unwrap_or(u32::MAX)
}
