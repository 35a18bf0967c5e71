//! The same bits from every variant, from `gpu-vulkan` on the same driver, and from the host.

use crate::scenes::{
    SHADOWED, answers, camera, go, hits, open, open_laid, rays, stand, swarm, tree_at,
};
use backend::{Backend, Generation, Layout, QueryKind, Rays};
use cpu_ref::CpuBackend;
use geom::{Animation, Hit};
use gpu_vulkan::VulkanBackend;
use gpu_wgpu::{Options, WgpuBackend};
use libtest_mimic::Failed;
use std::sync::Arc;

pub(crate) fn variants() -> [(&'static str, Options); 3] {
    let plain = Options::default();
    let wgsl = Options {
        force_wgsl: true,
        ..Options::default()
    };
    let checked = Options {
        checked: true,
        ..Options::default()
    };
    [("best", plain), ("wgsl", wgsl), ("checked wgsl", checked)]
}

type Named = (String, Box<dyn Backend>);

fn backends() -> Result<Vec<Named>, Failed> {
    let cpu = CpuBackend::new(Some(2)).map_err(|e| e.to_string())?;
    let mut all: Vec<Named> = vec![("cpu".into(), Box::new(cpu))];
    for (name, options) in variants() {
        all.push((
            format!("wgpu, {name}"),
            Box::new(WgpuBackend::new(&options)?),
        ));
    }
    let adapter = all[1].1.device().adapter.clone();
    let options = gpu_vulkan::Options {
        adapter: Some(adapter),
        ..Default::default()
    };
    match VulkanBackend::new(&options) {
        Ok(vulkan) => all.push(("vulkan".into(), Box::new(vulkan))),
        // Where wgpu reaches its adapter by Metal or DirectX 12.
        Err(backend::BackendError::NoDevice(_)) => (),
        Err(e) => return Err(e.into()),
    }
    Ok(all)
}

/// So large that `preprocess` of layout `fast` waits for positions.
pub(crate) fn large_trees_have_the_same_boxes_everywhere() -> Result<(), Failed> {
    let animation = swarm(600_000);
    let mut expected = Vec::new();
    for (name, mut backend) in backends()? {
        open_laid(&mut *backend, &animation, Layout::Fast)?;
        stand(&mut *backend, &animation, 0.7)?;
        let ticket = backend.submit()?;
        let times = backend.wait(ticket)?.times;
        if times.interpolate_ms.is_none() && times.preprocess_ms.is_some() {
            return Err(format!("{name} did not wait").into());
        }
        let boxes = backend.inspect().boxes()?;
        if expected.is_empty() {
            expected = boxes;
        } else if boxes != expected {
            return Err(format!("{name} has other boxes").into());
        }
    }
    Ok(())
}

pub(crate) fn every_variant_answers_as_its_twins_do() -> Result<(), Failed> {
    let (animation, camera, list) = (swarm(600), camera(), rays(1500));
    let queries = [
        (Rays::Camera(&camera), SHADOWED),
        (Rays::Camera(&camera), QueryKind::Closest),
        (Rays::List(&list), SHADOWED),
        (Rays::List(&list), QueryKind::Closest),
        (Rays::List(&list), QueryKind::Any),
    ];
    let mut all = backends()?;
    // The host first, then all others, in the one layout and then in the other.
    all.extend(backends()?.into_iter().skip(1));
    let usual = all.len().div_ceil(2);
    for (i, (_, backend)) in all.iter_mut().enumerate() {
        let layout = Layout::ALL[usize::from(i >= usual)];
        open_laid(backend.as_mut(), &animation, layout)?;
    }
    for (i, (rays, kind)) in queries.into_iter().enumerate() {
        let time = [0.0, 0.37, 1.0, 1.75, 2.0][i];
        let (_, reference) = &mut all[0];
        let expected = answers(reference.as_mut(), &animation, time, rays, kind)?;
        assert!(
            expected.counts[0] > 100,
            "the scene is in sight: {:?}",
            expected.counts
        );
        assert!(
            expected.counts[2] > 0 && expected.counts[3] > 0,
            "some are left out"
        );
        for (name, backend) in &mut all[1..] {
            let found = answers(backend.as_mut(), &animation, time, rays, kind)?;
            assert!(
                found == expected,
                "{name} differs from the host at {time}, query {i}"
            );
        }
    }
    Ok(())
}

pub(crate) fn any_hit_of_camera_rays_is_that_of_the_rays_one_by_one() -> Result<(), Failed> {
    let (animation, camera) = (swarm(600), camera());
    let list: Vec<_> = camera.rays().collect();
    for (name, options) in variants() {
        let mut backend = WgpuBackend::new(&options)?;
        open(&mut backend, &animation)?;
        let ask = |backend: &mut WgpuBackend, rays| {
            answers(backend, &animation, 0.8, rays, QueryKind::Any)
        };
        let found = ask(&mut backend, Rays::Camera(&camera))?;
        assert!(found == ask(&mut backend, Rays::List(&list))?, "{name}");
        let all = camera.pixels() as u64;
        assert!(found.shadows.len() as u64 == all && found.hits.is_empty());
        assert!(
            found.counts[0] > 100 && found.counts[0] < all,
            "{:?}",
            found.counts
        );
    }
    Ok(())
}

pub(crate) fn an_old_tree_and_a_new_one_give_the_same_hits() -> Result<(), Failed> {
    let (animation, camera) = (swarm(400), camera());
    for (name, options) in variants() {
        let mut backend = WgpuBackend::new(&options)?;
        open(&mut backend, &animation)?;
        let ask = |backend: &mut WgpuBackend| {
            stand(backend, &animation, 1.6)?;
            let ticket = go(backend, Rays::Camera(&camera), SHADOWED)?;
            hits(backend, ticket)
        };
        let old = ask(&mut backend)?;
        for generation in 2..6 {
            let tree = tree_at(&animation, 0.4 * generation as f64);
            backend.adopt(&tree, Generation(generation))?;
            assert_eq!(ask(&mut backend)?, old, "{name}, generation {generation}");
        }
    }
    Ok(())
}

pub(crate) fn an_empty_tree_is_missed_by_all() -> Result<(), Failed> {
    let nowhere = vec![vec![[f32::NAN; 3]; 3]];
    let animation = Arc::new(Animation::new(nowhere, vec![[0, 1, 2]])?);
    let (camera, list) = (camera(), rays(9));
    let mut backend = WgpuBackend::new(&Options::default())?;
    open(&mut backend, &animation)?;
    for (rays, kind) in [
        (Rays::Camera(&camera), SHADOWED),
        (Rays::List(&list), QueryKind::Closest),
        (Rays::List(&list), QueryKind::Any),
        (Rays::List(&[]), SHADOWED),
    ] {
        stand(&mut backend, &animation, 0.0)?;
        let ticket = go(&mut backend, rays, kind)?;
        let hits = hits(&mut backend, ticket)?;
        assert!(hits.closest.iter().all(|h| *h == Hit::MISS));
        assert!(hits.blocked.iter().all(|&b| b == 0));
        assert_eq!(
            hits.closest.len() + hits.blocked.len() > 0,
            rays.count() > 0
        );
        assert_eq!(backend.wait(ticket)?.inactive, 1);
    }
    Ok(())
}
