//! What an audit asks, and whether it finds what is wrong.

use super::*;
use backend::Method;
use cpu_ref::CpuBackend;

fn given() -> Vec<(String, Arc<Animation>)> {
    let scene = scene::open("demo:collide:300", &scene::Options::default());
    vec![("bodies".to_owned(), scene.unwrap().animation)]
}

#[test]
fn batches_share_out_every_ray_among_all_meshes_and_scenes() {
    for rays in [1, 100, 6000, 3_000_000] {
        let audit = Audit::new(4, rays, given());
        let specs = audit.specs();
        let sorts = SceneKind::ALL.len() as u64 + 1;
        for source in specs.chunk_by(|a, b| audit.name(a) == audit.name(b)) {
            let sum: u64 = source.iter().map(|spec| spec.rays).sum();
            assert!(sum.abs_diff(rays / sorts) <= 1, "{sum} of {rays}");
        }
        assert_eq!(specs.iter().map(|spec| spec.rays).sum::<u64>(), rays);
        assert!(specs.is_sorted_by(|a, b| a.number < b.number));
    }
}

#[test]
fn a_batch_can_be_made_again_alone_and_other_seeds_make_others() {
    let [all, other] = [4, 5].map(|seed| Audit::new(seed, 20_000, given()));
    let specs = all.specs();
    for spec in [&specs[3], &specs[specs.len() - 1]] {
        let rays = |audit: &Audit| format!("{:?}", audit.batch(spec));
        assert_eq!(rays(&all), rays(&all));
        assert_ne!(rays(&all), rays(&other));
    }
}

#[test]
fn whoever_rounds_is_found_out_with_the_ray_and_both_answers() {
    let audit = Audit::new(4, 5000, Vec::new());
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let mut tally = AuditCounts::default();
    for spec in audit.specs() {
        tally += audit.batch(&spec).ask(&mut cpu, Method::default()).unwrap();
    }
    assert!(tally.wrong > 100 && tally.wrong_any > 10, "{tally:?}");
    let wrong = &tally.first[0];
    assert!(
        wrong.contains("exactly") && wrong.contains("origin"),
        "{wrong}"
    );
}
