//! What an audit asks, and whether it finds what is wrong.

use super::*;
use backend::{Backend, Intersector, Method};
use cpu_ref::CpuBackend;

fn given() -> Vec<Given> {
    let scene = scene::open("demo:collide:300", &scene::Options::default()).unwrap();
    let name = "bodies".to_owned();
    let animation = scene.animation;
    vec![Given { name, animation }]
}

fn method(intersector: Intersector) -> Method {
    Method {
        intersector,
        ..Method::default()
    }
}

#[test]
fn batches_share_out_every_ray_among_all_meshes_places_and_scenes() {
    for rays in [1, 100, 6000, 3_000_000] {
        for given in [Vec::new(), given()] {
            let sorts = (Kind::ALL.len() + given.len()) as u64;
            let audit = Audit::new(AuditPlan { seed: 4, rays }, given);
            let specs = audit.specs();
            assert_eq!(specs.iter().map(|l| l.rays).sum::<u64>(), rays);
            let of = |name: &str| {
                let same = specs.iter().filter(|l| audit.name(l) == name);
                same.map(|l| l.rays).sum::<u64>()
            };
            let names = Kind::ALL.iter().map(|k| k.name().to_owned());
            let names = names.chain(audit.given.iter().map(|g| g.name.clone()));
            for name in names {
                let few = rays < 6000 || of(&name).abs_diff(rays / sorts) <= MOST;
                assert!(few, "{name}: {} of {rays}", of(&name));
            }
            let numbers = specs.iter().map(|l| l.number);
            assert!(numbers.clone().zip(numbers.skip(1)).all(|(a, b)| a < b));
        }
    }
}

#[test]
fn a_batch_can_be_made_again_alone_and_other_seeds_make_others() {
    let [all, other] = [4, 5].map(|seed| Audit::new(AuditPlan { seed, rays: 20_000 }, given()));
    let specs = all.specs();
    for spec in [&specs[3], &specs[specs.len() - 1]] {
        let rays = |audit: &Audit| format!("{:?}", audit.batch(spec));
        assert_eq!(rays(&all), rays(&all));
        assert_ne!(rays(&all), rays(&other));
    }
}

#[test]
fn whoever_rounds_is_found_out_with_the_ray_and_both_answers() {
    let plan = AuditPlan {
        seed: 4,
        rays: 5000,
    };
    let audit = Audit::new(plan, Vec::new());
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let mut tally = AuditCounts::default();
    for spec in audit.specs() {
        let by = method(Intersector::Watertight);
        tally += audit.batch(&spec).ask(&mut cpu, by).unwrap();
    }
    assert!(tally.wrong > 100 && tally.wrong_any > 10, "{tally:?}");
    let wrong = &tally.first[0];
    assert!(
        wrong.contains("exactly") && wrong.contains("origin"),
        "{wrong}"
    );
}

#[test]
fn a_scene_of_which_nothing_can_be_aimed_at_is_asked_all_the_same() {
    let points = vec![[f32::NAN; 3]; 3];
    let animation = Arc::new(Animation::new(vec![points], vec![[0, 1, 2]]).unwrap());
    let name = "gone".to_owned();
    let plan = AuditPlan { seed: 4, rays: 260 };
    let audit = Audit::new(plan, vec![Given { name, animation }]);
    let mut cpu = CpuBackend::new(Some(1)).unwrap();
    let specs = audit.specs();
    let last = audit.batch(&specs[specs.len() - 1]);
    let tally = last.ask(&mut cpu as &mut dyn Backend, method(Intersector::Exact));
    assert_eq!(tally.unwrap().hits, 0);
}
